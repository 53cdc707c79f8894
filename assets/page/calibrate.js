// The page of a visitor's own robot: files in, a calibration out, all of it computed here.

import { Bench, Refused, Stopped } from "./bench.js";
import { Columns } from "./columns.js";
import { Dialogue } from "./dialogue.js";
import { bodyOf, Later, MOST_BYTES } from "./later.js";
import { quiet } from "./quiet.js";
import { saveBlob } from "./save.js";
import { cells, rows } from "./table.js";
import { startViewer } from "./viewer.js";

quiet();

const at = (id) => document.getElementById(id);
const field = (name) => at("form").elements[name];
const bench = new Bench();
/** The program that the page is of, for certificates. */
const software = document.querySelector("meta[name=generator]").content;
const columns = new Columns(at("columns"), () => guess("columns"));
/** The files that were dropped: their texts, by their names. */
let files = {};
/** The table whose titles say what the form says, in place of the one that was dropped. */
let titled = {};
/** The files to work with. */
const present = () => ({ ...files, ...titled });
/** Meshes that were dropped, by their paths in the folder; whether the files are those of a robot that ships, whose meshes do not. */
let meshes = {};
let ships = false;
/** The calibration file's name; its text stands in the editor. */
let file = "";
/** Whether nothing is measured yet, and postures are looked for. */
let plans = false;
/** What was asked last of the guesses: answers to earlier questions are passed over. */
let turn = 0;
/** The calibration file as the form wrote it: what is other was written by hand. */
let written = "";
/** Files that the visitor does not have: of an example, of a session, of a plan. */
let lent = {};

const KINDS = { urdf: /\.(urdf|xml|xacro)$/i, table: /\.(csv|tsv|txt)$/i, file: /\.toml$/i, session: /\.json$/i };
const named = (kind) => Object.keys(files).filter((name) => KINDS[kind].test(name));

const MESH = /\.(stl|obj|glb)$/i;

/** How long the visitor must have stopped writing, ms. */
const PAUSE_MS = 500;

// Files.

at("choose").onclick = () => at("input").click();
at("input").onchange = async () => {
  await take([...at("input").files].map(pathless));
  at("input").value = "";
};
// Before the viewer, which would take what is dropped on the scene for a recording.
for (const kind of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(
    kind,
    async (event) => {
      event.preventDefault();
      event.stopPropagation();
      at("drop").classList.toggle("over", kind === "dragover");
      if (kind === "drop") take(await given(event.dataTransfer));
    },
    { capture: true },
  );
}

/** @typedef {{path: string, file: File}} Given a file, and its path in what was dropped */

const pathless = (file) => ({ path: file.name, file });

/** The files of a drop, those in folders among them. @param {DataTransfer} transfer @returns {Promise<Given[]>} */
async function given(transfer) {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.some((entry) => entry.isDirectory)) return [...transfer.files].map(pathless);
  const found = [];
  const walk = async (entry) => {
    if (entry.isFile) {
      const file = await new Promise((resolve, reject) => entry.file(resolve, reject));
      return found.push({ path: entry.fullPath, file });
    }
    const reader = entry.createReader();
    for (;;) {
      const some = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
      if (some.length === 0) return;
      for (const inner of some) await walk(inner);
    }
  };
  for (const entry of entries) await walk(entry);
  return found;
}

/** Takes files in. @param {Given[]} all */
async function take(all) {
  complain("problem");
  const [taken, wrong] = [[], []];
  const known = all.filter(({ path }) => [...Object.values(KINDS), MESH].some((kind) => kind.test(path)));
  if (all.length > 0 && known.length === 0) {
    wrong.push(`${all.map(({ path }) => path).join(", ")}: no URDF, no CSV, no calibration file (.toml), no mesh (STL, OBJ, GLB) among these`);
  }
  for (const { path, file } of known) {
    const isMesh = MESH.test(path);
    if ((isMesh ? meshBytes() : 0) + file.size > MOST_BYTES) {
      wrong.push(isMesh ? `${path} is not drawn: meshes may have ${MOST_BYTES / 2 ** 20} MiB together` : `${path} has more than ${MOST_BYTES / 2 ** 20} MiB`);
    } else if (isMesh) meshes[path] = new Uint8Array(await file.arrayBuffer());
    else {
      files[file.name] = await file.text();
      taken.push(file.name);
    }
  }
  ships &&= taken.length === 0;
  // Meshes alone change nothing but how the robot is drawn.
  if (taken.length > 0) await begin(taken);
  else list();
  if (wrong.length > 0) complain("problem", [...wrong, at("problem").textContent].filter(Boolean).join("\n"));
}

