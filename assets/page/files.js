// Recorded runs in files beside the page, offered as the server offers sessions: the same as session.js, without a server.

import { at, get, manifest } from "./folder.js";
import { content } from "./packed.js";
import { ProblemError } from "./session.js";
import { HEADER_BYTES } from "./viewer.js";

export { wasm } from "./folder.js";

/** Nothing is computed here. */
export const server = false;

/** The sessions of this page, by id: recorded runs of which more and more is shown. */
const sessions = new Map();
let opened = 0;

/** What is to be used where the page cannot be shown. */
export const instead = "the recordings in the folder runs open in Rerun's own viewer.";

const sorted = (names) => [...names].sort().join(", ");

const unpacked = async (path) => new Response(await content(await get(path)));

/**
 * The query to begin with: the page's own, or where that asks for what is not recorded, the nearest run that is.
 * @param {string} search
 * @returns {Promise<{query: string, seeds: number[], note?: string}>} with the seeds of all that is recorded
 */
export async function begin(search) {
  const asked = new URLSearchParams(search);
  const { scenarios } = await manifest.catch(() => ({ scenarios: [] }));
  const scenario = scenarios.find(({ name }) => name === asked.get("scenario")) ?? scenarios[0];
  if (scenario === undefined) return { query: search, seeds: [] };
  const seeds = scenario.runs.map(({ seed }) => seed);
  const run = scenario.runs.find(({ seed }) => String(seed) === asked.get("seed")) ?? scenario.runs[0];
  const isRecorded = {
    scenario: (name) => name === scenario.name,
    seed: (seed) => seed === String(run.seed),
    learners: (names) => sorted(names.split(",")) === sorted(run.learners),
    // Scenarios are recorded as they are.
    set: () => false,
  };
  const missing = Object.keys(isRecorded).filter((name) => asked.has(name) && !isRecorded[name](asked.get(name)));
  const inVain = missing.map((name) => `${name}=${asked.get(name)}`).join(", ");
  // Sessions are of one visit alone.
  for (const name of [...missing, "session"]) asked.delete(name);
  asked.set("scenario", scenario.name);
  asked.set("seed", run.seed);
  const note = missing.length > 0 ? `${inVain} is not recorded here; the page shows what is.` : undefined;
  return { query: `?${asked}`, seeds, note };
}

/** An arrangement of the viewer for a session. @param {string} id @param {{theme: string, aspect: number}} view */
export async function arrangement(id, { theme, aspect }) {
  const { folder: place, aspects } = known(id).run;
  const fitting = aspects.filter((one) => one <= aspect).at(-1) ?? aspects[0];
  return (await get(`${place}/blueprint-${theme}-${fitting}.rbl`)).arrayBuffer();
}

/** Where a file of a session is. @param {string} path as on a server */
export function place(path) {
  const [, , kind, id, file] = path.split("/");
  const session = kind === "sessions" ? sessions.get(id) : undefined;
  return session === undefined ? path : at(`${session.run.folder}/${file}`).href;
}

/**
 * Answers as the server would.
 * @param {string} method
 * @param {string} path
 * @param {object} [body]
 * @returns {Promise<any>} throws a ProblemError
 */
export async function ask(method, path, body) {
  const [, , kind, name, part, learner, what] = path.replace(/\?.*/, "").split("/").map(decodeURIComponent);
  const asked = [method, kind, name && "…", part, learner && "…", what].filter(Boolean).join(" ");
  switch (asked) {
    case "GET scenarios":
      return { scenarios: (await manifest).scenarios };
    case "GET scenarios …":
      return scenarioFile(name);
    case "POST sessions":
      return open(body);
    case "GET sessions …":
      return resource(known(name));
    case "DELETE sessions …":
      sessions.delete(name);
      return null;
    case "POST sessions … steps":
      return step(known(name), body ?? {});
    case "GET sessions … learners … selection":
      return selection(known(name), learner);
    default:
      throw problem(501, "This page has no server", "it shows recorded runs; start body-schema serve to compute new ones");
  }
}

function problem(status, title, detail, more = {}) {
  return new ProblemError({ status, title, detail, ...more });
}

function known(id) {
  const session = sessions.get(id);
  if (session === undefined) throw problem(404, "There is no such session", `there is no session ${id} in this page`);
  return session;
}

