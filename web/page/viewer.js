// Rerun's viewer: its loading, and what it is fed.

/** The timeline of every recording. */
const TIMELINE = "step";
/** Length of the header that must stand before every message, bytes. */
const HEADER_BYTES = 12;
/** How long parts are gathered, ms. */
const GATHER_MS = 10;
/** So long after a seek, its echo may still come, ms. */
const ECHO_MS = 3000;

/**
 * Loads the viewer's WebAssembly and starts it on a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {{script: string, wasm: () => Promise<Response>}} addresses the script's, and what fetches the WebAssembly
 * @param {(fraction: number | null) => void} progress null where the size is not known
 * @param {(step: number) => void} scrubbed hears where the visitor moves the time to
 * @returns {Promise<Viewer>}
 */
export async function startViewer(canvas, addresses, progress, scrubbed) {
  keepToThisHost();
  await Promise.all([loadScript(addresses.script), load(addresses.wasm, progress)]);
  // `wasm_bindgen` is what the script defines. Browsers keep what they have compiled only if they get the response as it
  // came, so it is asked for once more: from the browser's cache.
  await wasm_bindgen({ module_or_path: addresses.wasm() });
  let viewer = null;
  const handle = new wasm_bindgen.WebHandle({
    on_viewer_event: (json) => viewer?.hear(JSON.parse(json)),
    url: [],
    hide_welcome_screen: true,
    enable_history: false,
    notebook: false,
    persist: false,
  });
  await handle.start(canvas);
  for (const panel of ["top", "blueprint", "selection", "time"]) handle.override_panel_state(panel, "hidden");
  viewer = new Viewer(handle, scrubbed);
  return viewer;
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

/** A running viewer that shows one recording at a time. */
export class Viewer {
  #handle;
  #channel = null;
  #header = null;
  /** Parts that wait to be sent together. */
  #parts = [];
  #timer = 0;
  /** The step to be at, and those who wait for it. */
  #step = 0;
  #waiting = [];
  #seeking = false;
  #check = 0;
  #scrubbed;
  /** When which step was sought: the viewer tells of these too. */
  #sought = new Map();

  constructor(handle, scrubbed) {
    this.#handle = handle;
    this.#scrubbed = scrubbed;
  }

  /** Takes in an event of the viewer's. @param {{type: string, time?: number}} event */
  hear(event) {
    if (event.type !== "time_update" || this.#channel === null || this.#seeking || this.#sought.size === 0) return;
    const step = Math.round(event.time);
    if (step === this.#step || step < 0) return;
    const echo = performance.now() - (this.#sought.get(step) ?? -Infinity) < ECHO_MS;
    if (!echo) return this.#scrubbed(step);
    // An echo comes once. Was it the visitor after all, the viewer stays where it is.
    this.#sought.delete(step);
    this.#check ||= setTimeout(() => this.#compare(), ECHO_MS);
  }

  /** Tells where the viewer is, if it is not where it was sent. */
  #compare() {
    this.#check = 0;
    if (this.#channel === null || this.#seeking) return;
    const time = this.#handle.get_time_for_timeline(this.#channel, TIMELINE);
    if (time !== undefined && Math.round(time) !== this.#step) this.#scrubbed(Math.round(time));
  }

  /** Begins a recording. @param {string} id its recording id */
  open(id) {
    this.close();
    this.#channel = id;
    this.#handle.open_channel(id, id);
  }

  /** Ends the recording; what was shown stays. */
  close() {
    clearTimeout(this.#timer);
    clearTimeout(this.#check);
    if (this.#channel !== null) this.#handle.close_channel(this.#channel);
    this.#channel = this.#header = null;
    [this.#parts, this.#timer, this.#check, this.#step] = [[], 0, 0, 0];
    this.#sought.clear();
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
    this.#timer ||= setTimeout(() => this.#send(), GATHER_MS);
  }

  #send() {
    this.#timer = 0;
    const parts = [this.#header, ...this.#parts.splice(0)];
    const message = new Uint8Array(parts.reduce((length, part) => length + part.byteLength, 0));
    let length = 0;
    for (const part of parts) {
      message.set(new Uint8Array(part), length);
      length += part.byteLength;
    }
    this.#handle.send_rrd_to_channel(this.#channel, message);
  }

  /**
   * Goes to a step as soon as the viewer has taken it in, which may be some frames later.
   * @param {number} step
   * @returns {Promise<void>} resolves when the viewer is there, or when it shows another recording
   */
  seek(step) {
    this.#step = step;
    if (!this.#seeking) {
      this.#seeking = true;
      requestAnimationFrame(() => this.#follow());
    }
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  #follow() {
    const id = this.#channel;
    const newest = id === null ? undefined : this.#handle.get_timeline_time_range(id, TIMELINE)?.max;
    if (newest !== undefined) {
      this.#handle.set_active_recording_id(id);
      this.#handle.set_playing(id, false);
      const time = Math.min(this.#step, newest);
      this.#sought.delete(time);
      this.#sought.set(time, performance.now());
      // The oldest have long been heard of.
      if (this.#sought.size > 100) this.#sought.delete(this.#sought.keys().next().value);
      this.#handle.set_time_for_timeline(id, TIMELINE, time);
    }
    this.#seeking = id !== null && !(newest >= this.#step);
    if (this.#seeking) requestAnimationFrame(() => this.#follow());
    else this.#wake();
  }

  #wake() {
    this.#waiting.splice(0).forEach((resolve) => resolve());
  }

  /** Why the viewer has crashed, or null. */
  failure() {
    return this.#handle.has_panicked() ? (this.#handle.panic_message() ?? "no message") : null;
  }
}
