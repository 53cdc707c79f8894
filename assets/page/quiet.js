// A quiet console: the viewer writes thousands of lines about its inner workings, which tell a visitor nothing.

/** How its lines of each level begin. */
const LINE = /^\s*(TRACE|DEBUG|INFO|WARN)\s+\w+/;
const LEVELS = ["debug", "log", "info", "warn"];

/** From now on the console has only what the page says itself, and errors. */
export function quiet() {
  // Chromium warns of canvases that are read often, as egui's and Rerun's are, unless they say so.
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return getContext.call(this, kind, kind === "2d" ? { willReadFrequently: true, ...options } : options);
  };
  for (const level of LEVELS) {
    const say = console[level].bind(console);
    console[level] = (...texts) => typeof texts[0] === "string" && LINE.test(texts[0]) || say(...texts);
  }
}
