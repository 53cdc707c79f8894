// Addresses: which of them are of one run, and whom a link can be given to.

const LOOPBACK = /^(localhost|.*\.localhost|127(\.\d+){3}|\[::1\])$/;
const PRIVATE = /^(10(\.\d+){3}|192\.168(\.\d+){2}|172\.(1[6-9]|2\d|3[01])(\.\d+){2}|169\.254(\.\d+){2}|\[f[cd].*\]|\[fe[89ab].*\]|.*\.local|[^.:]+)$/i;

/** What addresses of one run have in common. @param {string} query */
export function identity(query) {
  const parameters = new URLSearchParams(query);
  // A run can be computed again; of a robot elsewhere there is but the session.
  const names = parameters.has("scenario") ? ["scenario", "set", "seed", "learners"] : ["session"];
  return names.map((name) => parameters.getAll(name).join("&")).join(" ");
}

/** Whether an address names nothing, so that what is shown is the page's choice. @param {URLSearchParams} query */
export const isFresh = (query) => [...query.keys()].every((name) => name.startsWith("utm_"));

/** Who else can open a link to this host, if not everybody. @param {string} host */
export function reach(host) {
  if (LOOPBACK.test(host)) return "Only this machine can open this link: the server listens at " + host + ".";
  if (PRIVATE.test(host)) return "Only machines of this network can open this link: the server is at " + host + ".";
  return null;
}

/**
 * Puts a text, or the page's address with this query, on the clipboard.
 * @param {string} text
 * @returns {Promise<{done: boolean, note?: string}>}
 */
export async function copied(text) {
  const isLink = text.startsWith("?");
  const whole = isLink ? location.origin + location.pathname + text : text;
  const done = await (navigator.clipboard?.writeText(whole) ?? Promise.reject()).then(() => true, () => false);
  const caution = isLink && done ? reach(location.hostname) : null;
  return caution === null ? { done } : { done, note: `Copied. ${caution}` };
}
