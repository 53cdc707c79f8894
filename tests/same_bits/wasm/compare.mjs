// Runs the module and compares what it says with what the native program has written.
//
//     node compare.mjs MODULE.wasm FOLDER

import { readFileSync } from "node:fs";

const [module, folder] = process.argv.slice(2);
const names = ["arm-6dof", "arm-12dof", "head-fov", "body-change", "arm-6dof-camera", "arm-7dof-socket", "arm-6dof-outliers", "panda-sockets"];
// Clocks are asked for, and have no bearing on what is compared.
const anything = new Proxy({}, { get: () => () => 0 });
const imports = new Proxy({}, { get: () => anything });
const { instance } = await WebAssembly.instantiate(readFileSync(module), imports);
let differ = 0;
names.forEach((name, index) => {
  const start = instance.exports.run(index);
  const memory = instance.exports.memory.buffer;
  const length = new DataView(memory).getUint32(start, true);
  const found = Buffer.from(memory, start + 4, length);
  const expected = readFileSync(`${folder}/${name}.json`);
  const same = found.equals(expected);
  differ += same ? 0 : 1;
  console.log(`${name}: ${same ? "the same" : "OTHER"}, ${length} bytes`);
  if (!same) {
    const first = found.findIndex((byte, at) => byte !== expected[at]);
    const around = (text) => text.subarray(Math.max(0, first - 120), first + 40).toString();
    console.log(`  here    ${around(found)}\n  native  ${around(expected)}`);
  }
});
process.exit(differ === 0 ? 0 : 1);
