// The service worker of a folder: it keeps all files in the browser, so that the page needs its host only once.
//
// An export writes its files into the first line. A server has none: where its address was that of a folder before, the worker of
// that folder is replaced by this one, which takes itself away.

const { version, files } = { version: "", files: [] };

/** Where the folder is, with a slash at its end. Other folders of this host have caches of their own. */
const folder = registration.scope;
const OURS = `body-schema ${folder} `;
const CACHE = OURS + version;
const PAGE = "index.html";
/** The versions of files, by their paths. */
const versions = new Map(files);

addEventListener("install", (event) => event.waitUntil(versions.size > 0 ? fill() : skipWaiting()));
addEventListener("activate", (event) => event.waitUntil(activated()));
addEventListener("message", ({ data }) => data === "replace" && skipWaiting());
addEventListener("fetch", (event) => {
  const path = kept(event.request);
  if (path !== null) event.respondWith(answer(path, event.request));
});

/** Keeps every file. One that is there already, from an attempt that failed, has the right content: the version says so. */
async function fill() {
  const cache = await caches.open(CACHE);
  for (const [path, version] of versions) {
    if (await cache.match(folder + path)) continue;
    // Hosts send some pages elsewhere that are asked for by their names. The address with the version is that by which the page
    // has had its large files: they are in the browser's own cache.
    const response = await fetch(`${folder}${path === PAGE ? "" : path}?v=${version}`);
    if (!response.ok) throw new Error(`${path} cannot be read (${response.status})`);
    await cache.put(folder + path, anew(response));
  }
}

/** The same content without the way on which it came: browsers refuse pages that came from elsewhere. */
function anew(response) {
  return new Response(response.body, { headers: { "Content-Type": response.headers.get("Content-Type") ?? "" } });
}

async function activated() {
  const names = await caches.keys();
  await Promise.all(names.filter((name) => name.startsWith(OURS) && name !== CACHE).map((name) => caches.delete(name)));
  if (versions.size > 0) return;
  await registration.unregister();
  // These pages are the folder's, which is gone.
  for (const page of await clients.matchAll({ type: "window" })) page.navigate(page.url).catch(() => {});
}

/** The path of the file that a request is for, if it is kept. @param {Request} request */
function kept({ method, url, headers }) {
  const address = new URL(url);
  const place = address.origin + address.pathname;
  if (method !== "GET" || headers.has("Range") || !place.startsWith(folder)) return null;
  const path = place.slice(folder.length) || PAGE;
  return versions.has(path) ? path : null;
}

/** A file as it was kept, or from the host where the browser has thrown it away. */
async function answer(path, request) {
  const cache = await caches.open(CACHE);
  return (await cache.match(folder + path)) ?? fetch(request);
}
