// Whether the browser has what the engine needs.

/** A module of WebAssembly that does nothing, with an instruction that not every browser has: v128.const and a drop. */
const SIMD = Uint8Array.of(
  0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 10, 23, 1, 21, 0, 253, 12,
  0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 26, 11,
);

/** Whether it knows SIMD in WebAssembly. */
export const simd = () => WebAssembly.validate(SIMD);
