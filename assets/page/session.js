// The server's API, and the one WebSocket that a page holds.

/** How long to wait before each attempt to reconnect, ms; the last holds for all further ones. */
const BACK_OFF_MS = [500, 1000, 2000, 4000, 8000];
/** How reports begin, and what says which part of the recording is next. */
const STEP = /^\{"type":"step","data":\{"step":(\d+)/;
const PARTS = /^\{"type":"parts","data":\{"next":(\d+)\}\}$/;
/** The close codes that say that the session was deleted, and that its engine has failed. */
const [CLOSE_DELETED, CLOSE_FAILED] = [4404, 4500];

/** An error that the server explained (RFC 9457). */
export class ProblemError extends Error {
  /** @param {object} problem */
  constructor(problem) {
    super(problem.detail || problem.title);
    this.problem = problem;
    this.status = problem.status;
  }
}

/** There is a server. */
export const server = true;

/** What is to be used where the page cannot be shown. */
export const instead = "the HTTP interface at /v1/openapi.json and the command line do without.";

/** The query to begin with: the page's own. @param {string} search */
export const begin = async (search) => search;

/** The server is there. */
export const ready = async () => {};
export const coming = () => null;

/** The id that a recording has in its parts. @param {string} id */
export const recordingOf = (id) => id;

/** A file of WebAssembly. @param {string} address */
export const wasm = (address) => fetch(address);

/** An arrangement of the viewer for a session. @param {string} id @param {{theme: string, aspect: number, alone: string | null}} view */
export async function arrangement(id, { theme, aspect, alone }) {
  const query = new URLSearchParams({ theme, aspect: aspect.toFixed(3) });
  if (alone !== null) query.set("learner", alone);
  const response = await fetch(`/v1/sessions/${encodeURIComponent(id)}/blueprint.rbl?${query}`);
  if (!response.ok) throw new Error(`there is no arrangement (${response.status})`);
  return response.arrayBuffer();
}

/**
 * Asks the server.
 * @param {string} method
 * @param {string} path
 * @param {object} [body]
 * @returns {Promise<any>} throws a ProblemError, or a TypeError where there is no answer
 */
export async function ask(method, path, body) {
  const headers = body === undefined ? {} : { "Content-Type": "application/json" };
  const response = await fetch(path, { method, headers, body: body === undefined ? undefined : JSON.stringify(body) });
  if (response.ok) return response.status === 204 ? null : response.json();
  const problem = await response.json().catch(() => ({ title: response.statusText }));
  throw new ProblemError({ ...problem, status: response.status });
}

/**
 * A session's resource.
 * @param {string} id
 * @returns {Promise<object | null | undefined>} null if it is gone, undefined if there is no answer
 */
function sessionOf(id) {
  return ask("GET", `/v1/sessions/${encodeURIComponent(id)}`).catch((error) => (error.status === 404 ? null : undefined));
}

/**
 * Follows a session until told otherwise, over broken connections too.
 *
 * Nothing is received twice: after a break it goes on with the next part and the next step.
 */
export class Follower {
  #id;
  #on;
  #part = 0;
  #step = 0;
  #attempt = 0;
  #socket = null;
  #timer = 0;
  #stopped = false;
  #recording;

  /**
   * @param {string} id
   * @param {{message: Function, part: Function, connected: Function, lost: Function, ended: Function, begun: Function}} on
   *   lost(seconds) says when it is tried again, ended(failure, unseen) why there is nothing more, begun(resource) that all
   *   begins anew
   * @param {string | null} recording the id of its recording, if it may be recorded anew: while nobody is connected, or when
   *   what was told to it counts otherwise
   */
  constructor(id, on, recording) {
    this.#id = id;
    this.#on = on;
    this.#recording = recording;
    this.#connect();
  }

  stop() {
    this.#stopped = true;
    clearTimeout(this.#timer);
    this.#socket?.close();
  }

  #connect() {
    const address = new URL(`/v1/sessions/${this.#id}/live`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.search = new URLSearchParams({ from: String(this.#part), step: String(this.#step) }).toString();
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#attempt = 0;
      if (!this.#stopped) this.#on.connected();
    };
    socket.onmessage = (message) => this.#stopped || this.#receive(message.data);
    socket.onclose = (event) => this.#stopped || this.#closed(event.code);
    this.#socket = socket;
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      this.#part += 1;
      this.#on.part(data);
      return;
    }
    const parts = PARTS.exec(data);
    if (parts !== null) {
      this.#part = Number(parts[1]);
      return;
    }
    // Reports are long; that they begin with their step spares reading them twice.
    const step = STEP.exec(data);
    if (step !== null) this.#step = Number(step[1]) + 1;
    this.#on.message(data);
  }

  async #end() {
    const resource = await sessionOf(this.#id);
    if (!this.#stopped) this.#on.ended(resource?.failure ?? null, false);
  }

  async #closed(code) {
    const mayBeAnew = this.#recording !== null;
    // One that may be recorded anew may be there again, whatever ended its last life.
    if (!mayBeAnew && (code === CLOSE_DELETED || code === CLOSE_FAILED)) return this.#end();
    // A refused connection does not say why: a session that is gone is asked for in vain.
    const resource = await sessionOf(this.#id);
    if (this.#stopped) return;
    if (resource === null) return this.#on.ended(null, true);
    if (mayBeAnew && resource !== undefined && resource.recording !== this.#recording) return this.#on.begun(resource);
    const wait = BACK_OFF_MS[Math.min(this.#attempt++, BACK_OFF_MS.length - 1)];
    this.#on.lost(wait / 1000);
    // Of another recording, the part that comes next is not the next.
    const isUnknown = mayBeAnew && resource === undefined;
    this.#timer = setTimeout(() => (isUnknown ? this.#closed(code) : this.#connect()), wait);
  }
}
