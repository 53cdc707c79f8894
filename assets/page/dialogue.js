// A robot that somebody moves by hand: it is asked where to go, and told what was seen there.

import { Refused } from "./bench.js";
import { copied } from "./links.js";
import { saveBlob } from "./save.js";
import { forget, keep, kept } from "./storage.js";
import { cells } from "./table.js";

/** Where the browser keeps the session. */
const KEPT = "body-schema.session";

const at = (id) => document.getElementById(id);
const DEGREES = 180 / Math.PI;

/** What is measured by a channel of each kind: the names of its numbers, and how they are told. */
const SHAPES = {
  position: () => ({ names: ["x (m)", "y (m)", "z (m)"], told: (numbers) => numbers }),
  pose: () => ({
    names: ["x (m)", "y (m)", "z (m)", "qx", "qy", "qz", "qw"],
    told: (numbers) => ({ position: numbers.slice(0, 3), quaternion: numbers.slice(3) }),
  }),
  pixels: ({ points }) => ({
    names: Array.from({ length: points }, (_, point) => [`u${point + 1} (px)`, `v${point + 1} (px)`]).flat(),
    told: (numbers) => Array.from({ length: points }, (_, point) => numbers.slice(2 * point, 2 * point + 2)),
  }),
  distance: () => ({ names: ["distance (m)"], told: ([number]) => number }),
};

export class Dialogue {
  #on;
  /** The answer to the last request: the session and where it stands. */
  #now = null;

  /** @param {{ask: Function, attempt: Function, show: (scene: {id: string, bytes: Uint8Array}) => void, results: Function}} on */
  constructor(on) {
    this.#on = on;
    at("copies").onclick = ({ target }) => target.dataset.form && this.#copy(target.dataset.form);
    at("seen").onsubmit = (event) => {
      event.preventDefault();
      this.#try(() => this.#tell(this.#read()));
    };
    at("nothing").onclick = () => this.#try(() => this.#tell({}));
    at("infeasible").onclick = () => this.#try(() => this.#outcome("infeasible"));
    at("skip").onclick = () => this.#try(() => this.#outcome("abandoned"));
    at("keep").onclick = () => saveBlob(new Blob([this.#now.session]), "session.json");
    at("forget").onclick = () => this.#forget();
    at("finish").onclick = () => this.#try(async () => {
      const { answer } = await this.#on.ask({}, { results: { session: this.#now.session } });
      await this.#on.results(answer);
    });
  }

  /** Begins with the robot of a calibration file. */
  async open(files, text) {
    await this.#change(files, { open: { text } });
    at("measure").scrollIntoView({ behavior: "smooth" });
  }

  /** Goes on with a session that was saved, here, by Python, or by a server. @param {string} session */
  async resume(session) {
    const { answer, scene } = await this.#on.ask({}, { suggest: { session } });
    this.#keep(answer);
    this.#show();
    this.#on.show(scene);
  }

  /** Goes on with the session that the browser has kept, if there is one. */
  async remember() {
    const session = kept(KEPT, "localStorage");
    if (session !== null) await this.#on.attempt("problem", () => this.resume(session));
  }

  #forget() {
    forget(KEPT, "localStorage");
    this.#now = null;
    at("measure").hidden = true;
  }