async function scenarioOf(name) {
  const { scenarios } = await manifest;
  const scenario = scenarios.find((scenario) => scenario.name === name);
  if (scenario !== undefined) return scenario;
  const names = scenarios.map(({ name }) => name).join(", ");
  throw problem(409, "Not recorded", `this page holds recorded runs of ${names}, not of ${name}`, { field: "scenario" });
}

async function scenarioFile(name) {
  const scenario = await scenarioOf(name);
  return { ...scenario, source: await (await get(scenario.source)).text() };
}

/** A recorded run, from its first step on. */
async function open({ scenario: name, seed, learners, set = [] }) {
  const scenario = await scenarioOf(name);
  if (set.length > 0) {
    const detail = `this page holds ${name} as it is, not with ${set.join(", ")}`;
    throw problem(409, "Not recorded", detail, { field: "set" });
  }
  const run = scenario.runs.find((run) => run.seed === seed);
  if (run === undefined) {
    const seeds = scenario.runs.map(({ seed }) => seed).join(", ");
    throw problem(409, "Not recorded", `this page holds ${name} with the seeds ${seeds}, not ${seed}`, { field: "seed" });
  }
  if (learners != null && sorted(learners) !== sorted(run.learners)) {
    const detail = `this page holds ${name} with the learners ${run.learners.join(", ")}, recorded together`;
    throw problem(409, "Not recorded", detail, { field: "learners" });
  }
  const [description, reports] = await Promise.all([
    get(`${run.folder}/description.json`).then((response) => response.json()),
    unpacked(`${run.folder}/reports.ndjson.gz`).then((response) => response.text()),
  ]);
  const session = {
    id: `${run.recording}-${++opened}`,
    run,
    description,
    reports: reports.trimEnd().split("\n"),
    step: 0,
    followers: new Set(),
  };
  sessions.set(session.id, session);
  return resource(session);
}

function resource({ id, run, description, step }) {
  return { id, recording: run.recording, description, step, remaining: run.steps - step, file: null, failure: null };
}

/** Shows the next steps of a run. */
function step(session, { count = 1, expected_step = session.step, reports = true }) {
  const { run, step } = session;
  if (expected_step !== step) {
    throw problem(409, "The session is at another step", `it is at step ${step}, not ${expected_step}`, { step });
  }
  const remaining = run.steps - step;
  if (count > remaining) {
    const detail = `the recorded run has ${remaining} steps left, ${count} were asked for`;
    throw problem(422, "The recording has no more steps", detail, { field: "count", step, remaining });
  }
  session.step += count;
  session.followers.forEach((follower) => follower.follow());
  const made = reports ? session.reports.slice(step + 1, session.step + 1).map((report) => JSON.parse(report)) : [];
  return { step: session.step, remaining: remaining - count, reports: made };
}

/** How a learner's last movement was chosen. */
async function selection({ run, step }, learner) {
  const path = `${run.folder}/selections/${learner.replace(":", "-")}/${step}.json.gz`;
  if (!run.searched.includes(learner) || step === 0) {
    const detail = `the last movement of \`${learner}\` was not chosen by DIRECT: it has not moved yet, or its policy is another`;
    throw problem(409, "There is nothing to show yet", detail);
  }
  return (await unpacked(path)).json();
}

/** Follows a session as it is shown. */
export class Follower {
  #session;
  #on;
  #next = 0;
  #stopped = false;

  /** @param {string} id @param {object} on as in session.js; a file cannot be lost on the way */
  constructor(id, on) {
    this.#session = sessions.get(id);
    this.#on = on;
    this.#begin();
  }

  stop() {
    this.#stopped = true;
    this.#session?.followers.delete(this);
  }

  async #begin() {
    const session = this.#session;
    try {
      // The whole recording at once: the viewer shows the step that it is told to.
      const recording = await get(`${session.run.folder}/scene.rrd`).then((response) => response.arrayBuffer());
      if (this.#stopped) return;
      this.#on.connected();
      this.#on.part(recording.slice(0, HEADER_BYTES));
      this.#on.part(recording.slice(HEADER_BYTES));
      this.#on.message(JSON.stringify({ type: "description", data: session.description }));
      session.followers.add(this);
      this.follow();
    } catch (error) {
      if (!this.#stopped) this.#on.ended(error.message, false);
    }
  }

  /** Tells of the steps that are shown by now. */
  follow() {
    const { reports, step } = this.#session;
    while (this.#next <= step) this.#on.message(`{"type":"step","data":${reports[this.#next++]}}`);
  }
}
