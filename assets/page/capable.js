// Whether the browser has what the engine needs.

/** A module of WebAssembly that does nothing, with an instruction that not every browser has: v128.const and a drop. */
const SIMD = Uint8Array.of(
  0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 10, 23, 1, 21, 0, 253, 12,
  0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 26, 11,
);

/** The address of a file, by the id of the element that has it. @param {string} id */
export const address = (id) => new URL(document.getElementById(id).dataset.address, document.baseURI).href;

/** A worker that is a module. @param {string} address @returns {Worker} throws a sentence on a browser that lacks what it needs */
export function engineWorker(address) {
  if (!WebAssembly.validate(SIMD)) throw new Error("this browser knows no SIMD in WebAssembly, which the engine needs");
  let knowsModules = false;
  const kind = { get type() { return (knowsModules = true) && "module"; } };
  const worker = new Worker(address, kind);
  if (knowsModules) return worker;
  worker.terminate();
  throw new Error("this browser knows no module workers, which hold the engine");
}
