// The folder is kept in the browser: once loaded, the page needs its host no more.

import { at } from "./folder.js";

/** How long a new version may take to come in the place of the one that was kept, ms. */
const REPLACED_WITHIN = 5000;

/** What keeps the folder. Pages that came without encryption have none, unless from this machine, and frames may be refused it. */
const workers = (() => {
  try {
    return navigator.serviceWorker;
  } catch {
    return undefined;
  }
})();

/** Where the next version of the folder has been kept meanwhile, the page begins again with that. */
export async function newest() {
  const next = (await workers?.getRegistration(at("")).catch(() => undefined))?.waiting;
  if (!next) return;
  const replaced = new Promise((resolve) => workers.addEventListener("controllerchange", () => resolve(true), { once: true }));
  next.postMessage("replace");
  const late = new Promise((resolve) => setTimeout(() => resolve(false), REPLACED_WITHIN));
  if (!(await Promise.race([replaced, late]))) return;
  location.reload();
  // Nothing is to begin here any more.
  await new Promise(() => {});
}

/** Keeps the folder from now on, and looks whether its host has another version. What a browser does not allow is left. */
export async function keep() {
  try {
    const registration = await workers?.register(at("sw.js"));
    await registration?.update();
  } catch {}
}
