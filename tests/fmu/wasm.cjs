// Runs a component's module of WebAssembly: node wasm.cjs MODULE TIMES.json VALUES OUTPUTS
// VALUES: parameters and inputs at the start, then the inputs of each step; OUTPUTS: outputs at the
// start and after each step; doubles, one after another.
const fs = require("fs");
const [file, times, values, outputs] = process.argv.slice(2);
const compiled = new WebAssembly.Module(fs.readFileSync(file));
if (WebAssembly.Module.imports(compiled).length) throw Error("must have no imports");
const wasm = new WebAssembly.Instance(compiled, {}).exports;
const [, , parameters, inputs, count, size] =
  new Uint32Array(wasm.memory.buffer, wasm.sblcosim_lanes(), 6);
const block = Math.ceil(wasm.__heap_base.value / 64) * 64;
wasm.memory.grow(Math.ceil(size / 65536));
const v = new Float64Array(wasm.memory.buffer, block, parameters + inputs + count);
const bytes = fs.readFileSync(values);
const given = new Float64Array(new Uint8Array(bytes).buffer);
const ns = JSON.parse(fs.readFileSync(times)).map(BigInt);
const found = [];
v.set(given.subarray(0, parameters + inputs));
if (wasm.sblcosim_initial(block, ns[0])) throw Error("an interval must be whole nanoseconds");
found.push(...v.subarray(parameters + inputs));
for (let i = 1, at = parameters + inputs; i < ns.length; i++, at += inputs) {
  v.set(given.subarray(at, at + inputs), parameters);
  wasm.sblcosim_step(block, ns[0], ns[i - 1], ns[i]);
  found.push(...v.subarray(parameters + inputs));
}
fs.writeFileSync(outputs, new Uint8Array(new Float64Array(found).buffer));
