// Says that the scene is behind the panel, while it is.

/** Behind for so long it is told, ms. */
const TOLD_AFTER = 1500;
/** It is told anew so often, ms. */
const EVERY = 300;

export class Lag {
  #note;
  #shown;
  /** The step that the scene is asked for, and since when it owes one; null while it owes none. */
  #sought = 0;
  #since = null;
  #timer = 0;

  /**
   * @param {HTMLElement} note
   * @param {() => number} shown the step that the scene shows
   */
  constructor(note, shown) {
    this.#note = note;
    this.#shown = shown;
  }

  /** The scene is asked for a step. @param {number} step */
  seek(step) {
    this.#sought = step;
    this.#since ??= performance.now();
    this.#timer ||= setInterval(() => this.#tell(), EVERY);
  }

  /** The scene shows a step: progress, though another may have been asked for since. @param {number} step */
  there(step) {
    this.#since = step === this.#sought ? null : performance.now();
    if (this.#since === null) this.stop();
  }

  /** Nothing is owed any more. */
  stop() {
    clearInterval(this.#timer);
    [this.#timer, this.#since] = [0, null];
    this.#note.hidden = true;
  }

  #tell() {
    if (performance.now() - this.#since < TOLD_AFTER) return;
    const text = `The scene is behind: it shows step ${this.#shown()}, the panel is at ${this.#sought}.`;
    if (this.#note.textContent !== text) this.#note.textContent = text;
    this.#note.hidden = false;
  }
}
