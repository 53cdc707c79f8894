// The page: it opens connections, asks the server and moves the scene, as the panel tells it to. The panel decides.

import { Controls } from "./controls.js";
import { CUT, atScene } from "./scene.js";
import { armAt } from "./pick.js";
import { quiet } from "./quiet.js";
import { passOn, picture } from "./picture.js";
import { save, saveBlob } from "./save.js";
import { Holder } from "./holder.js";
import { Lag } from "./lag.js";
import { Legend } from "./legend.js";
import { SeedRuns } from "./seeds.js";
import { Sketch } from "./sketch.js";
import { keep, kept } from "./storage.js";
import { copied, identity, isFresh } from "./links.js";
import { drawsInSoftware, startViewer } from "./viewer.js";

/** Where runs come from: an engine in this browser, or a server. */
const source = await (document.documentElement.dataset.source === "engine" ? import("./engine.js") : import("./session.js"));
const { arrangement, ask, Follower } = source;

/** Keys that mean something to the panel wherever on the page they are pressed. */
const KEYS = [" ", "ArrowLeft", "ArrowRight", "Escape", "+", "=", "-", "?", "r", "s", "n", "t"];
/** These are used by controls themselves. */
const KEYS_OF_CONTROLS = [" ", "ArrowLeft", "ArrowRight"];
const KNOWN = "body-schema-known";
/** A server knows nothing of sessions that were computed here, where the page was that of a folder before. */
const OWN = source.server ? "body-schema-own-session" : "body-schema-own-session-here";
/** How long a server may take to see that this page follows a session no longer, in milliseconds. */
const LEFT_WITHIN = 1000;

/** The viewer waits for what is drawn lightly to move, but not longer, ms. */
const MOVES_WITHIN = 8000;
/** The step at which it has moved. */
const MOVED_AT = 2;

/** A request that is not answered at once waits for the engine, if that is on its way: it is told after so long, ms. */
const AWAITED_AFTER = 500;
/** What waits, by the name of the request. */
const FOLLOWS = {
  scenarios: "the page begins",
  open: "the run that was chosen begins",
  step: "the next movements follow",
  other: "the answer follows",
};

const element = (id) => document.getElementById(id);
let panel = null;
let viewer = null;
/** Whether the scene has shown a step, and whether the session that is followed has ended. */
let begun = false;
let ended = false;
let follower = null;
let session = null;
/** The id of its recording. */
let recording = null;
/** The learner that the scene shows alone, or null for all. */
let alone = null;
/** The session that was opened here. A new window begins with what the one that opened it had kept; a page that is loaded again is still itself. */
let own = performance.getEntriesByType("navigation")[0]?.type === "reload" ? kept(OWN) : null;
let controls = null;
/** What the panel said of itself last. */
let said = null;
/** The next address is that of what is opened at the moment: no step of the visitor's. */
let arriving = true;
/** Parts that came before the viewer was there, and the step to show then. */
let waiting = [];
let sought = null;
/** The step that the light drawing shows. */
let drawn = null;
/** Whether the first story plays by itself; and until it has moved, or the page has what it shows instead. */
let playsFirst = false;
let moves;
const moved = new Promise((resolve) => (moves = resolve));
/** The requests that are not answered for long, by their names. */
const awaited = new Map();
/** When the panel has something to do between its frames. */
let due = 0;
/** The steps to which the recording holds postures on the way. */
const ways = new Set();

const tell = (event) => pass(JSON.stringify(event));
const seeds = new SeedRuns(tell, ask);
const sketch = new Sketch(element("sketch"), element("sketch-text"));
const lag = new Lag(element("lag"), () => viewer.step);
const legend = new Legend(element("legend"));
const holder = new Holder(tell);

/** Tells the panel of an event, and has it do what follows from that now if it is drawn sparingly. */
function pass(event) {
  panel.receive(event);
  attend();
}

/** Has the panel do what is due between two of its frames. */
function attend() {
  clearTimeout(due);
  const seconds = panel.attend();
  if (seconds !== undefined) due = setTimeout(attend, 1000 * seconds);
}

/** Asks the server and tells the panel what became of it. */
async function request(asked, method, path, body, answer) {
  const key = Symbol(asked);
  const late = setTimeout(() => awaited.set(key, asked) && tellAwaited(), AWAITED_AFTER);
  try {
    const value = await ask(method, path, body);
    answer(value);
  } catch (error) {
    const problem = error.problem ?? { status: 0, title: "the server does not answer" };
    tell({ is: "refused", asked, problem });
  } finally {
    clearTimeout(late);
    if (awaited.delete(key)) tellAwaited();
  }
}

