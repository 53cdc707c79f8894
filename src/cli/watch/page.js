// Keeps the page as the watch is, and says when that does not answer.

const EVERY_MS = 3000;
const PATIENCE_MS = 10000;

const away = document.getElementById("away");
let shown = null;

async function renew() {
  try {
    const response = await fetch(location.pathname, { cache: "no-store", signal: AbortSignal.timeout(PATIENCE_MS) });
    if (!response.ok) throw new Error(response.statusText);
    const text = await response.text();
    // What is the same stays: somebody may be reading or copying it.
    if (text !== shown) {
      const next = new DOMParser().parseFromString(text, "text/html");
      document.querySelector("main").replaceWith(next.querySelector("main"));
      document.title = next.title;
      shown = text;
    }
    away.hidden = true;
  } catch {
    away.hidden = false;
  }
  setTimeout(renew, EVERY_MS);
}

renew();