at("open-example").onclick = async () => {
  const name = at("example").value;
  await attempt("problem", async () => {
    const { answer } = await bench.ask({}, { example: { name } });
    files = { ...answer.files, [answer.file]: answer.text };
    lent = answer.files;
    ships = true;
    await begin([answer.file]);
  });
};

/** Begins with the files that there are. @param {string[]} fresh those that have just come */
async function begin(fresh) {
  // Folders have other JSON, too.
  const isSession = (name) => KINDS.session.test(name) && (fresh.length === 1 || /"events"\s*:/.test(files[name]));
  const session = fresh.findLast(isSession);
  if (session !== undefined) return attempt("problem", () => dialogue.resume(files[session]));
  list();
  at("outcome").hidden = at("measure").hidden = at("later").hidden = true;
  const calibration = fresh.findLast((name) => KINDS.file.test(name));
  const [urdfs, tables] = [named("urdf"), named("table")];
  if (calibration === undefined && urdfs.length === 0) {
    return complain("problem", "a description is missing: drop the robot's URDF too");
  }
  const last = (names) => names.findLast((name) => fresh.includes(name)) ?? names.at(-1);
  plans = calibration === undefined && tables.length === 0;
  choices(field("urdf"), urdfs, last(urdfs));
  choices(field("table"), tables, last(tables));
  for (const name of ["base", "tip"]) choices(field(name), []);
  for (const name of ["socket_distance", "tag_side", "folds", "angles", "lengths"]) field(name).value = "";
  at("carriers").hidden = true;
  titled = {};
  const own = calibration === undefined;
  const fields = { urdf: own && urdfs.length > 1, table: own && tables.length > 1, sensor: plans, base: own, tip: own, angles: false, lengths: false, socket_distance: false, tag_side: false, folds: !plans };
  for (const [name, is] of Object.entries(fields)) label(name).hidden = !is;
  at("robot-title").textContent = own ? "2. What was guessed" : "2. What the calibration file says";
  at("robot").hidden = false;
  if (own) return guess();
  at("guesses").replaceChildren();
  columns.list({ titles: null, joints: [] });
  write(calibration, files[calibration]);
  await reread();
}

/** Lists what is there. */
function list() {
  const texts = Object.entries(files).map(([name, text]) => item(`${name}, ${size(text.length)}`));
  const count = Object.keys(meshes).length;
  at("list").replaceChildren(...texts, ...(count === 0 ? [] : [item(`${many(count, "mesh", "meshes")}, ${size(meshBytes())}`)]));
}

const meshBytes = () => Object.values(meshes).reduce((sum, mesh) => sum + mesh.length, 0);

// Guesses.

at("form").onchange = ({ target }) => (target.name === "folds" ? reread() : guess(target.name));
at("form").onsubmit = (event) => event.preventDefault();

/** Asks for a calibration file that fits the form. @param {string} [changed] the field that was changed */
async function guess(changed) {
  const isEdited = changed !== undefined && at("text").value !== written;
  if (isEdited && !confirm(`${file} was edited by hand. Write it anew by the form? The edits are lost then.`)) {
    return complain("problem", `the form was changed, and ${file} was not: it is as you edited it`);
  }
  const mine = ++turn;
  const urdf = field("urdf").value;
  await attempt("problem", async () => {
    const table = field("table").value;
    if ([undefined, "urdf", "table"].includes(changed)) {
      const { answer } = await bench.ask(files, { describe: { urdf, table: plans ? null : table } });
      if (mine !== turn) return;
      if (changed !== "table") {
        choices(field("base"), answer.links, "", "guess");
        choices(field("tip"), answer.links, "", "guess");
      }
      carry(answer);
      columns.list(answer);
    }
    const [base, tip] = ["base", "tip"].map((name) => field(name).value || null);
    const [distance, side] = ["socket_distance", "tag_side"].map((name) => (field(name).value === "" ? null : Number(field(name).value)));
    const [angles, lengths] = ["angles", "lengths"].map((name) => field(name).value || null);
    const ask = plans
      ? { plan: { urdf, base, tip, sensor: field("sensor").value } }
      : { begin: { urdf, table, base, tip, on: carriers(), tag_side_mm: side, socket_distance_mm: distance, columns: columns.roles, angles, lengths } };
    const { answer } = await bench.ask(files, ask);
    if (mine !== turn) return;
    titled = answer.table === undefined ? {} : { [answer.table.file]: answer.table.text };
    if (plans) {
      files = present();
      lent = { ...titled };
    } else {
      for (const name of ["angles", "lengths"]) {
        label(name).hidden = answer.unitless[name].length === 0;
        label(name).title = answer.unitless[name].join(", ");
      }
      columns.tell(answer.columns);
    }
    for (const name of ["socket_distance", "tag_side"]) {
      if (answer.guesses.some(({ field }) => field === name)) label(name).hidden = false;
    }
    at("guesses").replaceChildren(...answer.guesses.map(({ said }) => item(said)));
    write(answer.file, answer.text);
    await reread();
  });
  if (at("problem").hidden) return;
  at("work").hidden = true;
  // A row may be wrong in the units that no title says alone.
  if (!plans) for (const name of ["angles", "lengths"]) label(name).hidden = false;
  // Most of what is wrong here is a title.
  if (/\b(title|column)/.test(at("problem").textContent)) columns.open();
}

