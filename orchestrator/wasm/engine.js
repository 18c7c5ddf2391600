// Runs whole simulations: modules and plans of the lanes master, here or in workers. It needs
// nothing but WebAssembly, and works in browsers and in node. The README of this folder says what
// modules and plans hold.

const GROUPS = 16; // groups of runs in a call
const TICKS = 1000; // of a replay in a call
const PAGE = 65536;
const AGAIN = 2; // times that a part is done again at a place after its worker has ended
const PATIENCE = 10_000; // ms
const PACE = 0.001; // ms for a step of a component, until it is measured
const SLOWER = 10, FORGET = 0.9, STEPS = 10;

/** A plan: its description (parsed JSON) and its numbers (an ArrayBuffer). */
export class Plan {
  constructor(description, content) {
    Object.assign(this, description, { content });
  }

  /** The initial parameters and inputs of a component, by its number; they may be changed. */
  start(component) {
    const [at, size] = this.components[component].start;
    return new Float64Array(this.content, at, size / 8);
  }

  /** Set a parameter before the start: `set("acoustics.range_std", [0.3])`. */
  set(name, values) {
    const [owner, parameter] = name.split(".");
    const component = this.components.findIndex((it) => it.name === owner);
    const element = this.components[component]?.parameters[parameter];
    if (element === undefined) throw new Error(`${name}: must be a parameter of the plan`);
    this.start(component).set(values, element);
  }

  /** The times of all instants [ns], 64-bit integers; the start first. */
  get instants() {
    const [at, size] = this.arrays.instants_ns;
    return new BigInt64Array(this.content, at, size / 8);
  }
}

/** A module, for one number of beacons and of lanes. */
export class Engine {
  /** Compile a module from its bytes. */
  static async load(bytes) {
    return new Engine(await WebAssembly.compile(bytes));
  }

  constructor(module) {
    const [description] = WebAssembly.Module.customSections(module, "sblcosim");
    Object.assign(this, JSON.parse(new TextDecoder().decode(description)));
    this.module = module;
    this.wasm = new WebAssembly.Instance(module, {}).exports;
  }

  /**
   * Run a plan once for each seed.
   *
   * Returns, by receiver, in the order of the seeds: `sums` (runs, this.sums.length), and `order`
   * (runs, this.lengths.length, percentages): percentiles of the lengths of the errors [m], NaN
   * without an estimate. An Error says which parameter does not fit.
   */
  run(plan, seeds, percentages = []) {
    const groups = Math.min(GROUPS, Math.ceil(seeds.length / this.lanes));
    const place = this.#lay(plan, groups, percentages, false);
    const { lanes } = this, receivers = plan.receivers.length;
    const made = (size) => Object.fromEntries(
      plan.receivers.map((name) => [name, new Float64Array(seeds.length * size)]));
    const sizes = [this.sums.length, this.lengths.length * percentages.length];
    const [sums, order] = sizes.map(made);
    for (let first = 0; first < seeds.length; first += groups * lanes) {
      const count = Math.min(groups, Math.ceil((seeds.length - first) / lanes));
      this.#drive(plan, place, seeds.slice(first, first + count * lanes), count);
      for (let run = 0; run < count * lanes && first + run < seeds.length; run++) {
        const group = Math.floor(run / lanes), lane = run % lanes;
        plan.receivers.forEach((name, r) => {
          const at = (size, i) => ((group * receivers + r) * size + i) * lanes + lane;
          for (let i = 0; i < sizes[0]; i++)
            sums[name][(first + run) * sizes[0] + i] = place.sums[at(sizes[0], i)];
          percentages.forEach((_, p) => this.lengths.forEach((_, l) => {
            const to = ((first + run) * this.lengths.length + l) * percentages.length + p;
            order[name][to] = place.order[at(sizes[1], p * this.lengths.length + l)];
          }));
        });
      }
    }
    return { sums, order };
  }

