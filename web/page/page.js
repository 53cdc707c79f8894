// The page: it opens connections, asks the server and moves the scene, as the panel tells it to. The panel decides.

import { SeedRuns } from "./seeds.js";
import { startViewer } from "./viewer.js";

/** Where runs come from: a server, or files beside the page. */
const source = await import(document.documentElement.dataset.source === "files" ? "./files.js" : "./session.js");
const { ask, Follower } = source;

/** Keys that mean something to the panel wherever on the page they are pressed. */
const KEYS = [" ", "ArrowLeft", "ArrowRight", "Escape", "+", "=", "-", "?", "r", "s", "n", "t"];
const KNOWN = "body-schema-known";
const OWN = "body-schema-own-session";

const element = (id) => document.getElementById(id);
let panel = null;
let viewer = null;
let follower = null;
let session = null;
/** The id of its recording. */
let recording = null;
/** Parts that came before the viewer was there, and the step to show then. */
let waiting = [];
let sought = null;

const tell = (event) => panel.receive(JSON.stringify(event));
const seeds = new SeedRuns(tell, ask);

/** Asks the server and tells the panel what became of it. */
async function request(asked, method, path, body, answer) {
  try {
    const value = await ask(method, path, body);
    answer(value);
  } catch (error) {
    const problem = error.problem ?? { status: 0, title: "the server does not answer" };
    tell({ is: "refused", asked, problem });
  }
}

/** What the panel asks for. */
const commands = {
  scenarios: () => request("scenarios", "GET", "/v1/scenarios", undefined, (list) => tell({ is: "scenarios", ...list })),

  find: ({ session: id }) =>
    request("find", "GET", `/v1/sessions/${encodeURIComponent(id)}`, undefined, follow).catch(() => {}),

  open({ scenario, seed, learners, ellipsoids }) {
    const before = session;
    return request("open", "POST", "/v1/sessions", { scenario, seed, learners, ellipsoids }, (next) => {
      // The old one goes only after the new one has come, and only if it was opened here.
      if (before !== null && kept(OWN) === before) ask("DELETE", `/v1/sessions/${before}`).catch(() => {});
      keep(OWN, next.id);
      follow(next);
    });
  },

  // The reports come over the WebSocket.
  step: ({ session: id, count, expected_step }) =>
    request("step", "POST", `/v1/sessions/${id}/steps`, { count, expected_step, reports: false }, ({ step }) =>
      tell({ is: "stepped", session: id, step }),
    ),

  seek({ step }) {
    sought = step;
    const id = session;
    viewer?.seek(step).then(() => id === session && tell({ is: "shown", step }));
  },

  select: ({ session: id, learner }) =>
    request("select", "GET", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/selection`, undefined, (selection) =>
      tell({ is: "selection", learner, selection }),
    ),

  evaluate: ({ session: id, learner, configuration }) =>
    request("evaluate", "POST", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/evaluations`, { configuration }, (evaluation) =>
      tell({ is: "evaluation", evaluation }),
    ),

  seeds: (job) => seeds.run(job),
  cancel_seeds: () => seeds.cancel(),

  address: ({ query }) => history.replaceState(null, "", `?${query}`),

  async copy({ text }) {
    const whole = text.startsWith("?") ? location.origin + location.pathname + text : text;
    const done = await (navigator.clipboard?.writeText(whole) ?? Promise.reject()).then(() => true, () => false);
    tell({ is: "copied", done });
  },

  async download({ path, name }) {
    const link = Object.assign(document.createElement("a"), { href: source.place(path), download: name });
    if (path.startsWith("/v1/scenarios/")) {
      const scenario = await ask("GET", path);
      link.href = URL.createObjectURL(new Blob([scenario.source], { type: "application/toml" }));
      setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    }
    link.click();
  },

  known: () => keep(KNOWN, "yes", localStorage),

  say({ text, phase, step, latest, session: id, typing }) {
    const mirror = element("mirror");
    Object.assign(mirror.dataset, { phase, step, latest, session: id, typing });
    if (mirror.textContent !== text) mirror.textContent = text;
  },
};