  async #try(work) {
    const buttons = [...at("measure").querySelectorAll("button:enabled")];
    for (const button of buttons) button.disabled = true;
    await this.#on.attempt("refused", work);
    for (const button of buttons) button.disabled = false;
    at("finish").disabled = !this.#now?.observations.length;
  }

  /** Has something happen, and asks for the movement after it. */
  async #change(files, ask) {
    const { answer } = await this.#on.ask(files, ask);
    this.#keep(answer);
    try {
      await this.resume(answer.session);
    } catch (error) {
      // It has happened, whatever becomes of the next movement.
      this.#show();
      throw error;
    }
  }

  #keep(answer) {
    this.#now = answer;
    at("unkept").hidden = keep(KEPT, answer.session, "localStorage");
  }

  /** Refuses to write over what another tab has been told since. */
  #alone() {
    const there = kept(KEPT, "localStorage");
    if (at("unkept").hidden && there !== null && there !== this.#now.session) {
      throw new Refused("this session went on in another tab; reload this page to go on from there");
    }
  }

  async #tell(measurements) {
    this.#alone();
    const [next] = this.#now.pending;
    const inputs = [...at("true-posture").querySelectorAll("input")];
    const positions = numbers(inputs, "where the robot is");
    const configuration = Object.fromEntries(inputs.map(({ name }, index) => [name, positions[index]]));
    const observation = { suggestion_id: next?.id ?? null, configuration, measurements };
    await this.#change({}, { observe: { session: this.#now.session, observation } });
  }

  async #outcome(state) {
    this.#alone();
    const [{ id }] = this.#now.pending;
    await this.#change({}, { outcome: { session: this.#now.session, id, state, reason: null } });
  }

  /** What was seen, as the form has it. */
  #read() {
    const boxes = [...at("readings").querySelectorAll("fieldset")];
    const line = at("seen").elements.line.value.trim();
    const inputs = boxes.map((box) => [...box.querySelectorAll("input, select")]);
    if (line !== "") this.#paste(line, inputs.flat());
    const told = {};
    for (const [index, channel] of this.#now.channels.entries()) {
      const own = inputs[index];
      if (own.every(({ value }) => value.trim() === "")) continue;
      const isSocket = channel.channel === "sockets";
      told[channel.name] = isSocket ? own[0].value : SHAPES[channel.channel](channel).told(numbers(own, channel.name));
    }
    if (Object.keys(told).length === 0) throw new Refused("nothing is written; write what was seen, or say that nothing was");
    return told;
  }

  /** Puts the numbers of a line into the form: what was measured, or the joints and then what was measured. */
  #paste(line, readings) {
    const numbers = line.replace(/[[\](){}]/g, " ").split(/[\s,;]+/).filter((word) => word !== "");
    const joints = [...at("true-posture").querySelectorAll("input")];
    const inputs = numbers.length === readings.length ? readings : [...joints, ...readings];
    if (numbers.length !== inputs.length) {
      const both = `${readings.length} as measured, or ${joints.length + readings.length} with the joints before them`;
      throw new Refused(`the line has ${numbers.length} numbers; there should be ${both}`);
    }
    inputs.forEach((input, index) => (input.value = numbers[index]));
  }

  async #copy(form) {
    const [{ joints, configuration }] = this.#now.pending;
    const position = joints.map((name) => configuration[name]);
    const text = {
      json: JSON.stringify(configuration),
      python: `[${position.join(", ")}]`,
      ros: JSON.stringify({ name: joints, position }),
    }[form];
    const { done } = await copied(text);
    at("copies").querySelector("output").textContent = done ? "copied" : text;
  }

  #show() {
    const { status, pending, channels, observations } = this.#now;
    const [next] = pending;
    at("stand").textContent = said(status);
    at("next").hidden = next === undefined;
    at("finish").disabled = observations.length === 0;
    if (next !== undefined) {
      const lines = next.joints.map((name) => {
        const position = next.configuration[name];
        const slides = this.#now.sliding.includes(name);
        return [name, `${position.toFixed(4)} ${slides ? "m" : "rad"}`, slides ? `${(position * 1e3).toFixed(1)} mm` : `${(position * DEGREES).toFixed(2)}°`];
      });
      at("posture").replaceChildren(cells([["joint", "position", ""], ...lines]));
      at("true-posture").replaceChildren(...next.joints.map((name) => input(name, name, next.configuration[name])));
      at("readings").replaceChildren(...channels.map(reading));
      at("seen").elements.line.value = "";
      at("copies").querySelector("output").textContent = "";
    }
    this.#list(observations, status);
  }

  #list(observations, { outliers }) {
    const lines = observations.map(({ answer }) => [
      answer.observation,
      answer.seen ? (answer.innovation_sigmas?.toFixed(2) ?? "–") : "nothing seen",
      answer.expected_error_mm?.toFixed(2) ?? "–",
    ]);
    const table = cells([["observation", "off what was expected (σ)", "expected error then (mm)", "counts"], ...lines]);
    for (const [index, { excluded }] of observations.entries()) {
      const row = table.querySelector("tbody").rows[index];
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: !excluded });
      box.setAttribute("aria-label", `observation ${index + 1} counts`);
      box.onchange = () => this.#try(async () => {
        this.#alone();
        await this.#change({}, { count: { session: this.#now.session, observation: index + 1, counts: box.checked } });
      });
      row.insertCell().append(box);
      if (outliers.includes(index + 1)) row.cells[1].className = "doubted";
    }
    at("told").replaceChildren(...(observations.length > 0 ? [table] : []));
  }
}

/** The numbers of some inputs, which are all that is asked for. @param {string} what they are about */
function numbers(inputs, what) {
  return inputs.map(({ name, value }) => {
    const number = Number(value);
    if (value.trim() !== "" && Number.isFinite(number)) return number;
    throw new Refused(`${what}: ${name} is no number; write all, or none where nothing was seen`);
  });
}

/** Where a session stands, in words. */
function said({ observations, expected_error_mm, wanted_mm, enough, movements_left, failure }) {
  if (failure !== null) return `Nothing more is learned: ${failure}.`;
  const count = `${observations} observation${observations === 1 ? "" : "s"}`;
  if (expected_error_mm === null) return `${count}.`;
  const error = `${count}; the hand is expected to be predicted to ${expected_error_mm.toFixed(2)} mm, ${wanted_mm} mm are wanted`;
  if (enough) return `${error}. That is enough: calibrate, or go on.`;
  return movements_left === null ? `${error}.` : `${error}: about ${movements_left} more.`;
}

/** The inputs of a channel. */
function reading(channel) {
  const box = document.createElement("fieldset");
  const legend = Object.assign(document.createElement("legend"), { textContent: channel.name });
  box.append(legend);
  if (channel.channel === "sockets") {
    const select = Object.assign(document.createElement("select"), { name: channel.name });
    select.append(new Option("none", ""), ...channel.sockets.map((name) => new Option(name)));
    box.append(select);
  } else box.append(...SHAPES[channel.channel](channel).names.map((name) => input(name, name, "")));
  return box;
}

function input(name, words, value) {
  const label = Object.assign(document.createElement("label"), { textContent: words });
  label.append(Object.assign(document.createElement("input"), { name, value, inputMode: "decimal", autocomplete: "off" }));
  return label;
}