  /** The record of one run: by name, the values at all instants, (instants, ...shape). */
  record(plan, seed) {
    const place = this.#lay(plan, 1, [], true);
    this.#drive(plan, place, [seed], 1);
    const n = plan.numbers.n_instants, found = {};
    let from = 0;
    for (const { name, shape } of plan.record) {
      const size = shape.reduce((a, b) => a * b, 1), values = new Float64Array(n * size);
      for (let k = 0; k < values.length; k++) {
        const element = Math.floor(k / size) * place.width + from + (k % size);
        values[k] = place.record[element * this.lanes];
      }
      found[name] = values;
      from += size;
    }
    return found;
  }

  /**
   * Give recorded inputs to one component: `orchestrator/simulation/masters/replay.py`.
   *
   * type: of the component; start: its parameters and inputs before the start. start_ns, interval:
   * BigInt [ns]; ticks: BigInt64Array [ns], the start plus multiples of the interval. columns: for
   * each input element, its number among all values of the component and its values at the ticks.
   * spans: for each output, its first element and their number. Returns the values of each output
   * one interval after each tick, (ticks, elements).
   */
  replay({ type, start, startNs, interval, ticks, columns, spans }) {
    const { lanes } = this, { memory } = this.wasm, engine = this.#engine(type);
    const before = engine.parameters + engine.inputs, width = columns.length;
    const each = spans.reduce((sum, [, size]) => sum + size, 0);
    const sizes = {
      plan: this.structures.replay.size, block: engine.block_size, values: before * lanes * 8,
      ticks_ns: TICKS * 8, inputs: TICKS * width * 8, wanted: TICKS * 8, places: width * 4,
      spans: spans.length * 8, record: TICKS * each * lanes * 8,
    };
    let end = this.wasm.__heap_base.value;
    const at = Object.fromEntries(Object.entries(sizes).map(([name, bytes]) => {
      const place = Math.ceil(end / 64) * 64;
      end = place + bytes;
      return [name, place];
    }));
    const more = Math.ceil((end - memory.buffer.byteLength) / PAGE);
    if (more > 0) memory.grow(more); // typed arrays from before end here
    const view = (Kind, name, size) => new Kind(memory.buffer, at[name], size);
    view(Int32Array, "places", width).set(columns.map(([element]) => element - engine.parameters));
    view(Int32Array, "spans", 2 * spans.length).set(
      spans.flatMap(([first, size]) => [first - before, size]));
    view(BigInt64Array, "wanted", TICKS).set(Array.from({ length: TICKS }, (_, i) => BigInt(i)));
    const values = view(Float64Array, "values", before * lanes);
    for (let i = 0; i < before; i++) values.fill(start[i], i * lanes, (i + 1) * lanes);
    this.#write("replay", at.plan, {
      ...at, engine: engine.at, start_ns: startNs, interval_ns: interval, n_wanted: TICKS, width,
      n_spans: spans.length,
    });
    const status = Number(this.wasm.sblcosim_replay_start(at.plan, at.block, at.values));
    if (status) throw new Error(`${type}: parameter ${status - 1} must be a valid interval`);
    const found = spans.map(([, size]) => new Float64Array(ticks.length * size));
    const inputs = view(Float64Array, "inputs", TICKS * width);
    const record = view(Float64Array, "record", TICKS * each * lanes);
    for (let first = 0; first < ticks.length; first += TICKS) {
      const count = Math.min(TICKS, ticks.length - first);
      view(BigInt64Array, "ticks_ns", count).set(ticks.subarray(first, first + count));
      columns.forEach(([, column], i) => {
        for (let row = 0; row < count; row++) inputs[row * width + i] = column[first + row];
      });
      this.wasm.sblcosim_replay_ticks(at.plan, at.block, 0n, BigInt(count), 0n, at.record);
      let from = 0;
      spans.forEach(([, size], k) => {
        for (let row = 0; row < count; row++)
          for (let i = 0; i < size; i++)
            found[k][(first + row) * size + i] = record[(row * each + from + i) * lanes];
        from += size;
      });
    }
    return found;
  }

  /** Write a plan to the memory, with room for a number of groups. */
  #lay(plan, groups, percentages, recorded) {
    if (plan.beacons !== this.beacons)
      throw new Error(`the plan must be for ${this.beacons} beacons, got ${plan.beacons}`);
    const { lanes } = this, memory = this.wasm.memory;
    let end = this.wasm.__heap_base.value;
    const take = (bytes) => {
      const at = Math.ceil(end / 64) * 64;
      end = at + bytes;
      return at;
    };
    const engines = plan.components.map(({ type }) => this.#engine(type));
    const count = engines.length, receivers = plan.receivers.length;
    const width = plan.record.reduce((sum, it) => sum + it.shape.reduce((a, b) => a * b, 1), 0);
    const content = take(plan.content.byteLength);
    const { structures } = this;
    const [at, components, blocks, held, values, errors] =
      [structures.plan.size, count * 4, count * 4, count * 4, count * 4, structures.errors.size]
        .map(take);
    const moments = take(plan.numbers.remembered * this.moment * lanes * 8);
    const block = engines.map((k) => take(k.block_size));
    const hold = engines.map((k, c) =>
      plan.components[c].held ? take((k.parameters + k.inputs + k.outputs) * lanes * 8) : 0);
    const value = engines.map((k) => take(groups * (k.parameters + k.inputs) * lanes * 8));
    const sizes = {
      sums: groups * receivers * this.sums.length * lanes,
      order: groups * receivers * percentages.length * this.lengths.length * lanes,
      record: recorded ? plan.numbers.n_instants * width * lanes : 0,
    };
    const results = Object.entries(sizes).map(([name, size]) => [name, take(size * 8), size]);
    const flags = take(16), asked = take(percentages.length * 4);
    const room = percentages.length ? Object.fromEntries(Object.entries(plan.errors_bytes).map(
      ([name, size]) => [name, take(size * lanes)])) : {};
    const more = Math.ceil((end - memory.buffer.byteLength) / PAGE);
    if (more > 0) memory.grow(more); // typed arrays from before end here
    new Uint8Array(memory.buffer, content).set(new Uint8Array(plan.content));
    const pointers = Object.entries(plan.arrays).map(([name, [from]]) => [name, content + from]);
    this.#write("plan", at, { ...plan.numbers, components, ...Object.fromEntries(pointers) });
    const words = new Uint32Array(memory.buffer);
    words.set(engines.map((k) => k.at), components / 4);
    words.set(block, blocks / 4);
    words.set(hold, held / 4);
    words.set(value, values / 4);
    words.set(percentages, asked / 4);
    words.fill(0, flags / 4, flags / 4 + 4);
    this.#write("errors", errors, {
      room: plan.room, n_percentages: percentages.length, percentages: asked, ...room });
    const views = results.map(([name, from, size]) =>
      [name, new Float64Array(memory.buffer, from, size)]);
    const places = Object.fromEntries(results.map(([name, from]) => [name, from]));
    return {
      ...Object.fromEntries(views), width, engines, value,
      call: (groups) => this.wasm.sblcosim_drive(
        at, blocks, held, moments, BigInt(groups), values, places.sums,
        recorded ? places.record : 0, percentages.length ? errors : 0, places.order,
        flags, flags + 8),
    };
  }

  /** Run groups of a plan; copies of the last run fill up the last group. */
  #drive(plan, place, seeds, groups) {
    const { lanes } = this, last = seeds.length - 1;
    place.engines.forEach((k, c) => {
      const start = plan.start(c), n = start.length;
      const to = new Float64Array(this.wasm.memory.buffer, place.value[c], groups * n * lanes);
      for (let g = 0; g < groups; g++)
        for (let i = 0; i < n; i++) to.fill(start[i], (g * n + i) * lanes, (g * n + i + 1) * lanes);
      for (const [component, element] of plan.seeds)
        for (let run = 0; component === c && run < groups * lanes; run++)
          to[(Math.floor(run / lanes) * n + element) * lanes + (run % lanes)] =
            seeds[Math.min(run, last)];
    });
    const status = Number(place.call(groups));
    if (status === -2) throw new Error("a receiver must not give more estimates than updates");
    if (status > 0) {
      const { name, parameters } = plan.components[(status & 0xffff) - 1];
      const element = Math.floor(status / 65536) - 1;
      const [parameter] = Object.entries(parameters).reduce((nearest, it) =>
        it[1] <= element && it[1] > nearest[1] ? it : nearest, ["", -1]);
      throw new Error(`${name}.${parameter}: must be the same in all runs side by side, and an ` +
        "interval must be whole nanoseconds");
    }
  }

  /** The fields of the engine of a component, and its address. */
  #engine(type) {
    const number = this.components.indexOf(type);
    if (number < 0)
      throw new Error(`a component must be one of ${this.components.join(", ")}; got ${type}`);
    const at = this.wasm.sblcosim_engine(number);
    const view = new DataView(this.wasm.memory.buffer, at);
    return Object.entries(this.structures.engine.fields).reduce(
      (found, [name, [offset]]) => ({ ...found, [name]: view.getUint32(offset, true) }), { at });
  }

  /** Write a C structure, by the names of its fields; others are 0. */
  #write(structure, at, values) {
    const { fields } = this.structures[structure];
    const view = new DataView(this.wasm.memory.buffer, at);
    for (const [name, [offset, size]] of Object.entries(fields))
      if (size === 8) view.setBigInt64(offset, BigInt(values[name] ?? 0), true);
      else view.setInt32(offset, values[name] ?? 0, true);
  }
}