/** Shows a session from its first step on. */
function follow(resource) {
  follower?.stop();
  session = resource.id;
  recording = resource.recording ?? session;
  waiting = [];
  sought = null;
  tell({ is: "session", session: resource });
  viewer?.open(recording);
  follower = new Follower(session, {
    part: (part) => (viewer === null ? waiting.push(part) : viewer.feed(part)),
    message: (text) => panel.receive(`{"is":"live","message":${text}}`),
    connected: () => tell({ is: "connected" }),
    lost: (seconds) => tell({ is: "lost", seconds }),
    ended: (failure, unseen) => tell({ is: "ended", failure, unseen }),
  });
}

// ---- what is kept in the browser, where it lets us

function keep(name, value, store = sessionStorage) {
  try {
    store.setItem(name, value);
  } catch {}
}

function kept(name, store = sessionStorage) {
  try {
    return store.getItem(name);
  } catch {
    return null;
  }
}

// ---- beginning

async function openPanel() {
  const text = element("panel-cover-text");
  try {
    if (document.createElement("canvas").getContext("webgl2") === null) throw new Error("WebGL 2 is not available here");
    const [module, response] = await Promise.all([
      import(element("panel-script").href),
      source.wasm(element("panel-wasm").dataset.address),
    ]);
    await module.default({ module_or_path: response });
    const handle = new module.PanelHandle();
    await handle.start(element("panel-canvas"), (json) => {
      const command = JSON.parse(json);
      commands[command.do]?.(command);
    });
    panel = handle;
    element("panel-cover").hidden = true;
    const watch = setInterval(() => {
      const failure = panel.failure();
      if (failure === undefined) return;
      clearInterval(watch);
      text.textContent = `The controls have crashed: ${failure} Reload the page: the run is kept.`;
      element("panel-cover").hidden = false;
    }, 1000);
    const query = await source.query(location.search);
    tell({ is: "begin", query, known: kept(KNOWN, localStorage) !== null, server: source.server });
    return true;
  } catch (error) {
    document.querySelector("#panel-cover progress").hidden = true;
    text.textContent =
      `The controls cannot be shown: ${error.message ?? error}. They need a browser with WebGL 2 and WebAssembly; ` +
      "the HTTP interface at /v1/openapi.json and the command line do without.";
    element("mirror").dataset.phase = "failed";
    cover("Without the controls there is nothing to show.");
    return false;
  }
}

async function openViewer() {
  const progress = element("progress");
  try {
    const opened = await startViewer(
      element("viewer"),
      { script: element("viewer-script").href, wasm: () => source.wasm(element("viewer-wasm").dataset.address) },
      (fraction) => (fraction === null ? progress.removeAttribute("value") : (progress.value = fraction)),
      (step) => tell({ is: "scrubbed", step }),
    );
    viewer = opened;
    if (session !== null) viewer.open(recording);
    waiting.splice(0).forEach((part) => viewer.feed(part));
    if (sought !== null) commands.seek({ step: sought });
    element("cover").hidden = true;
    const watch = setInterval(() => {
      const failure = viewer.failure();
      if (failure === null) return;
      clearInterval(watch);
      noScene(`The scene has crashed: ${failure} Reload the page to start it again; the run is kept.`);
    }, 1000);
  } catch (error) {
    noScene(`The 3-D scene cannot be shown: ${error.message ?? error}. The charts go on without it.`);
  }
}

function noScene(reason) {
  cover(reason);
  tell({ is: "no_scene", reason });
}

function cover(text) {
  element("cover-text").textContent = text;
  element("progress").hidden = true;
  element("cover").hidden = false;
}

// Keys pressed in the panel are its own; all others that mean something to it are passed on before the scene sees them.
document.addEventListener(
  "keydown",
  (event) => {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const own = element("panel").contains(event.target);
    if (panel === null || own || event.ctrlKey || event.metaKey || event.altKey || !KEYS.includes(key)) return;
    panel.press(key.length === 1 ? key.toUpperCase() : key, event.shiftKey);
    event.preventDefault();
    event.stopPropagation();
  },
  { capture: true },
);

if (await openPanel()) openViewer();
