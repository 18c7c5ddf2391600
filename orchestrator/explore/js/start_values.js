// From the keys of a scenario to the start values of its components, with the settings module.

import { ratesOf } from "./boat.js";

const HEADINGS = "platform.track_heading"; // the module has room for one: see `docs/reference/start-values.md`

/** The settings module for a number of beacons. */
export class Settings {
  // bytes: of the module; described: `orchestrator/scenario/settings.py` says what it has.
  static async load(bytes, described) {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Settings(instance.exports, described);
  }

  constructor(wasm, described) {
    Object.assign(this, described);
    this.wasm = wasm;
    this.optional = new Set(described.optional);
    this.count = 1 + Object.values(described.values).reduce(
      (most, places) => places.reduce((a, b) => Math.max(a, b), most), 0);
    this.input = Math.ceil(wasm.__heap_base.value / 8) * 8;
    this.output = this.input + 8 * described.keys.length;
    const missing = this.output + 8 * 4 * this.count - wasm.memory.buffer.byteLength;
    if (missing > 0) wasm.memory.grow(Math.ceil(missing / 65536));
  }

  /**
   * Start values of all parameters that are computed: a function from a parameter
   * ("coupled.gps_std") to its elements.
   *
   * values, given: of the keys, by path; numberOf: number of a name of a key.
   */
  computed(values, given, numberOf) {
    const moving = ratesOf((path) => values.get(path));
    const inputs = this.keys.map((name) => {
      if (name in moving) return moving[name];
      const [path, rest] = name.split("[");
      if (this.optional.has(path) && !given.has(path)) return NaN;
      const value = values.has(path) ? values.get(path) : numberOf.start(path);
      const element = rest === undefined ? value : value[placeOf(rest, numberOf.columns(path))] ?? 0;
      return typeof element === "number" ? element : numberOf(path, element);
    });
    new Float64Array(this.wasm.memory.buffer, this.input, inputs.length).set(inputs);
    this.wasm.sblcosim_start_values(this.input, this.output);
    const found = new Float64Array(this.wasm.memory.buffer, this.output, this.count).slice();
    const headings = values.get(`${HEADINGS}_deg`).map((it) => it * (Math.PI / 180));
    return (parameter) => parameter === HEADINGS ? headings
      : this.values[parameter]?.map((place) => found[place]);
  }
}

function placeOf(text, columns) {
  const [row, column] = text.replace("]", "").split(",").map(Number);
  return column === undefined ? row - 1 : (row - 1) * columns + column - 1;
}
