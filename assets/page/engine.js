// Runs that are computed in the visitor's own browser: the same as session.js, by a worker in place of a server.

import { at, manifest } from "./folder.js";
import { First } from "./first.js";
import { isFresh } from "./links.js";
import { newest } from "./offline.js";
import { ProblemError } from "./session.js";
import { address, engineWorker } from "./capable.js";

export { wasm } from "./folder.js";
export { keep } from "./offline.js";

await newest();

/** There is no server. */
export const server = false;

/** What is to be used where the page cannot be shown. */
export const instead = "the program `body-schema` does without.";

/** Whoever follows a session, by a number that the worker knows it by. */
const followers = new Map();
let numbered = 0;

/** Requests that are not answered yet, by their numbers. */
const asked = new Map();

const worker = begun();

/** What there is before the engine. */
const first = new First(asEngine);
/** Whether the engine is on its way, and a promise that it is no more. */
let isComing = true;
const came = worker.then(() => first.arrived(), () => {}).then(() => (isComing = false));

/** The worker, once it has the engine. @returns {Promise<Worker>} */
async function begun() {
  const worker = engineWorker(address("engine-worker"));
  const { unpacked, scenarios, sessions } = await manifest;
  const addressOf = (path) => at(path).href;
  const added = scenarios.map(({ file, source, data }) => {
    const texts = Object.entries(data).map(([name, path]) => [name, addressOf(path)]);
    return { file, source: addressOf(source), data: Object.fromEntries(texts) };
  });
  const told = sessions.map(({ id, events }) => ({ id, events: addressOf(events) }));
  const wasm = address("engine-wasm");
  const bytes = unpacked[new URL(wasm).pathname.split("/").slice(-2).join("/")];
  await new Promise((resolve, reject) => {
    worker.onerror = (event) => reject(new Error(event.message || "its worker does not start"));
    worker.onmessage = ({ data }) => (data.failure === undefined ? resolve() : reject(new Error(data.failure)));
    worker.postMessage({ is: "begin", script: address("engine-script"), wasm, bytes, shapes: address("engine-meshes"), scenarios: added, sessions: told });
  });
  worker.onerror = (event) => failed(event.message);
  worker.onmessage = ({ data }) => receive(data);
  return worker;
}

// Who asks for it first hears of a failure.
worker.catch(() => {});

function receive({ number, status, body, follower, parts, messages }) {
  if (follower !== undefined) return followers.get(follower)?.receive(parts, messages);
  const answer = asked.get(number);
  asked.delete(number);
  answer?.resolve({ status, body });
}

/** The engine has crashed: nothing is answered any more. */
function failed(message) {
  const problem = { status: 500, title: "The engine has failed", detail: `the engine has crashed: ${message}; reload the page` };
  for (const { reject } of asked.values()) reject(new ProblemError(problem));
  asked.clear();
  for (const follower of followers.values()) follower.fail(problem.detail);
}

/** The worker with its engine. @returns {Promise<Worker>} throws a ProblemError */
function started() {
  return worker.catch((error) => {
    const detail = `the engine cannot be started: ${error.message}`;
    throw new ProblemError({ status: 500, title: "The engine has failed", detail });
  });
}

/** An answer's bytes. @returns {Promise<{status: number, body: ArrayBuffer}>} */
async function answered(method, path, body) {
  const there = await started();
  const number = ++numbered;
  const answer = new Promise((resolve, reject) => asked.set(number, { resolve, reject }));
  there.postMessage({ is: "ask", number, method, path, body });
  const { status, body: bytes } = await answer;
  if (status < 400) return { status, body: bytes };
  throw new ProblemError(JSON.parse(new TextDecoder().decode(bytes)));
}

/**
 * The query to begin with: where the page's own asks for no run, that with which the folder opens.
 * @param {string} search
 * @param {boolean} known whether the visitor has been here before, and sees something else than the first story
 */
