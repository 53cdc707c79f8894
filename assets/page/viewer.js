// Rerun's viewer: its loading, and what it is fed.

import { CUT } from "./scene.js";

/** The timeline of postures, and so many ticks of it from one step to the next. */
const MOTION = "motion";
const TICKS = 32;
/** The timeline that tells up to which step the viewer has everything. */
const COMPLETE = "complete";
/** Length of the header that must stand before every message, bytes. */
export const HEADER_BYTES = 12;
/** How long parts are gathered, ms. */
const GATHER_MS = 10;
/** The first parts wait at most so long for the first step that is to be shown, ms. */
const HOLD_MS = 1000;
/** A movement takes this part of the time since the last one, within these limits, ms. */
const GLIDE = { part: 0.6, least: 140, most: 700 };
/** As long as a step is missing the viewer is made to draw so often, ms. */
const NUDGED_EVERY = 250;
/** So many frames after another arrangement, the time is set again: the viewer takes it from there. */
const UNSETTLED = 20;
/** The camera is set anew where the shape of the view has changed by so much. */
const RESHAPED = 1.25;
/** How long the shape must have stayed, ms. */
const RESHAPED_MS = 300;
/** Without a graphics card, the scene is drawn at this part of the screen's resolution while it plays. */
const COARSE = 0.4;

/**
 * Loads the viewer's WebAssembly and starts it on a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {{script: string, wasm: () => Promise<Response>}} addresses the script's, and what fetches the WebAssembly
 * @param {(fraction: number | null) => void} progress null where the size is not known
 * @param {Promise<void>} [turn] when it may take the processor, which it does for seconds
 * @returns {Promise<Viewer>}
 */
export async function startViewer(canvas, addresses, progress, turn = Promise.resolve()) {
  keepToThisHost();
  await Promise.all([loadScript(addresses.script), load(addresses.wasm, progress)]);
  await turn;
  // `wasm_bindgen` is what the script defines. Browsers keep what they have compiled only if they get the response as it
  // came, so it is asked for once more: from the browser's cache.
  const resolution = new Resolution(canvas);
  await resolution.between(() => wasm_bindgen({ module_or_path: addresses.wasm() }));
  const handle = new wasm_bindgen.WebHandle({
    url: [],
    hide_welcome_screen: true,
    enable_history: false,
    notebook: false,
    persist: false,
  });
  await handle.start(canvas);
  for (const panel of ["top", "blueprint", "selection", "time"]) handle.override_panel_state(panel, "hidden");
  return new Viewer(handle, canvas, resolution);
}

/**
 * Answers the viewer's calls to its makers' telemetry with nothing. The content security policy would refuse them too,
 * with an error in the console each time.
 */
function keepToThisHost() {
  const fetchAnything = window.fetch.bind(window);
  window.fetch = (resource, options) => {
    const address = new URL(resource instanceof Request ? resource.url : resource, location.href);
    if (address.origin === location.origin) return fetchAnything(resource, options);
    return Promise.resolve(new Response("", { status: 200 }));
  };
}

/** @param {string} address */
function loadScript(address) {
  return new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = address;
    script.onload = resolve;
    script.onerror = () => reject(new Error("the viewer's script could not be loaded"));
    document.head.append(script);
  });
}

/**
 * Brings a file into the browser's cache.
 * @param {() => Promise<Response>} fetched
 * @param {(fraction: number | null) => void} progress
 */
async function load(fetched, progress) {
  const response = await fetched();
  if (!response.ok) throw new Error(`the viewer could not be loaded (${response.status})`);
  const total = Number(response.headers.get("uncompressed-length"));
  let loaded = 0;
  for (const reader = response.body.getReader(); ; ) {
    const { done, value } = await reader.read();
    if (done) return;
    loaded += value.byteLength;
    progress(total ? Math.min(loaded / total, 1) : null);
  }
}

/** The resolution of the scene: what software draws takes its time by the pixels. */
class Resolution {
  #canvas;
  #scale = 1;
  #isSlow;

  /** @param {HTMLCanvasElement} canvas the viewer's */
  constructor(canvas) {
    this.#canvas = canvas;
    this.#isSlow = drawsInSoftware();
  }

  /**
   * Stands between the viewer and what it asks the browser of the screen, so that pixels can be larger for it alone.
   * @param {() => Promise<unknown>} load instantiates the viewer
   */
  async between(load) {
    if (!this.#isSlow) return load();
    const { instantiateStreaming } = WebAssembly;
    WebAssembly.instantiateStreaming = (source, modules) => {
      for (const imports of Object.values(modules)) this.#scaleIn(imports);
      return instantiateStreaming.call(WebAssembly, source, modules);
    };
    try {
      return await load();
    } finally {
      WebAssembly.instantiateStreaming = instantiateStreaming;
    }
  }

  /** The screen's pixels per CSS pixel, and the canvas's size in them. */
  #scaleIn(imports) {
    for (const [name, ask] of Object.entries(imports)) {
      if (/^__wbg_(devicePixelRatio|inlineSize|blockSize)_/.test(name)) imports[name] = (of) => ask(of) * this.#scale;
    }
  }

