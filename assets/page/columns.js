// The columns of a table, and what the visitor says that they hold.

/** What of a marker a column may hold. */
const PARTS = ["x", "y", "z", "rx", "ry", "rz", "roll", "pitch", "yaw", "qx", "qy", "qz", "qw", "u", "v", "distance"];

const AS_TITLED = "what its title says";

/** A list of the columns, each with a choice. */
export class Columns {
  /** What columns hold where the visitor says it, by their titles: what a title would say, or null for one to pass over. */
  roles = {};
  #element;
  #changed;

  /** @param {HTMLDetailsElement} element @param {() => void} changed hears of every choice */
  constructor(element, changed) {
    this.#element = element;
    this.#changed = changed;
  }

  /** Lists the columns anew, none of which anything is said of. @param {{titles: string[] | null, joints: {name: string, mimics: string | null}[]}} table */
  list({ titles, joints }) {
    this.roles = {};
    const all = (titles ?? []).filter((title) => title !== "");
    this.#element.hidden = all.length < 2;
    const names = joints.filter(({ mimics }) => mimics === null).map(({ name }) => name);
    // A joint may be called x.
    const parts = PARTS.map((part) => [`marker ${part}`, names.includes(part) ? `marker_${part}` : part]);
    const pairs = (names) => names.map((name) => [name, name]);
    const groups = () => [group("a joint", pairs(names)), group("a marker", parts), group("a target in a socket", pairs(["place", "socket"]))];
    this.#element.querySelector("div").replaceChildren(...all.map((title) => this.#row(title, groups())));
  }

  #row(title, groups) {
    const select = document.createElement("select");
    select.append(new Option(AS_TITLED, ""), new Option("nothing", JSON.stringify(null)), ...groups);
    select.onchange = () => {
      if (select.value === "") delete this.roles[title];
      else this.roles[title] = JSON.parse(select.value);
      this.#changed();
    };
    const label = Object.assign(document.createElement("label"), { textContent: title });
    label.append(select);
    return label;
  }

  /** Tells what each column was taken for. @param {{role: string | null}[]} taken those with titles, in order */
  tell(taken) {
    for (const [index, select] of this.#element.querySelectorAll("select").entries()) {
      const is = select.value === "" ? `: ${taken[index].role ?? "nothing"}` : "";
      select.options[0].textContent = `${AS_TITLED}${is}`;
    }
  }

  open() {
    this.#element.open = true;
  }
}

/** A group of choices. @param {string} label @param {[string, string | null][]} pairs what is shown, and what it is */
function group(label, pairs) {
  const group = Object.assign(document.createElement("optgroup"), { label });
  group.append(...pairs.map(([shown, role]) => new Option(shown, JSON.stringify(role))));
  return group;
}
