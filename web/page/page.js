// The page: one session at a time, stepped and watched.

import { Follower, ProblemError, request } from "./session.js";
import { Table } from "./table.js";
import { startViewer } from "./viewer.js";

/** The shortest time between two steps of a run, ms: it is to be watched. */
const RUN_EVERY_MS = 60;
/** Where drawing is slow, a run makes several steps between two pictures, to keep up this many a second. */
const RUN_STEPS_PER_SECOND = 10;
const RUN_MOST_AT_ONCE = 25;
/** How long a run waits for a step that was made to be shown, ms. */
const SHOWN_WITHIN_MS = 3000;

const element = (id) => document.getElementById(id);
const [scenario, seed, status] = ["scenario", "seed", "status"].map(element);
const table = new Table(element("learners"), document.body.dataset.learnerColors.split(" "));

/**
 * The state of the page: `latest` is the newest report, `shown` the newest step on the screen, `remaining` null without
 * an end, `busy` the session that makes a step, `passing` whether the status is outdated once there is a connection.
 */
const state = {
  session: null,
  own: false,
  follower: null,
  connected: false,
  ended: false,
  running: false,
  passing: false,
  busy: null,
  latest: null,
  shown: -1,
  remaining: null,
};
/** Parts that came before the viewer was there. */
let waiting = [];
let viewer = null;
/** Wakes a run that waits for a step to be shown. */
let shown = () => {};

/** @param {boolean} [passing] whether it is outdated once there is a connection */
function say(text, alarm = false, passing = false) {
  state.passing = passing;
  status.textContent = text;
  status.classList.toggle("alarm", alarm);
}

function refresh() {
  const atEnd = state.remaining === 0;
  const ready = state.session !== null && state.connected && !state.ended && !atEnd;
  element("step").disabled = !ready || state.busy !== null || state.running;
  element("run").disabled = !ready && !state.running;
  element("run").textContent = state.running ? "Pause" : "Run";
  element("run").setAttribute("aria-pressed", String(state.running));
  const left = state.remaining === null ? "" : `, ${state.remaining} left`;
  element("counter").textContent = `step ${state.latest?.step ?? "–"}${left}`;
}

/** Says what went wrong; a server that does not answer is the follower's to report. */
function explain(error) {
  state.running = false;
  if (error instanceof ProblemError) say(error.message, true);
  else say("The server does not answer.", true);
}

// ---- sessions

/** Leaves the session and opens the one that is chosen. */
async function reset(remark = "") {
  if (!element("choice").reportValidity()) return;
  state.running = false;
  const { session, own } = state;
  say("Opening a session…", false, true);
  try {
    const next = await request("POST", "/v1/sessions", { scenario: scenario.value, seed: Number(seed.value) });
    // The old one goes only after the new one has come.
    if (session !== null && own) request("DELETE", `/v1/sessions/${session}`).catch(() => {});
    sessionStorage.setItem("own", next.id);
    follow(next, true);
    // The first movement shows what it is all about.
    await step(1);
    if (remark) say(remark);
  } catch (error) {
    explain(error);
  }
  refresh();
}

/** Shows a session. */
function follow(resource, own) {
  state.follower?.stop();
  const { id, description, remaining } = resource;
  Object.assign(state, { session: id, own, connected: false, ended: false, latest: null, shown: -1, remaining });
  history.replaceState(null, "", `?session=${id}`);
  scenario.value = description.scenario;
  seed.value = String(description.seed);
  describe(id, description);
  waiting = [];
  shown();
  viewer?.open(id);
  let scheduled = false;
  state.follower = new Follower(id, {
    part: (part) => (viewer === null ? waiting.push(part) : viewer.feed(part)),
    step: (report) => {
      table.take(report);
      if (state.remaining !== null && state.latest !== null) state.remaining -= report.step - state.latest.step;
      state.latest = report;
      if (!scheduled) {
        scheduled = true;
        // A late visitor gets many at once; only the newest is shown.
        setTimeout(() => ((scheduled = false), id === state.session && show()), 0);
      }
    },
    connected: () => {
      state.connected = true;
      if (state.passing) say("");
      refresh();
    },
    lost: (seconds) => {
      state.connected = state.running = false;
      say(`The connection is lost; trying again in ${seconds} s.`, true, true);
      refresh();
    },
    ended: (failure) => {
      state.ended = true;
      state.running = state.connected = false;
      const why = failure === null ? "This session is gone." : `The engine has failed: ${failure}.`;
      say(`${why} Press Reset to begin anew.`, true);
      refresh();
    },
  });
}

