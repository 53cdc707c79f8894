// Days after a calibration: rows of a later table, held against the robot as it was calibrated.

import { saveBlob } from "./save.js";

/** The most bytes of a file, and of all meshes. */
export const MOST_BYTES = 64 * 2 ** 20;

/** What a report says, without its styles, which are for print. @param {string} report */
export function bodyOf(report) {
  const text = report.replace(/<style>[^]*?<\/style>/, "");
  return new DOMParser().parseFromString(text, "text/html").querySelector("main");
}

/** The section of the page that asks for them. */
export class Later {
  #section;
  #page;

  /**
   * @param {HTMLElement} section
   * @param {{files: () => Record<string, string>, watch: (files: Record<string, string>, asked: object) => void, complain: (what: string) => void}} page
   *   the files that the robot was calibrated by, what holds rows against it, and where it is told what is wrong
   */
  constructor(section, page) {
    [this.#section, this.#page] = [section, page];
    const input = this.#at("#later-input");
    this.#at("#choose-later").onclick = () => input.click();
    input.onchange = () => {
      const [table] = input.files;
      if (table !== undefined) this.#take(table);
      input.value = "";
    };
    this.#at("#watch-held-out").onclick = () => this.#ask(page.files(), null);
  }

  #at = (selector) => this.#section.querySelector(selector);

  /** Shows the section, with nothing in it yet. */
  open() {
    this.#section.hidden = false;
    this.#at("#watched").replaceChildren();
    this.#page.complain("");
  }

  /** Offers the rows that the calibration file holds out, if it does. @param {boolean} are */
  offer(are) {
    this.#at("#watch-held-out").hidden = !are;
  }

  /** @param {File} table */
  async #take(table) {
    if (table.size > MOST_BYTES) return this.#page.complain(`${table.name} has more than ${MOST_BYTES / 2 ** 20} MiB`);
    const files = this.#page.files();
    // The table that was learned from may have the same name.
    const name = table.name in files ? `later ${table.name}` : table.name;
    this.#ask({ ...files, [name]: await table.text() }, name);
  }

  #ask(files, later) {
    this.#at("#watched").replaceChildren();
    const [allowed, covariate] = ["#alarms", "#covariate"].map((field) => this.#at(field).value.trim());
    this.#page.watch(files, { later, false_alarms_per_year: Number(allowed) || null, covariate: covariate || null });
  }

  /** @param {{page: string, report: object}} answer */
  show({ page, report }) {
    const keep = Object.assign(document.createElement("button"), { type: "button", textContent: "Download watch.json" });
    keep.onclick = () => saveBlob(new Blob([JSON.stringify(report, null, 2)]), "watch.json");
    const body = bodyOf(page);
    // Its title is one of a page of its own.
    const [title, subtitle] = ["h1", "header p"].map((part) => body.querySelector(part)?.textContent ?? "");
    body.querySelector("header")?.remove();
    const told = [["lead", title], ["quiet", subtitle]].map(([className, textContent]) => Object.assign(document.createElement("p"), { className, textContent }));
    body.querySelector(".lead")?.classList.remove("lead");
    this.#at("#watched").replaceChildren(...told, ...body.childNodes, keep);
    this.#section.scrollIntoView({ behavior: "smooth" });
  }
}