/** Says that what was asked for last waits for the engine, as long as that is on its way. */
function tellAwaited() {
  const [note, asked, coming] = [element("awaited"), [...awaited.values()].at(-1), source.coming()];
  note.hidden = asked === undefined || coming === null;
  if (note.hidden) return;
  note.textContent = `The engine is still loading; ${FOLLOWS[asked] ?? FOLLOWS.other} as soon as it is there.`;
  coming.then(tellAwaited);
}

/** What the panel asks for. */
const commands = {
  scenarios: () =>
    request("scenarios", "GET", "/v1/scenarios", undefined, (list) => {
      holder.scenarios = list.scenarios.map(({ name }) => name);
      tell({ is: "scenarios", ...list });
    }),

  // The page does without them where they cannot be had.
  async robots() {
    const { sessions } = await ask("GET", "/v1/sessions").catch(() => ({ sessions: [] }));
    tell({ is: "robots", sessions: sessions.filter(({ world }) => world === "outside") });
  },

  your_robot: () => location.assign("calibrate.html"),

  // What becomes of these comes over the WebSocket.
  suggest: ({ session: id }) => request("suggest", "POST", `/v1/sessions/${id}/suggestions`, {}, () => tell({ is: "told" })),

  end_suggestion: ({ session: id, suggestion, state }) =>
    request("end_suggestion", "POST", `/v1/sessions/${id}/suggestions/${suggestion}/outcome`, { state }, () => tell({ is: "told" })),

  not_seen: ({ session: id, suggestion: suggestion_id, configuration }) =>
    request("not_seen", "POST", `/v1/sessions/${id}/observations`, { suggestion_id, configuration, measurements: {} }, () =>
      tell({ is: "told" }),
    ),

  async find({ session: id }) {
    // A session that is gone is no error: its address says how to run it again.
    let resource;
    try {
      resource = await ask("GET", `/v1/sessions/${encodeURIComponent(id)}`);
    } catch (error) {
      if (error.status === 404) tell({ is: "session", session: null });
      else tell({ is: "refused", asked: "find", problem: error.problem ?? { status: 0 } });
      return;
    }
    follow(resource);
  },

  open({ scenario, set, seed, learners, ellipsoids, enlarge }) {
    return request("open", "POST", "/v1/sessions", { scenario, set, seed, learners, ellipsoids, enlarge }, (next) => {
      // The old one goes only after the new one has come, if it was opened here and nobody else watches it.
      const before = own;
      own = next.id;
      keep(OWN, own);
      follow(next);
      if (before !== null && before !== own) {
        setTimeout(() => ask("DELETE", `/v1/sessions/${before}?if=unwatched`).catch(() => {}), LEFT_WITHIN);
      }
    });
  },

  // The reports come over the WebSocket.
  step({ session: id, count, expected_step, frames = 0 }) {
    for (let step = expected_step + 1; frames > 0 && step <= expected_step + count; step++) ways.add(step);
    return request("step", "POST", `/v1/sessions/${id}/steps`, { count, expected_step, frames, reports: false }, ({ step }) =>
      tell({ is: "stepped", session: id, step }),
    );
  },

  seek({ step }) {
    sought = step;
    const id = session;
    if (viewer === null) {
      draw();
      return undefined;
    }
    lag.seek(step);
    return viewer.seek(step, ways.has(step)).then(() => {
      if (id !== session) return;
      lag.there(step);
      tell({ is: "shown", step });
    });
  },

  select: ({ session: id, learner }) =>
    request("select", "GET", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/selection`, undefined, (selection) =>
      tell({ is: "selection", learner, selection }),
    ),

  evaluate: ({ session: id, learner, configuration }) =>
    request("evaluate", "POST", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/evaluations`, { configuration, show: true }, (evaluation) =>
      tell({ is: "evaluation", evaluation }),
    ),

  configure: ({ session: id, learner, configuration }) =>
    request("configure", "POST", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/configuration`, { configuration }, (evaluation) =>
      tell({ is: "configured", learner, evaluation }),
    ),

  // A map of them is drawn, which nothing waits for.
  async survey({ session: id, learner, configurations }) {
    const gains = [];
    try {
      for (const configuration of configurations) {
        if (id !== session) return;
        gains.push((await ask("POST", `/v1/sessions/${id}/learners/${encodeURIComponent(learner)}/evaluations`, { configuration })).gain);
      }
    } catch {
      gains.splice(0);
    }
    tell({ is: "surveyed", session: id, gains });
  },

  // The first look begins with one learner.
  alone({ learner }) {
    alone = learner;
    viewer?.show(alone);
  },

  // A card of a story speaks of something in the scene.
  point: ({ at }) => legend.point(at),

  seeds: (job) => seeds.run(job),
  enough_seed: ({ seed }) => seeds.enough(seed),
  cancel_seeds: () => seeds.cancel(),

  address({ query }) {
    // Another run is a page of the visitor's history; another step of it is not.
    const same = identity(query) === identity(location.search);
    history[arriving || same ? "replaceState" : "pushState"](null, "", `?${query}`);
    arriving = false;
  },

  copy: ({ text }) => copied(text).then((result) => tell({ is: "copied", ...result })),

  restore_view: () => viewer?.restore(),

  async picture() {
    try {
      if (viewer === null || said === null) throw new Error("there is no scene yet");
      const blob = picture(element("viewer"), CUT, said.caption, legend.lines(), () => viewer.redraw());
      // Both may refuse; that is told once.
      blob.catch(() => {});
      tell({ is: "copied", done: true, note: await passOn(blob, `${said.caption.title.replaceAll(/[^\w-]+/g, "-")}.png`) });
    } catch (error) {
      tell({ is: "copied", done: false, note: `There is no picture: ${error.message}.` });
    }
  },

  async download({ path, name }) {
    if (!path.startsWith("/v1/scenarios/")) {
      return source.file === undefined ? save(path, name) : saveBlob(await source.file(path), name);
    }
    const scenario = await ask("GET", path);
    saveBlob(new Blob([scenario.source], { type: "application/toml" }), name);
  },

  known: () => keep(KNOWN, "yes", "localStorage"),

  say(state) {
    const { text, news, phase, step, latest, session: id, typing, caption } = (said = state);
    legend.show(caption);
    sketch.of(caption.learners);
    draw();
    if (drawn >= MOVED_AT || (!playsFirst && phase !== "loading")) moves();
    viewer?.playing(phase === "playing");
    holder.hear(said);
    const mirror = element("mirror");
    Object.assign(mirror.dataset, { phase, step, latest, session: id, typing });
    if (mirror.textContent !== text) mirror.textContent = text;
    if (element("news").textContent !== news) element("news").textContent = news;
  },
};

/** Draws the step that is sought, as long as there is no viewer: there is a drawing meanwhile, for which nothing has to wait. */
function draw() {
  const step = sought;
  if (viewer === null && step !== drawn && step !== null && sketch.show(step)) {
    drawn = step;
    tell({ is: "shown", step });
  }
}

/** Shows a session from its first step on. */
function follow(resource) {
  follower?.stop();
  session = resource.id;
  recording = resource.recording ?? session;
  waiting = [];
  sought = drawn = null;
  ended = false;
  sketch.clear();
  lag.stop();
  ways.clear();
  tell({ is: "session", session: resource });
  show();
  follower = new Follower(session, {
    part: (part) => (viewer === null ? waiting.push(part) : viewer.feed(part)),
    message: (text) => {
      if (viewer === null) sketch.take(text);
      pass(`{"is":"live","message":${text}}`);
    },
    connected: () => tell({ is: "connected" }),
    lost: (seconds) => tell({ is: "lost", seconds }),
    ended: (failure, unseen) => {
      ended = true;
      tellEnd();
      tell({ is: "ended", failure, unseen });
    },
    begun: follow,
  }, resource.world === "outside" ? resource.recording : null);
}

/** Says that a scene that has shown nothing waits for nothing either: its session has ended before. */
function tellEnd() {
  if (ended && viewer !== null && !begun) cover("There is no scene: the session ended before it was shown.");
}

/** Tells the panel on which side of it the scene is. */
function layOut() {
  const [panel, scene] = ["panel", "scene"].map((id) => element(id).getBoundingClientRect());
  tell({ is: "layout", scene: scene.top < panel.top ? "above" : scene.left < panel.left ? "left" : "right" });
}

/** Opens the session's recording in the viewer, if it is there. */
function show() {
  const id = session;
  viewer?.open(source.recordingOf(recording), (view) => arrangement(id, view));
}

// ---- what is kept in the browser, where it lets us

// ---- beginning

async function openPanel() {
  const text = element("panel-cover-text");
  try {
    if (document.createElement("canvas").getContext("webgl2") === null) throw new Error("WebGL 2 is not available here");
    const known = kept(KNOWN, "localStorage") !== null;
    const begins = source.begin(location.search, known);
    const [module, response] = await Promise.all([
      import(element("panel-script").href),
      source.wasm(element("panel-wasm").dataset.address),
    ]);
    await module.default({ module_or_path: response });
    const handle = new module.PanelHandle();
    const obey = (json) => {
      const command = JSON.parse(json);
      commands[command.do]?.(command);
    };
    await handle.start(element("panel-canvas"), obey, drawsInSoftware());
    panel = handle;
    element("panel-cover").hidden = true;
    // The canvas cannot be left by keys; the controls that lie over it can.
    element("panel-canvas").tabIndex = -1;
    nameTextAgents();
    controls = new Controls(element("controls"), handle);
    controls.focus();
    const watch = setInterval(() => {
      const failure = panel.failure();
      if (failure === undefined) return;
      clearInterval(watch);
      text.textContent = `The controls have crashed: ${failure} Reload the page: the run is kept.`;
      element("panel-cover").hidden = false;
    }, 1000);
    new ResizeObserver(layOut).observe(element("panel"));
    const query = await begins;
    const fresh = isFresh(new URLSearchParams(query));
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    playsFirst = fresh && !known && !still;
    tell({ is: "begin", query, known, server: source.server, fresh, still });
    return true;
  } catch (error) {
    document.querySelector("#panel-cover progress").hidden = true;
    text.textContent =
      `The controls cannot be shown: ${error.message ?? error}. They need a browser with WebGL 2 and WebAssembly; ` +
      source.instead;
    element("mirror").dataset.phase = "failed";
    holder.failed(text.textContent);
    cover("Without the controls there is nothing to show.");
    return false;
  }
}

async function openViewer() {
  const progress = element("progress");
  // The viewer takes the focus when it starts.
  let before = null;
  const turn = moved.then(() => (before = document.activeElement));
  setTimeout(moves, MOVES_WITHIN);
  try {
    const opened = await startViewer(
      element("viewer"),
      { script: element("viewer-script").dataset.address, wasm: () => source.wasm(element("viewer-wasm").dataset.address) },
      (fraction) => (fraction === null ? progress.removeAttribute("value") : (progress.value = fraction)),
      turn,
    );
    // What there is to see comes from the engine.
    const failure = await source.ready().then(() => null, ({ message }) => message);
    if (failure !== null) return noScene(`There is no 3-D scene: ${failure}.`);
    viewer = opened;
    viewer.show(alone);
    element("viewer").tabIndex = 0;
    nameTextAgents();
    (before?.isConnected && before !== document.body ? before : element("controls")).focus();
    if (session !== null) show();
    waiting.splice(0).forEach((part) => viewer.feed(part));
    // Until a step is there in full, an arm or two would stand for all, or the viewer's own words for a scene.
    viewer.begun().then(() => {
      begun = true;
      element("cover").hidden = true;
    });
    tellEnd();
    if (sought !== null) commands.seek({ step: sought });
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
  lag.stop();
  cover(reason);
  tell({ is: "no_scene", reason });
}

function cover(text) {
  element("cover-text").textContent = text;
  element("progress").hidden = true;
  element("cover").hidden = false;
}

/** Tells the panel whose arm was clicked on. */
async function pick(x, y) {
  if (viewer === null || panel === null || said === null) return;
  const learner = await armAt(element("viewer"), [x, y], said.caption.learners, () => viewer.redraw());
  if (learner !== null) tell({ is: "picked", learner });
}

/** Canvases keep a field each for what is typed: not to be reached by Tab, and with a name. */
function nameTextAgents() {
  for (const field of document.querySelectorAll("input:not([data-id])")) {
    field.tabIndex = -1;
    field.setAttribute("aria-label", "What is typed");
    field.autocomplete = "off";
  }
}

// Keys pressed in the panel's canvas are its own; all others that mean something to it are passed on, and the viewer gets
// none: each of them would take the scene apart.
// As long as the viewer starts, it has the focus without the visitor's doing: there is nothing to leave by Escape yet.
function onKey(event) {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const { target } = event;
  const scene = element("scene").contains(target);
  const onCanvas = element("panel").contains(target) && !element("controls").contains(target);
  const held = event.ctrlKey || event.metaKey || event.altKey;
  if (scene) event.stopImmediatePropagation();
  if (panel === null || event.type !== "keydown" || held) return;
  if (key === "F6" || (scene && viewer !== null && key === "Escape")) {
    if (scene) controls.focus();
    else element("viewer").focus();
    event.preventDefault();
    event.stopImmediatePropagation();
  } else if (key === "Tab" && onCanvas) {
    // From where the focus is put now, the browser goes on by itself.
    event.stopImmediatePropagation();
    controls.focus();
  } else if (!onCanvas && KEYS.includes(key) && !takes(target, key)) {
    panel.press(key.length === 1 ? key.toUpperCase() : key, event.shiftKey);
    event.preventDefault();
    event.stopImmediatePropagation();
  }
}

/** Whether an element of the page has a use of its own for a key. */
function takes(target, key) {
  if (key === "Escape" || target === element("controls") || !element("controls").contains(target)) return false;
  return Controls.isTyping(target) || KEYS_OF_CONTROLS.includes(key);
}

addEventListener("keydown", onKey, { capture: true });
addEventListener("keyup", onKey, { capture: true });
// The visitor goes back or forth.
addEventListener("popstate", () => {
  arriving = true;
  if (panel !== null) tell({ is: "navigated", query: location.search });
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => viewer?.restore());
atScene(element("scene"), element("viewer"), pick);
quiet();
if (new URLSearchParams(location.search).get("embed") === "1") document.documentElement.dataset.embed = "";

if (await openPanel()) await openViewer();
source.keep?.();
