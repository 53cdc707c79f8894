// Files that are kept compressed: they are unpacked here, since not every host says that they are.

/** How compressed files begin. Some hosts unpack them on the way, so that the content decides and not the name. */
const GZIP = [0x1f, 0x8b];

/** The content of an answer, unpacked if it is compressed. @param {Response} response @returns {Promise<ReadableStream>} */
export async function content(response) {
  const reader = response.body.getReader();
  const first = await reader.read();
  const whole = new ReadableStream({
    start: (out) => (first.done ? out.close() : out.enqueue(first.value)),
    async pull(out) {
      const { done, value } = await reader.read();
      if (done) out.close();
      else out.enqueue(value);
    },
    cancel: (reason) => reader.cancel(reason),
  });
  const packed = !first.done && GZIP.every((byte, index) => first.value[index] === byte);
  return packed ? whole.pipeThrough(new DecompressionStream("gzip")) : whole;
}

/** A file, as the host has it. @param {string} address @returns {Promise<Response>} */
async function read(address) {
  const response = await fetch(address);
  if (!response.ok) throw new Error(`${address} cannot be read (${response.status})`);
  return response;
}

/** A file of text. @param {string} address */
export const text = async (address) => (await read(address)).text();

/** A file of WebAssembly, as the browser takes it. @param {string} address @param {number} [bytes] its size once unpacked */
export async function unpacked(address, bytes = 0) {
  return wasmOf(await content(await read(address)), bytes);
}

/** A file of bytes. @param {string} address @returns {Promise<Uint8Array>} */
export async function bytes(address) {
  return new Uint8Array(await new Response(await content(await read(address))).arrayBuffer());
}

/** Meshes of the robots that ship; none where they cannot be had: capsules stand for them. @param {string} address */
export async function meshes(address) {
  try {
    return await bytes(address);
  } catch (error) {
    console.warn(error);
    return new Uint8Array();
  }
}

/** WebAssembly as an answer of a host that knows it. @param {ReadableStream} stream @param {number} bytes */
export function wasmOf(stream, bytes) {
  return new Response(stream, { headers: { "Content-Type": "application/wasm", "Uncompressed-Length": String(bytes) } });
}
