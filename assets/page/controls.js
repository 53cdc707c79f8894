// The panel's controls as real elements, for the keyboard and for assistive technology. They lie over the canvas, each
// where its widget is drawn, and are seen only while they have the focus; the pointer goes through them.

/** How often the panel is asked for its elements, ms. */
const EVERY_MS = 100;
/** So long after it was opened by a key, a list takes the focus, ms. */
const OPENED_WITHIN_MS = 1500;

const TAGS = {
  text: "span", heading: "h2", image: "span", button: "button", combobox: "button", checkbox: "input", radio: "input",
  range: "input", number: "input", field: "input", link: "a", group: "div", table: "table", row: "tr", cell: "td",
  head: "th",
};
const TYPES = { button: "button", combobox: "button", checkbox: "checkbox", radio: "radio", range: "range", number: "number", field: "text" };

const FOCUSABLE = "button, input, a";

export class Controls {
  #root;
  #act;
  /** Elements of the page by the ids of their widgets, and what the panel said of them last. */
  #elements = new Map();
  #told = new Map();
  /** What was pressed last, and when: what opens then takes the focus, and gives it back. */
  #pressed = null;
  #pressedAt = -Infinity;

  /**
   * @param {HTMLElement} root where the elements go
   * @param {{elements: () => string | undefined, act: (json: string) => void, release: () => void}} panel
   */
  constructor(root, panel) {
    this.#root = root;
    this.#act = (id, act, more) => panel.act(JSON.stringify({ id, act, ...more }));
    root.addEventListener("click", (event) => this.#click(event));
    root.addEventListener("input", ({ target }) => target.type === "range" && this.#set(target));
    root.addEventListener("change", ({ target }) => this.#change(target));
    root.addEventListener("keydown", (event) => event.key === "Enter" && this.#change(event.target));
    root.addEventListener("focusin", ({ target }) => {
      panel.release();
      if (target !== root && !this.#isInView(target)) this.#act(target.dataset.id, "show");
    });
    setInterval(() => {
      const json = panel.elements();
      if (json !== undefined) this.#show(JSON.parse(json));
    }, EVERY_MS);
  }

  /** Puts the focus on the element that had it last, or before all of them. */
  focus() {
    (this.#pressed?.isConnected ? this.#pressed : this.#root).focus();
  }

  /** Whether keys are text where the focus is. */
  static isTyping(target) {
    return target instanceof HTMLInputElement && ["text", "number"].includes(target.type);
  }

  #click({ target }) {
    const element = target.closest("[data-id]");
    if (element === null || !["button", "combobox", "checkbox", "radio", "link"].includes(element.dataset.kind)) return;
    const inList = element.closest("[data-kind=group]") !== null;
    if (!inList) this.#pressed = element;
    this.#pressedAt = performance.now();
    this.#act(element.dataset.id, inList && element.dataset.pressed !== undefined ? "choose" : "click");
  }

  #set(target) {
    if (Number.isFinite(target.valueAsNumber)) this.#act(target.dataset.id, "set", { number: target.valueAsNumber });
  }

  #change(target) {
    const said = this.#told.get(target.dataset?.id);
    if (target.type === "number" && target.valueAsNumber !== said?.number?.value) this.#set(target);
    if (target.type === "text" && target.value !== said?.text) this.#act(target.dataset.id, "enter", { text: target.value });
  }

  #isInView(element) {
    const { top, bottom } = element.getBoundingClientRect();
    const frame = this.#root.getBoundingClientRect();
    const pane = this.#told.get(element.dataset.id)?.pane ?? 0;
    // What scrolls does so beneath the first pane.
    const fixed = [...this.#elements.values()].filter((one) => this.#told.get(one.dataset.id)?.pane === 1);
    const edge = pane > 1 ? Math.max(frame.top, ...fixed.map((one) => one.getBoundingClientRect().bottom)) : frame.top;
    return top >= edge && bottom <= frame.bottom;
  }

  #show(list) {
    const had = this.#root.contains(document.activeElement) ? document.activeElement : null;
    const order = had === null ? [] : [...this.#root.querySelectorAll(FOCUSABLE)];
    const wasInList = had?.closest("[data-kind=group]") != null;
    const groups = new Set([...this.#elements].filter(([, one]) => one.dataset.kind === "group").map(([id]) => id));
    const alive = new Set();
    this.#fill(this.#root, list, alive);
    for (const [id, element] of this.#elements) {
      if (alive.has(id)) continue;
      element.remove();
      this.#elements.delete(id);
      this.#told.delete(id);
    }
    const opened = list.find((one) => one.kind === "group" && !groups.has(one.id));
    if (opened !== undefined && had !== null && performance.now() - this.#pressedAt < OPENED_WITHIN_MS) {
      const group = this.#elements.get(opened.id);
      (group.querySelector("[aria-pressed=true]") ?? group.querySelector("button, input, a"))?.focus();
    } else if (had !== null && !had.isConnected) {
      if (wasInList) this.focus();
      else this.#focusBeside(had, order);
    }
  }

  /** Gives the focus of an element that is no more to the next that was behind it, or else to the last before it: whoever goes
   * through the controls goes on from there, whichever way. */
  #focusBeside(gone, order) {
    const index = order.indexOf(gone);
    const others = [...order.slice(index + 1), ...order.slice(0, Math.max(index, 0)).reverse()];
    (others.find((one) => one.isConnected && !one.disabled) ?? this.#root).focus();
  }

  /** Makes the children of an element those of the list, without moving what has the focus. */
  #fill(parent, list, alive) {
    list.forEach((said, index) => {
      const element = this.#element(said);
      alive.add(said.id);
      const inWay = parent.children[index];
      if (inWay !== element) {
        const hasFocus = element.parentElement === parent && element.contains(document.activeElement);
        if (hasFocus) while (parent.children[index] !== element) parent.append(parent.children[index]);
        else parent.insertBefore(element, inWay ?? null);
      }
      if (said.children !== undefined) this.#fill(element, said.children, alive);
    });
  }

  /** The element of a widget, as it is told. */
  #element(said) {
    const { id, kind } = said;
    let element = this.#elements.get(id);
    if (element?.dataset.kind !== kind) {
      const last = element;
      element = document.createElement(TAGS[kind]);
      Object.assign(element.dataset, { id, kind });
      if (kind in TYPES) element.type = TYPES[kind];
      if (kind === "head") element.scope = "col";
      if (kind === "image") element.setAttribute("role", "img");
      if (kind === "group") element.setAttribute("role", "group");
      if (kind === "combobox") element.setAttribute("aria-haspopup", "true");
      if (kind === "link") element.setAttribute("role", "link"), (element.tabIndex = 0);
      if (kind === "field") element.autocomplete = "off";
      last?.remove();
      this.#elements.set(id, element);
    }
    this.#describe(element, said);
    this.#told.set(id, said);
    return element;
  }

  #describe(element, { id, kind, name = "", text, number, on, disabled = false, place }) {
    if (["text", "heading", "button", "link"].includes(kind)) {
      if (element.textContent !== name) element.textContent = name;
    } else if (kind === "combobox") {
      element.textContent = name.endsWith(text) ? name : text.startsWith(name) ? text : `${name}: ${text}`;
    } else if (kind !== "row" && kind !== "cell" && kind !== "head") {
      element.setAttribute("aria-label", name || "Choices");
    }
    if (kind === "button") {
      element.toggleAttribute("data-pressed", on !== undefined);
      if (on === undefined) element.removeAttribute("aria-pressed");
      else element.setAttribute("aria-pressed", String(on));
    }
    if (kind === "combobox" && on !== undefined) element.setAttribute("aria-expanded", String(on));
    if (kind === "checkbox" || kind === "radio") element.checked = on === true;
    if (number !== undefined && (kind === "range" || kind === "number")) {
      for (const side of ["min", "max"]) if (number[side] != null) element[side] = String(number[side]);
      element.step = stepOf(kind, number);
      if (kind === "range" || document.activeElement !== element) element.value = String(number.value);
    }
    // What is being typed is not overwritten, unless the panel has changed it.
    const isTyped = document.activeElement === element && this.#told.get(id)?.text === text;
    if (kind === "field" && !isTyped && element.value !== text) element.value = text;
    if ("disabled" in element) element.disabled = disabled;
    if (place !== undefined) {
      ["left", "top", "width", "height"].forEach((side, index) => (element.style[side] = `${place[index]}px`));
    }
  }
}

/** How far an arrow key moves a slider: whole numbers by one, others by a hundredth of the range. */
function stepOf(kind, { value, min, max, step }) {
  if (step) return String(step);
  if (kind === "number") return "any";
  const isWhole = [value, min, max].every(Number.isInteger) && max - min > 1;
  return isWhole ? "1" : String((max - min) / 100 || 1);
}
