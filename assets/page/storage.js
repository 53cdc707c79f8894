// What the browser keeps for a page. Visitors may have forbidden it, and its room may be taken: the page does without.

/** Keeps a text, for this visit or for all. @param {"sessionStorage" | "localStorage"} [store] @returns {boolean} whether it is kept */
export function keep(name, value, store = "sessionStorage") {
  try {
    window[store].setItem(name, value);
    return true;
  } catch {
    return false;
  }
}

/** A text that was kept, or null. @param {"sessionStorage" | "localStorage"} [store] */
export function kept(name, store = "sessionStorage") {
  try {
    return window[store].getItem(name);
  } catch {
    return null;
  }
}

/** Keeps a text no longer. @param {"sessionStorage" | "localStorage"} [store] */
export function forget(name, store = "sessionStorage") {
  try {
    window[store].removeItem(name);
  } catch {}
}
