// The page that holds this one in a frame: what it may ask, and what it is told. docs/hosting.md is its description.
//
// Whoever may show this page may drive it: commands move what is shown, and nothing else. What is told is what is shown.

/** What messages of either direction say they are, and the version of their form. */
const [TYPE, VERSION] = ["body-schema", 1];
const MOST_SEED = Number.MAX_SAFE_INTEGER;

export class Holder {
  /** The names of the scenarios. */
  scenarios = [];
  #tell;
  #parent = window.parent === window ? null : window.parent;
  /** What was told last. */
  #told = { phase: "loading" };
  #ready = false;

  /** @param {(event: object) => void} tell what tells the panel */
  constructor(tell) {
    this.#tell = tell;
    if (this.#parent !== null) addEventListener("message", (message) => this.#receive(message));
  }

  /** Tells what the panel says of itself, where that has changed. @param {object} state */
  hear({ phase, session, scenario, seed, step, latest, stopped, errors }) {
    if (this.#parent === null) return;
    const before = this.#told;
    if (phase === "loading") {
      this.#told = { ...before, phase };
      return;
    }
    const state = { phase, scenario, seed, step, latest, errors };
    this.#told = { ...state, session, stopped };
    if (!this.#ready) {
      if (session === "") return;
      this.#ready = true;
      this.#post({ event: "ready", scenarios: this.scenarios, ...state });
    } else if (step !== before.step || session !== before.session) {
      this.#post({ event: "step", ...state });
    }
    if (phase === "stopped" && stopped !== before.stopped) this.#post({ event: "end", why: stopped, ...state });
  }

  /** Tells that the page cannot be shown. @param {string} why */
  failed(why) {
    this.#told.phase = "failed";
    this.#post({ event: "failed", why });
  }

  #post(message) {
    this.#parent?.postMessage({ type: TYPE, version: VERSION, ...message }, "*");
  }

  #receive({ source, data }) {
    if (source !== this.#parent || data?.type !== TYPE) return;
    const { id, command } = data;
    const why = this.#refuses(data);
    if (why !== null) return this.#post({ event: "refused", id, command, why });
    if (command === "state") {
      const { session, stopped, ...state } = this.#told;
      return this.#post({ event: "state", id, ...state });
    }
    // Until the panel says otherwise.
    if (command === "scenario" || command === "seed") this.#told.phase = "loading";
    this.#tell(
      {
        play: { is: "play" },
        pause: { is: "pause" },
        step: { is: "forward" },
        scenario: { is: "choose", scenario: data.scenario, seed: data.seed ?? null },
        seed: { is: "choose", scenario: null, seed: data.seed },
      }[command],
    );
    this.#post({ event: "done", id, command });
  }

  /** Why a command cannot be carried out, or null. */
  #refuses({ command, version, scenario, seed }) {
    const known = ["play", "pause", "step", "scenario", "seed", "state"];
    if (version !== undefined && version !== VERSION) return `version ${version} is unknown here; this page knows ${VERSION}`;
    if (!known.includes(command)) return `there is no command “${command}”; there are ${known.join(", ")}`;
    if (command === "state") return null;
    if (!this.#ready) return "the page is not ready; wait for its event “ready”";
    if (["play", "step"].includes(command) && this.#told.phase === "loading") return "a run is being opened; wait for its event “step”";
    if (command === "scenario" && !this.scenarios.includes(scenario)) {
      return `there is no scenario “${scenario}”; there are ${this.scenarios.join(", ")}`;
    }
    const isSeed = Number.isInteger(seed) && seed >= 0 && seed <= MOST_SEED;
    const isWanted = command === "seed" || (command === "scenario" && seed !== undefined);
    return isWanted && !isSeed ? `“seed” must be a whole number from 0 to ${MOST_SEED}` : null;
  }
}
