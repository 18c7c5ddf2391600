// Runs the settings module on many settings: node settings.cjs MODULE KEYS VALUES
// KEYS and VALUES: doubles, the inputs and the results of each of them, one after another.
const fs = require("fs");
const [file, keys, values] = process.argv.slice(2);
const compiled = new WebAssembly.Module(fs.readFileSync(file));
if (WebAssembly.Module.imports(compiled).length) throw Error("must have no imports");
const wasm = new WebAssembly.Instance(compiled, {}).exports;
const count = wasm.sblcosim_keys();
const input = Math.ceil(wasm.__heap_base.value / 8) * 8;
const output = input + 8 * count;
wasm.memory.grow(2);
const given = new Float64Array(new Uint8Array(fs.readFileSync(keys)).buffer);
const found = [];
for (let at = 0; at < given.length; at += count) {
  new Float64Array(wasm.memory.buffer, input, count).set(given.subarray(at, at + count));
  const length = wasm.sblcosim_start_values(input, output);
  found.push(Buffer.from(wasm.memory.buffer.slice(output, output + 8 * length)));
}
fs.writeFileSync(values, Buffer.concat(found));
