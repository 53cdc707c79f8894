// The folder of a page without a server: what it holds, and its WebAssembly.

import { content, wasmOf } from "./packed.js";
import { ProblemError } from "./session.js";

const folder = new URL(".", document.baseURI);
/** The address of a file in it. @param {string} path */
export const at = (path) => new URL(path, folder);

/** A file of it. @param {string} path @returns {Promise<Response>} throws a ProblemError */
export async function get(path) {
  const response = await fetch(at(path));
  if (!response.ok) {
    const problem = { status: response.status, title: "A file is missing", detail: `${path} cannot be read from here` };
    throw new ProblemError(problem);
  }
  return response;
}

/** What the folder holds, read once. */
export const manifest = get("export.json").then((response) => response.json());
// Who asks for it first hears of a failure.
manifest.catch(() => {});

/** Files of WebAssembly that were asked for, and will be asked for again. */
const again = new Map();

/** A file of WebAssembly, as the browser takes it. @param {string} address */
export async function wasm(address) {
  const path = address.split("?")[0];
  const length = (await manifest).unpacked[path] ?? 0;
  // The viewer's is fetched to show how far it is, and then to be used: hosts that let nothing be kept send it once.
  const [now, later] = again.get(address) ?? (await content(await get(address))).tee();
  if (later === undefined) again.delete(address);
  else again.set(address, [later]);
  return wasmOf(now, length);
}
