// The legend under the scene: what its colours mean.

const COLOUR = /rgba?\([^)]*\)/;

export class Legend {
  #list;
  #learners;
  #ellipsoids;
  #truth;
  #seen;
  #suggested;
  #tried;
  /** What it says of the session, as text: it is built anew only for another. */
  #said = "";

  /** @param {HTMLElement} list whose lines say what is the same in every session */
  constructor(list) {
    this.#list = list;
    this.#learners = list.querySelector("[data-line=learner]");
    this.#ellipsoids = list.querySelector("[data-line=ellipsoids] span");
    this.#truth = list.querySelector("[data-line=truth]");
    this.#seen = list.querySelector("[data-line=seen] span");
    this.#suggested = list.querySelector("[data-line=suggested]");
    this.#tried = list.querySelector("[data-line=tried]");
    this.#learners.remove();
  }

  /**
   * @param {{learners: {name: string, colour: number[]}[], ellipsoids: string, truth: boolean, seen: string, suggested: boolean,
   *   tried: number[] | null}} caption
   */
  show({ learners, ellipsoids, truth, seen, suggested, tried }) {
    const said = JSON.stringify([learners.map(({ name, colour }) => [name, colour]), ellipsoids, truth, seen, suggested, tried]);
    if (said === this.#said) return;
    this.#said = said;
    this.#ellipsoids.textContent = ellipsoids;
    this.#seen.textContent = seen;
    // Of measured data there is no true arm.
    if (truth) this.#seen.closest("li").before(this.#truth);
    else this.#truth.remove();
    if (suggested) this.#list.append(this.#suggested);
    else this.#suggested.remove();
    // The ghost of an arm, in the colour of the visitor's.
    if (tried) this.#list.append(this.#tried);
    else this.#tried.remove();
    this.#tried.querySelector("i").style.backgroundColor = tried ? `rgb(${tried.join(" ")} / 43%)` : "";
    this.#list.querySelectorAll("[data-line=learner]").forEach((line) => line.remove());
    this.#list.prepend(...learners.map((learner) => this.#line(learner)));
    this.#list.hidden = learners.length === 0;
  }

  /** Marks the line that is spoken of, or none. @param {string | null} at its name */
  point(at) {
    for (const line of this.#list.children) line.toggleAttribute("data-pointed", line.dataset.line === at);
  }

  #line({ name, colour }) {
    const line = this.#learners.cloneNode(true);
    line.querySelector("i").style.backgroundColor = `rgb(${colour.join(" ")})`;
    line.querySelector("span").textContent = name;
    return line;
  }

  /** What is the same in every session, for a picture. @returns {[string, string][]} text and colour */
  lines() {
    return [...this.#list.querySelectorAll("li:not([data-line=learner])")].map((line) => {
      const { backgroundColor, backgroundImage } = getComputedStyle(line.querySelector("i"));
      return [line.textContent.trim(), COLOUR.exec(backgroundImage)?.[0] ?? backgroundColor];
    });
  }
}