  /** Chooses the resolution: coarse while the scene plays, if software draws it. @param {boolean} plays */
  choose(plays) {
    const scale = plays && this.#isSlow ? COARSE : 1;
    if (scale === this.#scale) return;
    this.#scale = scale;
    // The viewer looks at its size only when that changes: by one pixel, behind the lower edge.
    this.#canvas.style.height = scale === 1 ? "" : `calc(100% + ${CUT + 1}px)`;
  }
}

/** Whether there is no graphics card to draw with, as far as the browser tells. */
export function drawsInSoftware() {
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

/** A running viewer that shows one recording at a time. */
export class Viewer {
  #handle;
  #canvas;
  #resolution;
  #channel = null;
  #header = null;
  /** Parts that wait to be sent together, and whether they wait for the first step to be shown. */
  #parts = [];
  #timer = 0;
  #held = true;
  /** Asks for an arrangement of views; the shape for which the last one was made. */
  #arrange = null;
  #aspect = 1;
  /** The learner that is shown alone, or null for all. */
  #alone = null;
  /** Whether that was sent behind the recording's own, which comes with the first step. */
  #arranged = false;
  #reshaping = 0;
  /** The step to be at, and those who wait for it. */
  #step = 0;
  #waiting = [];
  #following = false;
  #unsettled = 0;
  /** The tick that is shown; when the last movement began, and the one that is shown now. */
  #tick = 0;
  #moved = -Infinity;
  #glide = null;
  /** When it was last made to draw, since something is missing. */
  #nudged = -Infinity;
  #begins;
  #begun = new Promise((resolve) => (this.#begins = resolve));

  constructor(handle, canvas, resolution) {
    this.#handle = handle;
    this.#canvas = canvas;
    this.#resolution = resolution;
    new ResizeObserver(() => this.#reshape()).observe(canvas);
  }

  /**
   * Begins a recording.
   * @param {string} id its recording id
   * @param {(view: {theme: string, aspect: number, alone: string | null}) => Promise<ArrayBuffer>} arrange asks for an arrangement of its views
   */
  open(id, arrange) {
    this.close();
    this.#channel = id;
    this.#arrange = arrange;
    this.#handle.open_channel(id, id);
    this.#timer = setTimeout(() => this.#release(), HOLD_MS);
  }

  /** Ends the recording; what was shown stays. */
  close() {
    clearTimeout(this.#timer);
    if (this.#channel !== null) this.#handle.close_channel(this.#channel);
    this.#channel = this.#header = this.#arrange = this.#glide = null;
    [this.#parts, this.#timer, this.#held, this.#step, this.#tick] = [[], 0, true, 0, 0];
    this.#arranged = false;
    this.#wake();
  }

  /** Shows one part of the recording; part 0 is the header. @param {ArrayBuffer} part */
  feed(part) {
    if (this.#header === null) {
      this.#header = part.slice(0, HEADER_BYTES);
      return;
    }
    this.#parts.push(part);
    // Parts come in dozens: one header for all that are there.
    if (!this.#held) this.#timer ||= setTimeout(() => this.#send(), GATHER_MS);
  }

  #send() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    if (this.#header === null || this.#parts.length === 0) return;
    const parts = [this.#header, ...this.#parts.splice(0)];
    const message = new Uint8Array(parts.reduce((length, part) => length + part.byteLength, 0));
    let length = 0;
    for (const part of parts) {
      message.set(new Uint8Array(part), length);
      length += part.byteLength;
    }
    this.#handle.send_rrd_to_channel(this.#channel, message);
  }

  /** Sends the first parts, with the arrangement for this page behind the one that they hold: neither is seen alone. */
  async #release() {
    const id = this.#channel;
    this.#held = false;
    clearTimeout(this.#timer);
    // Not 0: nothing is to be sent before.
    this.#timer = -1;
    await this.restore();
    if (id === this.#channel) this.#send();
  }

  /** Arranges the views and the camera as they were at first, for the present shape and colours. */
  async restore() {
    const id = this.#channel;
    if (id === null) return;
    this.#aspect = this.#shape();
    const theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    // Without it there is the arrangement that the recording holds.
    const bytes = await this.#arrange({ theme, aspect: this.#aspect, alone: this.#alone }).catch(() => null);
    if (id !== this.#channel || bytes === null) return;
    this.#parts.push(bytes.slice(HEADER_BYTES));
    this.#send();
    this.#unsettled = UNSETTLED;
    this.#run();
  }

  /** Shows one learner alone, or all. @param {string | null} learner its name */
  show(learner) {
    if (learner === this.#alone) return;
    this.#alone = learner;
    if (!this.#held) this.restore();
  }

  /** Width of the view in heights, as far as it is seen. */
  #shape() {
    const { clientWidth, clientHeight } = this.#canvas;
    return clientWidth > 0 && clientHeight > CUT ? clientWidth / (clientHeight - CUT) : 1;
  }

  #reshape() {
    clearTimeout(this.#reshaping);
    this.#reshaping = setTimeout(() => {
      const change = this.#shape() / this.#aspect;
      if (!this.#held && Math.max(change, 1 / change) > RESHAPED) this.restore();
    }, RESHAPED_MS);
  }

  /**
   * Goes to a step as soon as the viewer has all of it, which may be some frames later.
   * @param {number} step
   * @param {boolean} glides whether the recording holds postures on the way to it, to be shown if it is the next
   * @returns {Promise<void>} resolves when the viewer is there, or when it shows another recording
   */
  seek(step, glides = false) {
    if (this.#held) this.#release();
    const now = performance.now();
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const duration = Math.min(Math.max(GLIDE.part * (now - this.#moved), GLIDE.least), GLIDE.most);
    const isNext = this.#tick === (step - 1) * TICKS;
    this.#glide = glides && isNext && !still ? { duration, began: null } : null;
    [this.#step, this.#moved] = [step, now];
    this.#run();
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  #run() {
    if (this.#following) return;
    this.#following = true;
    requestAnimationFrame((now) => this.#follow(now));
  }

  #follow(now) {
    this.#following = false;
    const id = this.#channel;
    if (id === null) return this.#wake();
    const newest = this.#handle.get_timeline_time_range(id, COMPLETE)?.max;
    const isThere = newest >= this.#step;
    if (newest !== undefined && !this.#arranged) {
      this.#arranged = true;
      this.restore();
    }
    if (isThere) this.#show(this.#ticks(now));
    else if (newest !== undefined && this.#glide === null) this.#show(newest * TICKS);
    if (isThere && this.#glide === null) this.#wake();
    // What came by the channel is taken up when the viewer draws, which it does not always do for that alone.
    if (!isThere && now - this.#nudged > NUDGED_EVERY) {
      this.#nudged = now;
      this.redraw();
    }
    if (!isThere || this.#glide !== null || this.#unsettled-- > 0) this.#run();
  }

  /** Where the movement is by now. */
  #ticks(now) {
    const end = this.#step * TICKS;
    if (this.#glide === null) return end;
    this.#glide.began ??= now;
    const way = (now - this.#glide.began) / this.#glide.duration;
    if (way < 1) return end - TICKS + Math.floor(way * TICKS);
    this.#glide = null;
    return end;
  }

  #show(tick) {
    const [handle, id] = [this.#handle, this.#channel];
    if (handle.get_active_recording_id() !== id) handle.set_active_recording_id(id);
    if (handle.get_active_timeline(id) !== MOTION) handle.set_active_timeline(id, MOTION);
    if (handle.get_playing(id)) handle.set_playing(id, false);
    if (handle.get_time_for_timeline(id, MOTION) !== tick) handle.set_time_for_timeline(id, MOTION, tick);
    this.#tick = tick;
    this.#begins();
  }

  /** Until a whole step is shown, be it another than the one that is sought. @returns {Promise<void>} */
  begun() {
    return this.#begun;
  }

  /** The step that is shown, or the one on the way to which it is. */
  get step() {
    return Math.ceil(this.#tick / TICKS);
  }

  #wake() {
    this.#waiting.splice(0).forEach((resolve) => resolve());
  }

  /** Draws in the next frame, though nothing has changed: whatever happens to the pointer has the viewer do so. */
  redraw() {
    this.#canvas.dispatchEvent(new MouseEvent("mouseleave"));
  }

  /** Tells whether steps follow one another by themselves. @param {boolean} plays */
  playing(plays) {
    this.#resolution.choose(plays);
  }

  /**
   * Shows a whole recording as it is arranged.
   * @param {string} id the recording's
   * @param {Uint8Array} bytes
   * @param {boolean} [atEnd] its last moment alone; else there is a bar to go through it
   */
  file(id, bytes, atEnd = false) {
    this.close();
    const handle = this.#handle;
    handle.open_channel(id, id);
    handle.send_rrd_to_channel(id, bytes);
    handle.close_channel(id);
    handle.override_panel_state("time", atEnd ? "hidden" : "collapsed");
    const timeline = atEnd ? MOTION : "step";
    const show = () => {
      const range = handle.get_timeline_time_range(id, timeline);
      if (!range) return requestAnimationFrame(show);
      handle.set_active_recording_id(id);
      handle.set_active_timeline(id, timeline);
      handle.set_playing(id, false);
      handle.set_time_for_timeline(id, timeline, atEnd ? range.max : range.min);
    };
    show();
  }

  /** Why the viewer has crashed, or null. */
  failure() {
    return this.#handle.has_panicked() ? (this.#handle.panic_message() ?? "no message") : null;
  }
}