export async function begin(search, known) {
  const query = new URLSearchParams(search);
  const { opens, sessions, first: begins = null } = await manifest.catch(() => ({ opens: "", sessions: [] }));
  // Those of a visitor's own are of one visit alone.
  if (!sessions.some(({ id }) => id === query.get("session"))) query.delete("session");
  if (!query.has("scenario") && !query.has("session")) {
    for (const [name, value] of new URLSearchParams(opens)) if (!query.has(name)) query.set(name, value);
    if (begins !== null && isFresh(query) && !known) first.load(begins);
  }
  return query.size > 0 ? `?${query}` : "";
}

/** Until the engine has what the page shows, or is not to be had: rejected then. */
export async function ready() {
  await started();
  await first.whole();
}

/** The engine as it comes, or null once it is there or is not to be had. @returns {Promise<unknown> | null} */
export const coming = () => (isComing ? came : null);

/** An arrangement of the viewer for a session. @param {string} id @param {{theme: string, aspect: number, alone: string | null}} view */
export async function arrangement(id, { theme, aspect, alone }) {
  const within = Math.min(Math.max(aspect, 0.2), 5).toFixed(3);
  const only = alone === null ? "" : `&learner=${encodeURIComponent(alone)}`;
  const path = await first.path(`/v1/sessions/${id}/blueprint.rbl?theme=${theme}&aspect=${within}${only}`);
  return (await answered("GET", path)).body;
}

/** A file of a session. @param {string} path @returns {Promise<Blob>} */
export async function file(path) {
  return new Blob([(await answered("GET", await first.path(path))).body], { type: "application/octet-stream" });
}

/** The id that a recording has in its parts. @param {string} id */
export const recordingOf = (id) => first.real(id);

/**
 * Asks the engine as one asks a server.
 * @param {string} method
 * @param {string} path
 * @param {object} [body]
 * @returns {Promise<any>} throws a ProblemError
 */
export async function ask(method, path, body) {
  const kept = await first.answer(method, path, body);
  return kept === undefined ? asEngine(method, await first.path(path), body) : kept;
}

/** Asks the engine itself. */
async function asEngine(method, path, body) {
  const answer = await answered(method, path, body === undefined ? "" : JSON.stringify(body));
  return answer.status === 204 ? null : JSON.parse(new TextDecoder().decode(answer.body));
}

/** Follows a session. Nothing is lost on the way. */
export class Follower {
  #number = ++numbered;
  #on;
  /** How many of the next messages are known already. */
  #had = 0;

  /** @param {string} id @param {object} on as in session.js */
  constructor(id, on) {
    this.#on = on;
    followers.set(this.#number, this);
    if (first.is(id)) {
      this.#begin();
      return;
    }
    worker.then((worker) => {
      if (!followers.has(this.#number)) return;
      on.connected();
      worker.postMessage({ is: "follow", follower: this.#number, session: id });
    });
  }

  /** Follows the steps that were there before the engine, and then the engine's. */
  async #begin() {
    this.#on.connected();
    await first.follow((messages) => followers.has(this.#number) && this.receive([], messages));
    try {
      const session = await first.goesOn;
      this.#had = first.told;
      if (followers.has(this.#number)) (await worker).postMessage({ is: "follow", follower: this.#number, session });
    } catch (error) {
      if (followers.has(this.#number)) this.fail(error.message);
    }
  }

  stop() {
    followers.delete(this.#number);
    worker.then((worker) => worker.postMessage({ is: "leave", follower: this.#number })).catch(() => {});
  }

  /** Parts of the recording, then the reports of their steps. */
  receive(parts, messages) {
    for (const part of parts) this.#on.part(part);
    const had = Math.min(this.#had, messages.length);
    this.#had -= had;
    for (const message of messages.slice(had)) this.#on.message(message);
  }

  fail(why) {
    this.stop();
    this.#on.ended(why, false);
  }
}
