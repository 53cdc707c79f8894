// The first steps of the first story, for as long as the engine is on its way: they were computed when the folder was written.
// The engine makes the same steps again, and goes on from there.

import { at } from "./folder.js";
import { content } from "./packed.js";

/** What names a session's run. */
const named = ({ scenario, set, seed, learners, ellipsoids, enlarge }) =>
  JSON.stringify([scenario, set, seed, learners, ellipsoids, enlarge]);
/** Postures on the way to each step in the recording. */
const FRAMES = 12;

/** Reads the file; null where it is missing or says nothing. @param {string} path @returns {Promise<object | null>} */
async function read(path) {
  try {
    const response = await fetch(at(path));
    return response.ok ? JSON.parse(await new Response(await content(response)).text()) : null;
  } catch {
    return null;
  }
}

export class First {
  #kept = Promise.resolve(null);
  /** The session that was begun from them. */
  #id = null;
  /** The steps that were given, and the follower who has them. */
  #given = 0;
  #follower = null;
  /** Whether the engine is there. */
  #isThere = false;
  /** The engine's session, once somebody needs it; and once it has made all steps that were given, its id. */
  #begun = null;
  #real = null;
  #ask;
  #arrived;
  #went;
  /** Whenever the engine comes. */
  #arrival = new Promise((resolve) => (this.#arrived = resolve));
  /** That session, whenever it comes: rejected where the engine cannot begin it. @type {Promise<string>} */
  goesOn = new Promise((resolve) => (this.#went = resolve));

  /** @param {(method: string, path: string, body: object) => Promise<any>} ask the engine */
  constructor(ask) {
    this.#ask = ask;
    // Whoever asks for it hears of a failure.
    this.goesOn.catch(() => {});
  }

  /** Reads them. A folder that has none does without, and so does an engine that is there before them. @param {string} path */
  load(path) {
    this.#kept = Promise.race([read(path), this.#arrival]);
  }

  /** An answer from them; undefined where the engine has to answer. */
  async answer(method, path, body) {
    const kept = await this.#kept;
    if (kept === null || this.#real !== null) return undefined;
    const asked = `${method} ${path}`;
    if (!this.#isThere && asked === "GET /v1/scenarios") return kept.scenarios;
    if (!this.#isThere && this.#id === null && asked === "POST /v1/sessions" && named(body) === named(kept.opening)) {
      this.#id = kept.session.id;
      return kept.session;
    }
    if (this.#id === null || asked !== `POST /v1/sessions/${this.#id}/steps`) return undefined;
    // As many as there are: whoever wants more asks again.
    const last = Math.min(this.#given + body.count, kept.messages.length - 1);
    if (body.expected_step !== this.#given || last === this.#given) return undefined;
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
    this.#isThere = true;
    this.#arrived(null);
    if (this.#id !== null) this.#goOn();
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

  /** The engine's session that goes on from here. @returns {Promise<string>} its id */
  #goOn() {
    if (this.#begun === null) this.#went((this.#begun = this.#begin()));
    return this.#begun;
  }

  /** Has the engine make what was given. Until it has, more may be given: the page does not stand still for it. */
  async #begin() {
    const { opening } = await this.#kept;
    const { id } = await this.#ask("POST", "/v1/sessions", opening);
    for (let made = 0; made < this.#given; ) {
      const count = this.#given - made;
      await this.#ask("POST", `/v1/sessions/${id}/steps`, { count, expected_step: made, frames: FRAMES, reports: false });
      made += count;
    }
    // From now on nothing is answered from the file any more.
    return (this.#real = id);
  }

  /** The id by which the engine knows a session or its recording, as far as it has it. @param {string} id */
  real(id) {
    return this.is(id) && this.#real !== null ? this.#real : id;
  }

  /** Until the engine has the session that was begun from them, if one was. */
  async whole() {
    if (this.#id !== null) await this.#goOn();
  }

  /** A path as the engine knows it. @param {string} path */
  async path(path) {
    return this.#id !== null && path.includes(this.#id) ? path.replace(this.#id, await this.#goOn()) : path;
  }
}