/**
 * In a worker: answer the messages of a `Pool`. The port is `self`, or node's `parentPort`.
 *
 * tasks: what workers can do besides, by name: functions of { engine, kit } and an argument.
 */
export function serve(port, tasks = {}) {
  const held = { engine: null, kit: null }, plans = {};
  port.addEventListener("message", ({ data }) => {
    const { id, module, kit, name, plan, seeds, percentages, task, argument } = data;
    try {
      if (module) Object.assign(held, { engine: new Engine(module), kit });
      if (plan) plans[name] = new Plan(plan.description, plan.content);
      const result = task ? tasks[task](held, argument)
        : seeds ? held.engine.run(plans[name], seeds, percentages) : null;
      port.postMessage({ id, result });
    } catch (error) {
      port.postMessage({ id, error: error.message });
    }
  });
  port.start?.();
}

/** Workers that share runs: what a run gives depends on its seed, never on who runs it when. */
export class Pool {
  #engine; #make; #patience; #kit;
  #plans = new Map();
  #pace = PACE;
  #last = 0;

  /**
   * engine: a loaded module; make: returns a new worker whose script calls `serve`; count: of
   * workers; patience: the least time that a worker has for an answer [ms]; kit: what their tasks need.
   */
  constructor(engine, make, count, patience = PATIENCE, kit = null) {
    this.#engine = engine;
    this.#make = make;
    this.#patience = patience;
    this.#kit = kit;
    this.workers = Array.from({ length: count }, () => this.#started());
  }

  /** Give all workers a plan, under a name. */
  add(name, { content, ...description }) {
    const { numbers, components } = description;
    const plan = { description, content: content.slice(0) };
    this.#plans.set(name, { plan, size: numbers.n_instants * components.length });
    for (const own of this.workers) this.#prepare(own, { name, plan });
  }

  /**
   * As `Engine.run`, in parts of the workers. A worker that ends or hangs is replaced, and its part
   * is done again.
   */
  async run(name, seeds, percentages = [], part = 64) {
    const { size } = this.#plans.get(name), parts = [];
    for (let first = 0; first < seeds.length; first += part) parts.push(seeds.slice(first, first + part));
    return joined(await this.#share(parts.map(
      (own) => [{ name, seeds: own, percentages }, own.length * size])));
  }

  /** What a task gives for each of its arguments, in their order: see `serve`. */
  each(task, all) { return this.#share(all.map((argument) => [{ task, argument }])); }

  /** The answers to messages, each with the size of its work. */
  async #share(messages) {
    const waiting = [...messages.keys()], results = [];
    const work = async (place) => {
      for (let failed = 0; waiting.length;) {
        const i = waiting.shift();
        try {
          const worker = this.#worker(place);
          await worker.ready;
          results[i] = await this.#ask(worker, ...messages[i]);
          failed = 0;
        } catch (error) {
          if (!(error instanceof WorkerDied) || ++failed > AGAIN) {
            waiting.length = 0;
            throw error;
          }
          waiting.unshift(i);
        }
      }
    };
    await Promise.all(this.workers.map((_, place) => work(place)));
    return results;
  }

  /** The worker at a place; another one if it has ended. */
  #worker(place) {
    const { dead, slack } = this.workers[place];
    if (dead) this.workers[place] = this.#started(slack);
    return this.workers[place];
  }

  #started(slack = 1) {
    const worker = this.#make(), own = { worker, waiting: new Map(), dead: null, ready: null, slack };
    const listen = (name, act) => worker.addEventListener
      ? worker.addEventListener(name, (event) => act(event.data ?? event))
      : worker.on(name, act);
    listen("message", (answer) => this.#take(own, answer));
    for (const name of ["error", "exit"])
      listen(name, (event) => this.#end(own, `a worker ended: ${event.message ?? event}`));
    this.#prepare(own, { module: this.#engine.module, kit: this.#kit });
    for (const [name, { plan }] of this.#plans) this.#prepare(own, { name, plan });
    return own;
  }

  #take(own, { id, result, error }) {
    if (own.dead) return;
    const { done, fail, size } = own.waiting.get(id);
    own.waiting.delete(id);
    if (size) {
      const taken = Math.min(performance.now() - own.since, own.limit);
      this.#pace = Math.max(taken / size, FORGET * this.#pace);
      own.slack = 1;
    }
    this.#watch(own);
    if (error === undefined) done(result);
    else fail(new Error(error));
  }

  #end(own, why) {
    if (own.dead) return;
    own.dead = new WorkerDied(why);
    clearTimeout(own.timer);
    own.worker.terminate();
    for (const { fail } of own.waiting.values()) fail(own.dead);
  }

  /**
   * From now on, a worker must answer its oldest message within a limit: those behind it have not
   * begun. Steps are counted, not time, so that a computer that sleeps ends no worker.
   */
  #watch(own) {
    clearTimeout(own.timer);
    const [oldest] = own.waiting.values();
    if (!oldest) return;
    own.since = performance.now();
    own.limit = own.slack * Math.max(this.#patience, SLOWER * this.#pace * oldest.size);
    let left = STEPS;
    const step = () => {
      if (left-- > 0) own.timer = setTimeout(step, own.limit / STEPS);
      else {
        own.slack *= 2; // for the next one: perhaps it was only slow
        this.#end(own, `a worker gave no answer for ${Math.round(own.limit / 1000)} s`);
      }
    };
    step();
  }

  /** What a worker must have done before it runs; `run` throws the error, if any. */
  #prepare(own, message) {
    own.ready = Promise.all([own.ready, this.#ask(own, message)]);
    own.ready.catch(() => {});
  }

  /** size: of the work, in steps of a component. */
  #ask(own, message, size = 0) {
    if (own.dead) return Promise.reject(own.dead);
    const id = ++this.#last;
    return new Promise((done, fail) => {
      own.waiting.set(id, { done, fail, size });
      if (own.waiting.size === 1) this.#watch(own);
      own.worker.postMessage({ id, ...message });
    });
  }
}

class WorkerDied extends Error {}

/** Parts of results, one after another. */
function joined(parts) {
  const all = (kind, name) => {
    const arrays = parts.map((it) => it[kind][name]);
    const whole = new Float64Array(arrays.reduce((sum, it) => sum + it.length, 0));
    let at = 0;
    for (const it of arrays) { whole.set(it, at); at += it.length; }
    return whole;
  };
  const kinds = ["sums", "order"].map((kind) => [kind, Object.fromEntries(
    Object.keys(parts[0]?.[kind] ?? {}).map((name) => [name, all(kind, name)]))]);
  return Object.fromEntries(kinds);
}
