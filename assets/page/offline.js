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

/**
 * Where the next version of the folder has been kept meanwhile, the page begins again with that. It waits for it no longer than
 * visitors do; where it comes later, the page begins again then, since all that it would still ask for is of the next version.
 */
export async function newest() {
  const next = (await workers?.getRegistration(at("")).catch(() => undefined))?.waiting;
  if (!next) return;
  await new Promise((late) => {
    const waits = setTimeout(late, REPLACED_WITHIN);
    const again = () => {
      // Nothing is to begin here any more.
      clearTimeout(waits);
      location.reload();
    };
    workers.addEventListener("controllerchange", again, { once: true });
    next.postMessage("replace");
  });
}

/** Keeps the folder from now on, and looks whether its host has another version. What a browser does not allow is left. */
export async function keep() {
  try {
    const registration = await workers?.register(at("sw.js"));
    await registration?.update();
  } catch {}
}