/** Asks for the link of each camera and target, where there are several. @param {{links: string[], carried: string[] | null}} description */
function carry({ links, carried }) {
  const names = carried ?? [];
  const rows = names.map((name) => {
    const select = Object.assign(document.createElement("select"), { name: `on:${name}` });
    choices(select, links, "", "guess");
    const row = Object.assign(document.createElement("label"), { textContent: `Link that carries ${name} ` });
    row.append(select);
    return row;
  });
  at("carriers").replaceChildren(...rows);
  at("carriers").hidden = plans || names.length < 2;
}

/** The links of cameras and targets that were said, by the names of these. */
function carriers() {
  const all = [...at("carriers").querySelectorAll("select")].filter(({ value }) => value !== "");
  return Object.fromEntries(all.map(({ name, value }) => [name.slice("on:".length), value]));
}

function write(name, text) {
  file = name;
  at("file-name").textContent = name;
  at("text").value = written = text;
}

let pause = 0;
at("text").oninput = () => {
  clearTimeout(pause);
  pause = setTimeout(reread, PAUSE_MS);
};

/** Reads the calibration file, and says what is doubtful in its table. */
async function reread() {
  complain("failure");
  // What was computed was computed of something else.
  at("outcome").hidden = at("later").hidden = true;
  at("doubts").replaceChildren();
  at("calibrate").hidden = plans;
  at("dialogue").hidden = !plans;
  if (plans) {
    at("read").textContent = "Nothing is measured yet. Choose postures, measure there, write it into the table, and drop that here.";
    at("work").hidden = false;
    return;
  }
  const mine = turn;
  at("read").textContent = "Reading…";
  const is = await attempt("problem", async () => {
    const { answer } = await bench.ask(present(), { read: { file, text: at("text").value, folds: folded() } });
    if (mine !== turn) return;
    const { rows, joints, held_out, folds, unknowns, doubts, unjudged } = answer;
    const held = folds > 1 ? `every row is held out once, in ${folds} folds` : `${held_out} of them are held out`;
    const unchecked = unjudged ? `Units, signs, zeros and order of the joints' columns could not be checked: ${unjudged}.` : "";
    const nothing = unjudged ? "" : "Nothing in the table is doubtful.";
    const found = [doubts.length === 0 ? nothing : `${plural(doubts.length, "doubt")} below.`, unchecked].filter(Boolean).join(" ");
    at("read").textContent = `${plural(rows, "row")} of ${plural(joints.length, "joint")}; ${held}; ${unknowns} unknowns. ${found}`;
    at("doubts").replaceChildren(...doubts.map(doubt));
    later.offer(folds <= 1 && held_out > 0);
  });
  if (!is) at("read").textContent = "";
  at("work").hidden = !is;
}

/** The number of folds that the form says; null where the file is to say it. */
const folded = () => (field("folds").value === "" ? null : whole(field("folds"), "folds"));

/** The whole number in an input. @param {HTMLInputElement} input @param {string} what it is */
function whole(input, what) {
  if (input.checkValidity() && input.value !== "") return Number(input.value);
  const most = input.max === "" ? "" : ` to ${input.max}`;
  throw new Refused(`${what}: write a whole number from ${input.min}${most}`);
}

/** A doubt, beside the rows that it speaks of. */
function doubt({ column, lines, what, evidence, hint }) {
  const box = document.createElement("div");
  box.className = "doubt";
  const about = column === null ? "" : `Column ${column}: `;
  box.append(paragraph(`${about}${what} (${evidence}).`), paragraph(`${capital(hint)}.`));
  const of = lines.length === 0 ? null : (lines[0].file ?? named("table").find((name) => at("text").value.includes(name)));
  const text = present()[of];
  if (text !== undefined) box.append(rows(text, lines.filter((line) => (line.file ?? of) === of).map(({ line }) => line), column));
  return box;
}