function describe(id, description) {
  const { thresholds, truth, title } = description;
  table.begin(description);
  element("title").textContent = title;
  const known = truth !== null;
  element("orientation-threshold").textContent = known ? `limit ${thresholds.orientation_deg}` : "";
  element("location-threshold").textContent = known ? `limit ${thresholds.location_m * 1000}` : "";
  element("note").textContent = known
    ? "Converged: orientation and location stay within the limits, confirmed by 20 more movements."
    : "–: recorded data have no known truth to compare with. Prediction is over measurements held out from learning.";
  element("recording").href = `/v1/sessions/${id}/recording.rrd`;
  element("table").href = `/v1/sessions/${id}/steps.csv`;
  element("result").href = `/v1/sessions/${id}/result.json`;
  element("downloads").hidden = false;
}

function show() {
  if (state.latest === null) return;
  table.show(state.latest);
  const { step } = state.latest;
  const { session } = state;
  const reached = () => {
    if (session === state.session) state.shown = Math.max(state.shown, step);
    shown();
  };
  if (viewer === null) reached();
  else viewer.seek(step).then(reached);
  if (state.remaining === 0) {
    state.running = false;
    say("The end of the recorded data: every movement has been used. Reset begins anew.");
  }
  refresh();
}

// ---- steps

/** Makes so many steps; requests never overlap. */
async function step(count) {
  const { session } = state;
  if (state.busy === session) return;
  state.busy = session;
  refresh();
  try {
    const expected = state.latest?.step;
    const made = await request("POST", `/v1/sessions/${session}/steps`, { count, expected_step: expected ?? null });
    await untilShown(session, made.step);
  } catch (error) {
    // Somebody else has stepped this session: their steps are on their way.
    if (error.status === 409) await untilShown(session, error.problem.step);
    else if (session === state.session) explain(error);
  } finally {
    if (state.busy === session) state.busy = null;
    refresh();
  }
}

/** Waits for a step to be on the screen, so that a run goes no faster than it can be drawn. */
function untilShown(session, step) {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, SHOWN_WITHIN_MS);
    shown = () => {
      if (state.session === session && state.shown < step) return;
      clearTimeout(timer);
      resolve();
    };
    shown();
  });
}

async function run() {
  state.running = true;
  say("");
  refresh();
  const session = state.session;
  let count = 1;
  while (state.running && state.session === session) {
    const begun = performance.now();
    const pause = new Promise((resolve) => setTimeout(resolve, RUN_EVERY_MS));
    await step(Math.min(count, state.remaining ?? count));
    await pause;
    const due = Math.round(((performance.now() - begun) / 1000) * RUN_STEPS_PER_SECOND);
    count = Math.min(Math.max(due, 1), RUN_MOST_AT_ONCE);
  }
  refresh();
}

// ---- the viewer

async function openViewer() {
  const progress = element("progress");
  try {
    const opened = await startViewer(
      element("viewer"),
      { script: element("viewer-script").href, wasm: element("viewer-wasm").dataset.address },
      (fraction) => (fraction === null ? progress.removeAttribute("value") : (progress.value = fraction)),
    );
    viewer = opened;
    if (state.session !== null) viewer.open(state.session);
    waiting.splice(0).forEach((part) => viewer.feed(part));
    if (state.latest !== null) viewer.seek(state.latest.step);
    element("cover").hidden = true;
    const watch = setInterval(() => {
      const failure = viewer.failure();
      if (failure === null) return;
      clearInterval(watch);
      cover(`The viewer has crashed: ${failure} Reload the page to start it again.`);
    }, 1000);
  } catch (error) {
    cover(`The 3-D view cannot be shown: ${error.message ?? error}. The table goes on without it.`);
  }
}

function cover(text) {
  element("cover-text").textContent = text;
  element("progress").hidden = true;
  element("cover").hidden = false;
}

// ---- beginning

async function begin() {
  const asked = new URLSearchParams(location.search);
  try {
    const { scenarios } = await request("GET", "/v1/scenarios");
    scenario.replaceChildren(...scenarios.map(({ name, title }) => Object.assign(new Option(name), { title })));
    scenario.disabled = false;
    if (scenarios.some(({ name }) => name === asked.get("scenario"))) scenario.value = asked.get("scenario");
    if (/^\d+$/.test(asked.get("seed") ?? "")) seed.value = asked.get("seed");
    const id = asked.get("session");
    if (id === null) return await reset();
    const session = await request("GET", `/v1/sessions/${encodeURIComponent(id)}`).catch((error) => {
      if (error.status === 404) return null;
      throw error;
    });
    if (session === null) await reset("The session of this address is gone; this is a new one.");
    else follow(session, sessionStorage.getItem("own") === id);
  } catch (error) {
    explain(error);
  }
}

element("step").addEventListener("click", () => step(1));
element("run").addEventListener("click", () => {
  if (state.running) state.running = false;
  else run();
  refresh();
});
element("reset").addEventListener("click", () => (scenario.options.length === 0 ? begin() : reset()));
element("choice").addEventListener("submit", (event) => event.preventDefault());
scenario.addEventListener("change", () => reset());
seed.addEventListener("change", () => reset());

openViewer();
begin();
