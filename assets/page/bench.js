// The engine at work on a robot of the visitor's own, in a worker of its own.

import { engineWorker } from "./capable.js";
import { content } from "./packed.js";

const address = (id) => new URL(document.getElementById(id).dataset.address, document.baseURI).href;

/** An error that says what the visitor can do about it. */
export class Refused extends Error {
  /** @param {{detail: string, field?: string}} problem */
  constructor(problem) {
    super(problem.detail);
    this.field = problem.field;
  }
}

/** The work was given up. */
export class Stopped extends Error {}

/** The engine's WebAssembly, compiled once for all workers. */
let compiled = null;

async function wasm() {
  const response = await fetch(address("engine-wasm"));
  if (!response.ok) throw new Error(`the engine cannot be read (${response.status})`);
  const headers = { "Content-Type": "application/wasm" };
  return WebAssembly.compileStreaming(new Response(await content(response), { headers }));
}

/** Asks the engine, one question after the other. */
export class Bench {
  #worker = null;
  #asked = 0;
  #last = Promise.resolve();
  /** Ends the question that is being answered. */
  #giveUp = () => {};

  /** Loads the engine. @returns {Promise<void>} */
  async load() {
    await this.#begun();
  }

  /**
   * The answer to a question, as `work` of the backend describes them.
   * @param {Record<string, string>} files
   * @param {object} ask
   * @param {(progress: {what: string, steps: number, made: number}) => void} [progress]
   * @returns {Promise<{answer: any, recording?: Uint8Array}>} throws Refused or Stopped
   */
  ask(files, ask, progress = () => {}) {
    const answer = this.#last.then(() => this.#answer(JSON.stringify({ files, ask }), progress));
    this.#last = answer.catch(() => {});
    return answer;
  }

  /** Gives up what is being computed, at once. */
  stop() {
    this.#worker?.terminate();
    this.#worker = null;
    this.#giveUp(new Stopped("stopped"));
  }

  async #begun() {
    if (this.#worker !== null) return this.#worker;
    const worker = engineWorker(address("bench-worker"));
    compiled ??= wasm();
    const module = await compiled;
    await new Promise((resolve, reject) => {
      worker.onerror = (event) => reject(new Error(event.message || "the engine's worker does not start"));
      worker.onmessage = ({ data }) => (data.ready ? resolve() : reject(new Error(data.failure)));
      worker.postMessage({ begin: { script: address("engine-script"), module } });
    });
    this.#worker = worker;
    return worker;
  }

  async #answer(request, progress) {
    const worker = await this.#begun();
    const number = ++this.#asked;
    const { status, body, recording, failure } = await new Promise((resolve, reject) => {
      this.#giveUp = reject;
      worker.onerror = (event) => resolve({ failure: event.message });
      worker.onmessage = ({ data }) => {
        if (data.progress) progress(data.progress);
        else if (data.number === number) resolve(data);
      };
      worker.postMessage({ number, request });
    });
    if (failure !== undefined) {
      // What is left of it cannot be relied on.
      this.stop();
      throw new Refused({ detail: `the engine has crashed: ${failure}. Your files are as they were; change them, or try again` });
    }
    const answer = JSON.parse(new TextDecoder().decode(body));
    if (status !== 200) throw new Refused(answer);
    return { answer, recording };
  }
}
