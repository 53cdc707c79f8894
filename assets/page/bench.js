// The engine at work on a robot of the visitor's own, in a worker of its own.

import { address, engineWorker } from "./capable.js";
import { meshes, unpacked } from "./packed.js";

/** An error that says what the visitor can do about it. */
export class Refused extends Error {}

/** The work was given up. */
export class Stopped extends Error {}

/** The engine's WebAssembly, compiled once for all workers. */
let compiled = null;
/** The meshes of robots that ship. @type {Promise<Uint8Array> | null} */
let shipped = null;

/** Asks the engine, one question after the other. */
export class Bench {
  #worker = null;
  #asked = 0;
  #last = Promise.resolve();
  /** Ends the question that is being answered. */
  #giveUp = () => {};

  /**
   * The answer to a question, as `work` of the backend describes them.
   * @param {Record<string, string>} files
   * @param {object} ask
   * @param {(progress: {what: string, steps: number, made: number}) => void} [progress]
   * @param {Record<string, Uint8Array>} [meshes] by their paths, to draw the robot with
   * @returns {Promise<{answer: any, scene?: {id: string, bytes: Uint8Array}}>} throws Refused or Stopped
   */
  ask(files, ask, progress = () => {}, meshes = {}) {
    const answer = this.#last.then(() => this.#answer(files, ask, progress, meshes));
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
    const worker = (this.#worker = engineWorker(address("bench-worker")));
    try {
      shipped ??= meshes(address("engine-meshes"));
      compiled ??= WebAssembly.compileStreaming(unpacked(address("engine-wasm")));
      const module = await compiled.catch((error) => {
        // Whoever asks again has it fetched again.
        compiled = null;
        throw error;
      });
      const shapes = await shipped;
      await new Promise((resolve, reject) => {
        this.#giveUp = reject;
        worker.onerror = (event) => reject(new Error(event.message || "the engine's worker does not start"));
        worker.onmessage = ({ data }) => (data.ready ? resolve() : reject(new Error(data.failure)));
        worker.postMessage({ begin: { script: address("engine-script"), module, shapes } });
      });
      return worker;
    } catch (error) {
      worker.terminate();
      this.#worker = null;
      throw error;
    }
  }

  async #answer(files, ask, progress, meshes) {
    const worker = await this.#begun();
    const number = ++this.#asked;
    // The viewer takes recordings with one id for one.
    const id = `recording-${number}`;
    const request = JSON.stringify({ files, ask, recording: id });
    const { status, body, recording, failure } = await new Promise((resolve, reject) => {
      this.#giveUp = reject;
      worker.onerror = (event) => resolve({ failure: event.message });
      worker.onmessage = ({ data }) => {
        if (data.progress) progress(data.progress);
        else if (data.number === number) resolve(data);
      };
      worker.postMessage({ number, request, meshes });
    });
    if (failure !== undefined) {
      // What is left of it cannot be relied on.
      this.stop();
      throw new Refused(`the engine has crashed: ${failure}. Your files are as they were; change them, or try again`);
    }
    const answer = JSON.parse(new TextDecoder().decode(body));
    if (status !== 200) throw new Refused(answer.detail);
    return { answer, scene: recording && { id, bytes: recording } };
  }
}
