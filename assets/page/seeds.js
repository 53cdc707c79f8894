// Other seeds of the same comparison, run in the background, one after the other.

/** Steps of one request: few, so that cancelling is quick and the session that is watched does not wait. */
const AT_ONCE = 25;

export class SeedRuns {
  #tell;
  #ask;
  /** Counts jobs: one that is not the latest ends. */
  #job = 0;
  /** Seeds of which enough is known. */
  #enough = new Set();

  /**
   * @param {(event: object) => void} tell
   * @param {(method: string, path: string, body?: object) => Promise<any>} ask as in session.js
   */
  constructor(tell, ask) {
    this.#tell = tell;
    this.#ask = ask;
  }

  /** Ends the run of one seed; the others go on. @param {number} seed */
  enough(seed) {
    this.#enough.add(seed);
  }

  cancel() {
    this.#job += 1;
  }

  /** @param {{scenario: string, set: string[], learners: string[], seeds: number[], steps: number}} job */
  async run({ scenario, set, learners, seeds, steps }) {
    const job = ++this.#job;
    const ask = this.#ask;
    this.#enough.clear();
    for (const seed of seeds) {
      let id = null;
      try {
        id = (await ask("POST", "/v1/sessions", { scenario, set, seed, learners })).id;
        for (let made = 0; made < steps && job === this.#job && !this.#enough.has(seed); ) {
          const answer = await ask("POST", `/v1/sessions/${id}/steps`, { count: Math.min(AT_ONCE, steps - made) });
          made = answer.step;
          if (job === this.#job) this.#tell({ is: "seeds", seed, reports: answer.reports, done: made >= steps });
        }
      } catch (error) {
        if (job === this.#job) this.#tell({ is: "refused", asked: "seeds", problem: error.problem ?? {} });
        this.#job += job === this.#job ? 1 : 0;
      } finally {
        if (id !== null) ask("DELETE", `/v1/sessions/${id}`).catch(() => {});
      }
      if (job !== this.#job) return;
    }
  }
}
