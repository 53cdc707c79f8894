// The worker that calibrates. Whoever has it may end it at any time: each request brings all that it is about.

/** The engine, once its WebAssembly runs. */
let engine = null;
/** The stage of the work, and how many of its steps are made; when that was told last. */
let [what, steps, made, told] = ["", 0, 0, 0];

/** So long between two words of progress, ms. */
const QUIET_MS = 60;

// What the engine calls as it goes on.
globalThis.stage = (name, of) => {
  [what, steps, made] = [name, of, 0];
  tell();
};
globalThis.tick = () => {
  made++;
  if (performance.now() - told > QUIET_MS) tell();
};

function tell() {
  told = performance.now();
  postMessage({ progress: { what, steps, made } });
}

onmessage = async ({ data: { begin, number, request, meshes } }) => {
  try {
    if (begin !== undefined) {
      const script = await import(begin.script);
      await script.default({ module_or_path: begin.module });
      script.bring_meshes(begin.shapes);
      engine = new script.Bench();
      return postMessage({ ready: true });
    }
    const { status, body, recording } = engine.work(new TextEncoder().encode(request), Object.keys(meshes), Object.values(meshes));
    const buffers = [body.buffer, ...(recording ? [recording.buffer] : [])];
    postMessage({ number, status, body, recording }, buffers);
  } catch (error) {
    postMessage({ number, failure: String(error.message ?? error) });
  }
};