// Work.

at("calibrate").onclick = () => compute(calibrated);
at("observe").onclick = () => compute(observed);
at("dialogue").onclick = () => compute(() => dialogue.open(present(), at("text").value));
at("cancel").onclick = () => bench.stop();

/** Computes with progress, until it is done or stopped. @param {() => Promise<void>} work @param {string} [where] what failed is told */
async function compute(work, where = "failure") {
  if (where === "failure") at("outcome").hidden = true;
  const buttons = [at("calibrate"), at("observe"), at("dialogue"), at("open-example"), at("choose"), at("choose-later"), at("watch-held-out")];
  for (const button of buttons) button.disabled = true;
  at(where).before(at("progress"));
  at("progress").hidden = false;
  progressed({ what: "starting", steps: 0, made: 0 });
  await attempt(where, work);
  at("progress").hidden = true;
  for (const button of buttons) button.disabled = false;
}

function progressed({ what, steps, made }) {
  const bar = at("progress").querySelector("progress");
  if (steps > 0) [bar.max, bar.value] = [steps, Math.min(made, steps)];
  else bar.removeAttribute("value");
  at("progress").querySelector("span").textContent = steps > 0 ? `${what}: ${Math.min(made, steps)} of ${steps}` : what;
}

async function calibrated() {
  const ask = { file, text: at("text").value, folds: folded(), software };
  const { answer, scene } = await bench.ask(present(), { calibrate: ask }, progressed, meshes);
  at("said").textContent = capital(answer.said);
  const report = answer.files.find(({ path }) => path === "report.html").text;
  // Its title and first sentence stand above already.
  const page = bodyOf(report);
  page.querySelector("header")?.remove();
  page.querySelector(".lead")?.remove();
  at("report").replaceChildren(...page.childNodes);
  later.open();
  at("to-later").hidden = false;
  const wanted = ["calibrated.urdf", "kinematics.yaml", "readings.yaml", "report.html", "report.json", "certificate.html", "certificate.json"];
  const texts = wanted.flatMap((name) => answer.files.filter(({ path }) => path === name));
  const named = Object.keys({ ...lent, ...titled }).filter((name) => ask.text.includes(name));
  const own = [[ask.file, ask.text], ...named.map((name) => [name, present()[name]])];
  offers([...texts.map(({ path, text }) => [path, text]), ["calibration.rrd", scene.bytes], ...own]);
  at("outcome").hidden = false;
  const words = "The robot in each measured posture, its errors enlarged. Drag to turn the view; the bar below it goes from row to row.";
  show("outcome", `${words}${ships ? "" : without(answer.undrawn)}`, scene);
  at("outcome").scrollIntoView({ behavior: "smooth" });
}

/** What is said of meshes that are not drawn. @param {string[]} names */
function without(names) {
  if (names.length === 0) return "";
  const named = names.slice(0, 3).map((name) => name.split("/").at(-1)).join(", ");
  const some = names.length > 3 ? `${named} and ${names.length - 3} more` : named;
  return ` Capsules stand for links whose meshes are not here (${some}): drop the robot's folder; STL, OBJ and GLB are drawn.`;
}

async function observed() {
  const ask = { file, text: at("text").value, postures: whole(at("postures"), "postures"), accuracy_mm: Number(at("accuracy").value) };
  if (!at("accuracy").checkValidity()) throw new Refused("the error that is wanted: write millimetres, above 0");
  const { answer } = await bench.ask(present(), { observability: ask }, progressed);
  const { found, table } = answer;
  at("said").textContent = capital(found.accuracy.said);
  at("to-later").hidden = true;
  const { learned, rank, undetermined } = found.parameters;
  const told = [`${learned} parameters are to be learned, and measurements can determine ${rank} directions among them.`];
  const errors = [
    ["postures", "expected error, best (mm)", "random (mm)"],
    ...found.errors.map(({ postures, best_mm, random_median_mm }) => [postures, best_mm.toFixed(3), random_median_mm.toFixed(3)]),
  ];
  const weak = [...undetermined, ...found.weak.map(({ said }) => said)];
  const list = document.createElement("ul");
  list.append(...weak.map(item));
  at("report").replaceChildren(
    ...told.map(paragraph),
    list,
    heading("Postures to measure, the most telling first (rad, m)"),
    cells(table.trimEnd().split("\n").map((line) => line.split(","))),
    heading("How good it gets"),
    cells(errors),
  );
  // The file names the table that it waits for: it comes under that name where the visitor has none.
  const [name] = plans ? Object.keys(titled) : [];
  offers([[name ?? "postures.csv", table], [ask.file, ask.text]]);
  at("later").hidden = true;
  at("scene").classList.add("away");
  at("outcome").hidden = false;
  at("outcome").scrollIntoView({ behavior: "smooth" });
}

