// The recursion of a bound as WebAssembly (`fmus/c/bound.h`), on the arrays of
// `orchestrator/limits/recursion.py`.

const MARGINAL = 9; // a covariance of a position

export class Bound {
  // module: compiled; task: size of the structure and its fields, [offset, size] by name.
  constructor(module, task) {
    Object.assign(this, { wasm: new WebAssembly.Instance(module, {}).exports, task });
  }

  /**
   * Covariances of one diver's position after the measurements of epochs, NED [m²], 9 numbers each:
   * `absolute` in the world, `relative` to the platform.
   *
   * model: its number; beacons: how many; arrays: by their names in the structure; kept: numbers of the
   * epochs, increasing; default: all.
   */
  covariances(model, beacons, arrays, kept = Array.from(arrays.dt.keys())) {
    const { fields, size } = this.task, { memory } = this.wasm, epochs = arrays.dt.length;
    let end = Math.ceil(this.wasm.__heap_base.value / 8) * 8;
    const take = (bytes) => {
      const at = end;
      end += Math.ceil(bytes / 8) * 8;
      return at;
    };
    const to = take(size), keep = take(4 * kept.length);
    const places = Object.fromEntries(Object.entries(arrays).map(([name, it]) => [name, take(8 * it.length)]));
    const results = Object.fromEntries(
      ["absolute", "relative"].map((name) => [name, take(8 * MARGINAL * kept.length)]));
    const missing = end - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / 65536)); // typed arrays from before end here
    for (const [name, it] of Object.entries(arrays))
      new Float64Array(memory.buffer, places[name], it.length).set(it);
    new Int32Array(memory.buffer, keep, kept.length).set(kept);
    const view = new DataView(memory.buffer, to, size);
    const told = { model, beacons, epochs, divers: 1, kept: kept.length, keep, ...places, ...results };
    for (const [name, [offset]] of Object.entries(fields)) view.setInt32(offset, told[name], true);
    if (this.wasm.sblcosim_bound(1, to))
      throw new Error(`a bound must have a known model and number of beacons, got ${model} and ${beacons}`);
    return Object.fromEntries(Object.entries(results).map(([name, at]) =>
      [name, new Float64Array(memory.buffer, at, MARGINAL * kept.length).slice()]));
  }
}
