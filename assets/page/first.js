// The first steps of the first story, for as long as the engine is on its way: they were computed when the folder was written.
// The engine makes the same steps again, and goes on from there.

import { at } from "./folder.js";
import { content } from "./packed.js";

/** What names a session's run. */
const named = ({ scenario, set, seed, learners, ellipsoids, enlarge }) =>
  JSON.stringify([scenario, set, seed, learners, ellipsoids, enlarge]);
/** Postures on the way to each step in the recording. */
const FRAMES = 12;

export class First {
  #kept = Promise.resolve(null);
  #id = null;
  /** The steps that were given, and the follower who has them. */
  #given = 0;
  #follower = null;
  /** The engine's session, once it is to go on. */
  #real = null;
  /** Whether the engine is there. */
  #isThere = false;
  #ask;
  #went;
  /** That session, whenever it comes. @type {Promise<string>} */
  goesOn = new Promise((resolve) => (this.#went = resolve));

  /** @param {(method: string, path: string, body: object) => Promise<any>} ask the engine */
  constructor(ask) {
    this.#ask = ask;
  }

  /** Reads them. A folder that has none does without. @param {string} path */
  load(path) {
    this.#kept = (async () => JSON.parse(await new Response(await content(await fetch(at(path)))).text()))().catch(() => null);
  }

  /** An answer from them; undefined where the engine has to answer. */
  async answer(method, path, body) {
    const kept = await this.#kept;
    if (kept === null || this.#isThere || this.#real !== null) return undefined;
    const asked = `${method} ${path}`;
    if (asked === "GET /v1/scenarios") return kept.scenarios;
    if (asked === "POST /v1/sessions" && this.#id === null && named(body) === named(kept.opening)) {
      this.#id = kept.session.id;
      return kept.session;
    }
    if (this.#id === null || asked !== `POST /v1/sessions/${this.#id}/steps`) return undefined;
    const last = this.#given + body.count;
    if (body.expected_step !== this.#given || last >= kept.messages.length) return undefined;
    const messages = kept.messages.slice(this.#given + 1, last + 1);
    this.#given = last;
    this.#follower?.(messages);
    return { step: last };
  }

  /** Whether this is the session that was begun from them. @param {string} id */
  is(id) {
    return id === this.#id;
  }

  /** The engine is there: what was begun goes on with it. */
  arrived() {
    if (this.#id !== null) this.goOn();
    this.#isThere = true;
  }

  /** Tells a follower of the steps so far, and then of each. @param {(messages: string[]) => void} tell */
  async follow(tell) {
    const { messages } = await this.#kept;
    this.#follower = tell;
    tell(messages.slice(0, this.#given + 1));
  }

  /** How many messages a follower has had. */
  get told() {
    return this.#given + 1;
  }

  /** The engine's session that goes on from here: from now on nothing is answered any more. @returns {Promise<string>} its id */
  goOn() {
    if (this.#real === null) this.#went((this.#real = this.#begun()));
    // Whoever asks for it hears of a failure.
    this.#real.catch(() => {});
    return this.#real;
  }

  async #begun() {
    const { opening } = await this.#kept;
    const [count, { id }] = [this.#given, await this.#ask("POST", "/v1/sessions", opening)];
    const body = { count, expected_step: 0, frames: FRAMES, reports: false };
    if (count > 0) await this.#ask("POST", `/v1/sessions/${id}/steps`, body);
    return id;
  }

  /** A path as the engine knows it. @param {string} path */
  async path(path) {
    return this.#id !== null && path.includes(this.#id) ? path.replace(this.#id, await this.goOn()) : path;
  }
}