/** Buttons for files to take away. @param {[string, string | Uint8Array][]} made */
function offers(made) {
  const button = ([name, bytes]) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: `Download ${name}` });
    button.onclick = () => saveBlob(new Blob([bytes]), name);
    return button;
  };
  at("downloads").replaceChildren(...made.map(button));
}

// Days after the calibration.

const later = new Later(at("later"), {
  files: present,
  watch: (files, asked) => compute(async () => {
    const { answer } = await bench.ask(files, { watch: { file, text: at("text").value, ...asked } }, progressed);
    later.show(answer);
  }, "unwatched"),
  complain: (what) => complain("unwatched", what),
});

// Measuring, movement by movement.

const dialogue = new Dialogue({
  ask: (files, ask) => bench.ask(files, ask, () => {}, meshes),
  attempt,
  show(scene) {
    at("measure").hidden = false;
    at("outcome").hidden = true;
    const words = "The robot as it is believed to be, and as a ghost the posture to move to.";
    show("measure", words, scene, true);
  },
  async results(found) {
    files = { ...found.files, [found.file]: found.text };
    lent = found.files;
    await begin([found.file]);
    at("robot").scrollIntoView({ behavior: "smooth" });
  },
});

/** Shows a scene in a section. @param {{id: string, bytes: Uint8Array}} scene @param {boolean} [atEnd] its last moment alone */
function show(where, words, { id, bytes }, atEnd = false) {
  at(where).querySelector(".scene").append(at("scene"));
  at("scene").classList.remove("away");
  at("scene").querySelector("figcaption").textContent = words;
  viewer.then((viewer) => viewer.file(id, bytes, atEnd), noScene);
}

// What all of it uses.

/** Whether something came to its end; what is wrong is said in an element. */
async function attempt(where, work) {
  complain(where);
  try {
    await work();
    return true;
  } catch (error) {
    if (error instanceof Stopped) complain(where, "Stopped. Nothing was kept of it.");
    else {
      complain(where, error.message);
      if (!(error instanceof Refused)) console.error(error);
    }
    return false;
  }
}

function complain(where, what = "") {
  at(where).textContent = capital(what);
  at(where).hidden = what === "";
}

const label = (name) => at("form").querySelector(`[data-for="${name}"]`);
/** A sentence with its first word capital, unless that is a name. */
const capital = (text) => text.replace(/^[a-z]+(?=[ ,;]|$)/, (word) => word.slice(0, 1).toUpperCase() + word.slice(1));
const many = (count, one, several) => `${count} ${count === 1 ? one : several}`;
const plural = (count, what) => many(count, what, `${what}s`);
const size = (length) => (length < 10_000 ? `${length} bytes` : `${Math.round(length / 1000)} kB`);
const element = (kind, text) => Object.assign(document.createElement(kind), { textContent: text });
const item = (text) => element("li", text);
const paragraph = (text) => element("p", text);
const heading = (text) => element("h3", text);

/** Fills a list of choices; `none` stands for no choice. */
function choices(select, names, chosen, none) {
  const options = names.map((name) => new Option(name, name, false, name === chosen));
  select.replaceChildren(...(none === undefined ? [] : [new Option(none, "")]), ...options);
}

// The engine first, then the viewer behind it.

const loaded = attempt("problem", async () => {
  const { answer } = await bench.ask({}, { examples: {} });
  at("example").replaceChildren(...answer.map(({ name, title }) => new Option(title, name)));
  at("example").disabled = at("open-example").disabled = false;
  await dialogue.remember();
});
loaded.then(() => (at("waiting").hidden = true));

/** Whether there is no server: the page is one of a folder, which the browser keeps. */
const isFolder = document.documentElement.dataset.source === "engine";

/** The viewer of the scene, loaded once the engine is there. */
const viewer = loaded.then(async () => {
  const { wasm } = await (isFolder ? import("./folder.js") : import("./session.js"));
  const [script, file] = ["viewer-script", "viewer-wasm"].map((id) => at(id).dataset.address);
  return startViewer(at("viewer"), { script, wasm: () => wasm(file) }, () => {});
});
if (isFolder) import("./offline.js").then(({ keep }) => keep());
viewer.catch(noScene).finally(() => (document.body.dataset.state = "ready"));

function noScene(error) {
  console.error(error);
  at("scene").querySelector("figcaption").textContent = `The scene cannot be drawn here: ${error.message}. The recording can be taken away.`;
}
