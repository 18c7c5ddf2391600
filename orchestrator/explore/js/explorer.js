// A scenario that can be changed and simulated: everything of a page but what is seen.
//
// const explorer = await Explorer.open(contents, makeWorker);
//   contents      parsed JSON of the page (`orchestrator/explore/contents.py`)
//   makeWorker    () => a Worker whose script is `served.js`; null: everything runs here
//   workers       third argument, optional: how many; default: all cores but one
//
// Names and keys
//   title, name, file          of the scenario; file: name of the scenario file
//   words                      definitions for people: { lost, misleading }
//   keys                       all declarations in order, see `declarations.py`: path, table, key,
//                              words, unit, kind (number, integer, switch, choice, vector, matrix),
//                              bounds {least, most, above, below}, choices, names, rows, columns,
//                              default, needs, sets
//   value(path)                what holds now: given, filled in, or what the first receiver that has
//                              the key is told; undefined if there is none
//   given                      Map of paths and values: all keys that the scenario file will have
//   changed                    paths whose value differs from the scenario that was loaded
// Changes return null, or why they were refused, in a scenario file's words. A
// change that set or unset refuses is remembered until its key is set again or unset: two keys that
// depend on each other may be set one after the other. What holds is always the last valid state.
//   set(path, value)           value: a number, true or false, a name, an array, or typed text
//   unset(path), reset()
//   apply(settings)            several at once: { given: {path: value or null}, seed, receivers }
//   problems()                 [{ path, message }] of refused changes
//   arms, setArms([[x, y, z], …])      beacons in the platform's frame [m]; 3 to 8, of `counts`
//   counts                     numbers of beacons that this page has modules for; those other than
//                              the scenario's are being loaded until the promise `loaded` is kept
//   pathPoints, setPath([[north, east, depth], …], speed)    speed [m/s] is optional
//   mostPoints                 of the boat's track in this page; 0: it cannot follow one
//   track, setTrack([[time, north, east, heading], …])    of the boat [s, m, °]; none: it has none.
//                              The heading may be left out in all rows
//   isUnderWay                 whether the boat moves along a course or a track
//   seed, setSeed(seed)
//   types, receivers, setReceivers(["coupled", "ekf", "raw"])
//   doubts                     what is wrong with receivers for the beacons and ranges, by name, or ""
//   toml(), command()          scenario file and command line with the same numbers to the bit
//   link(), Explorer.settingsOf(hash)   settings in the part of an address after #
// Results. A result of a state that no longer holds is never delivered: it is null.
//   dive(seed)                 one dive as web/js/data.js's readRun gives it; default: seed
//   replay(dive)               the same of a recorded dive, see `recorded.js`
//   dives(count, onPart)       async; { n, done, receivers: { label: { runs, p50, p95, rms, lost,
//                              failed, misleading, misleadingKnown, claim, histogram, each } } }
//   causes(onPart, count)      async, of the first receiver; { n, done, receiver, within [m], causes:
//                              [{ name, label, share, interval, better }] by share, first }: what
//                              goes away of the 95 % error without a cause; label: see `names.js`;
//                              better: { device, detail, gain, interval, clear } of better equipment,
//                              or null; first: the name of the cause whose better equipment gains
//                              most, clear of chance, or null
//   possible(count)            async, what was possible in the first dives; { dives, receivers: { label:
//                              { kind, accuracy, absolute, relative [m], with [m], leftOut: { words: m },
//                              … } } }; without receivers and with a sentence `why` if there is none
//   water(grid, onPart, wanted, what) async, of the first receiver, by place: the 95 % error or, for
//                              what = "possible", that of a perfect receiver: { north, east, size,
//                              depth, values, n, done, words }, or { why } if there is none; null as
//                              soon as `wanted()` no longer says true. Values [m] are Infinity where
//                              nothing is possible; words: of errors that are left out and matter
//   cancel()                   stop what workers do

import { Engine, Pool } from "../../wasm/engine.js";
import { drawsLosses } from "./area.js";
import { isOnTrack, isUnderWay } from "./boat.js";
import { problemsOf, problemsOfTimes } from "./checks.js";
import { doubtsOf } from "./doubts.js";
import { beaconsOf, filled } from "./filling.js";
import { brief, nanoseconds, settled, written } from "./numbers.js";
import { causesOf, hasEffect, switchesOf } from "./limits.js";
import { possibleWaterOf, waterOf } from "./places.js";
import { isNeeded, togetherOf } from "./possible.js";
import { assembled, countOf, stopOf } from "./plans.js";
import { isDrawn, runOf } from "./record.js";
import { replayed } from "./recorded.js";
import { Settings } from "./start_values.js";
import { PERCENTAGES, lengthsOf, summaryOf } from "./statistics.js";
import { unpacked } from "./unpacked.js";
import { Refusal, fileOf, valueOf } from "./values.js";
import { TASKS } from "./worker.js";

const CORE = ["target", "platform", "acoustics"], RAW = "raw", FIX = "multilateration";
const SEED = { path: "seed", table: "", key: "seed", kind: "integer" };
const PATH = "path", WAYPOINTS = "waypoints", SOURCE = "receiver.pose_source";
const MOST_INSTANTS = 100_000; // whose record fits into memory
const CAUSES = 128, TOTAL = 1; // dives without each cause; the length of an error: see LENGTHS
const POSSIBLE = 8, MOST_POSSIBLE = 20_000; // dives of which is said what was possible, and their instants
const GROWN = 1.1; // dives that are shown, over those shown before, at least
const PART = 32; // dives that a worker does before it shows them

export class Explorer {
  #data; #plain = false; #kit; #given; #loaded; #receivers; #loadedReceivers; #seed; #state;
  #pending = new Map();
  #settings = new Map(); // by number of beacons
  #engines = new Map();
  #pools = new Map();
  #makeWorker; #workers;

  static async open(contents, makeWorker = null, workers = undefined) {
    const explorer = new Explorer(contents, makeWorker, workers);
    const own = beaconsOf(contents, explorer.#given);
    await explorer.#ready(own);
    const { bound: facts, sources, rules: { legs }, modules } = contents;
    explorer.#kit = { module: await WebAssembly.compile(await unpacked(modules.bound)), facts, sources, legs };
    explorer.loaded = Promise.all(explorer.counts.map((it) => explorer.#ready(it)));
    const problem = explorer.#try(explorer.#given, explorer.#receivers, explorer.#seed);
    if (problem.length) throw new Error(problem.map((it) => it.message).join("\n"));
    return explorer;
  }

  constructor(contents, makeWorker, workers) {
    this.#data = contents;
    this.#makeWorker = makeWorker;
    this.#workers = workers ?? Math.max((globalThis.navigator?.hardwareConcurrency ?? 2) - 1, 1);
    this.title = contents.title;
    this.name = contents.name;
    this.file = `${contents.name}.toml`;
    this.keys = contents.keys;
    this.byPath = new Map(contents.keys.map((it) => [it.path, it]));
    this.types = contents.types.map((it) => it === FIX ? RAW : it);
    this.words = contents.words;
    this.#given = new Map(Object.entries(contents.given));
    this.#loaded = new Map(this.#given);
    this.#receivers = contents.receivers;
    this.#loadedReceivers = contents.receivers;
    this.#seed = contents.seed;
  }

  // --- What holds ---------------------------------------------------------------------------------

  get counts() { return Object.keys(this.#data.systems).map(Number); }
  get given() { return new Map(this.#given); }
  get seed() { return this.#seed; }
  get receivers() { return this.#receivers.map((it) => it === FIX ? RAW : it); }

  get changed() {
    const paths = new Set([...this.#given.keys(), ...this.#loaded.keys()]);
    return [...paths].filter((it) => !same(this.#given.get(it), this.#loaded.get(it)));
  }

  value(path) {
    const key = this.byPath.get(path), found = this.#state.values.get(path) ?? this.#told(key);
    return found ?? key?.default ?? undefined;
  }

  // What the first receiver that has a key is told, in the unit of a scenario file.
  #told(key) {
    const { chosen, starts, beacons } = this.#state, { parts } = this.#data.systems[beacons];
    const own = key?.table === "receiver" && key.parameter
      ? chosen.find(({ type }) => parts[type].parameters[key.parameter]) : undefined;
    if (!own) return undefined;
    const { parameters, start } = parts[own.type], [first, size] = parameters[key.parameter];
    const numbers = starts(`${own.type}.${key.parameter}`) ?? start.slice(first, first + size);
    const [name] = Object.entries(key.numbers).find(([, it]) => it === numbers[0]) ?? [];
    if (name !== undefined) return key.kind === "switch" ? name === "true" : name;
    const found = numbers.map((it) => key.angle ? Number((it * 180 / Math.PI).toPrecision(12)) : it);
    return key.kind === "vector" || key.kind === "matrix" ? found : found[0];
  }

  /** Beacons in the platform's frame: forward, right, down [m]. */
  get arms() {
    const { starts } = this.#state, flat = starts("coupled.beacon_offset") ?? [];
    return rowsOf(flat.length ? flat : this.value("platform.beacon_m") ?? [], 3);
  }

  /** Points of the diver's path: north, east, down [m]; empty if it is not of points. */
  get pathPoints() {
    if (this.value("target.trajectory") !== WAYPOINTS) return [];
    return rowsOf(this.value("target.waypoint_m"), 3).slice(0, this.value("target.waypoint_count"));
  }

  get mostPoints() { return this.#data.rules.track_points.platform; }
  get isUnderWay() { return isUnderWay((path) => this.#state.values.get(path)); }

  /** Points of the boat's track: time, north, east and heading [s, m, °]; empty if it has none. */
  get track() {
    const of = (key) => this.#state.values.get(`platform.${key}`), headings = of("track_heading_deg");
    if (!isOnTrack((path) => this.#state.values.get(path))) return [];
    return rowsOf(of("track_m"), 2).slice(0, of("track_count")).map((it, i) =>
      [of("track_time_s")[i], ...it, ...(headings.length ? [headings[i]] : [])]);
  }

  problems() {
    return [...this.#pending].flatMap(([path, it]) => it.message ? [{ path, message: it.message }] : []);
  }

  // --- Changes ------------------------------------------------------------------------------------

  set(path, value) { return this.#change(new Map([[path, value]])); }
  unset(path) { return this.#change(new Map([[path, null]])); }

  reset() {
    this.#pending.clear();
    return this.#commit(new Map(this.#loaded), this.#loadedReceivers, this.#data.seed);
  }

  apply({ given = {}, seed, receivers } = {}) {
    return this.#changeAll(new Map(Object.entries(given)), receivers, seed);
  }

  setSeed(seed) { return this.#change(new Map(), undefined, seed); }
  setReceivers(receivers) { return this.#change(new Map(), receivers); }

  setArms(arms) {
    const points = arms.map((row) => row.map(toMillimetres));
    const changes = new Map([["platform.beacon_m", points], ["platform.arrangement", "given"]]);
    for (const path of ["platform.beacons", "platform.beacon_scale"]) changes.set(path, null);
    const before = this.#state.beacons;
    if (arms.length !== before)
      for (const path of ["platform.mounting_error_m", "acoustics.slot_order", "receiver.beacon_offset_m"])
        changes.set(path, null);
    return this.#changeAll(changes);
  }

  setPath(points, speed) {
    const changes = new Map([
      ["target.trajectory", WAYPOINTS], ["target.waypoint_m", points.map((row) => row.map(toMillimetres))],
      ...["waypoint_count", "track_time_s", "track_m", "track_count"].map((key) => [`target.${key}`, null]),
    ]);
    if (speed !== undefined) changes.set("target.speed_m_s", speed);
    return this.#changeAll(changes);
  }

  setTrack(rows) {
    const points = rows.map(([time, ...it]) => [settled(time), ...it.map(toMillimetres)]);
    const found = rows.length ? {
      track_time_s: points.map(([time]) => time), track_m: points.map(([, north, east]) => [north, east]),
      track_heading_deg: rows.every((it) => it.length > 3) ? points.map((it) => it[3]) : null,
      boat_speed_m_s: null, boat_course_deg: null,
    } : { track_time_s: null, track_m: null, track_heading_deg: null };
    return this.#changeAll(new Map(Object.entries({ ...found, track_count: null }).map(
      ([key, value]) => [`platform.${key}`, value])));
  }

  // Changes of keys, with those that wait for others; null unsets a key.
  #change(changes, receivers = this.receivers, seed = this.#seed) {
    const types = receivers.map((it) => it === RAW ? FIX : it);
    const unknown = types.find((it) => !this.#data.types.includes(it));
    if (unknown !== undefined || !types.length || new Set(types).size < types.length)
      return `receiver: must be some of ${this.types.join(", ")}, each once, got ` +
        (receivers.join(", ") || "none");
    try {
      seed = valueOf({ ...SEED, bounds: this.#data.rules.seed }, seed);
    } catch (error) {
      return error.message;
    }
    for (const [path, value] of changes) {
      const key = this.byPath.get(path);
      if (!key) return `[${path.split(".")[0]}] has no key '${path.split(".").slice(1).join(".")}'`;
      try {
        this.#pending.set(path, { value: value === null ? null : valueOf(key, value) });
      } catch (error) {
        if (!(error instanceof Refusal)) throw error;
        this.#pending.set(path, { message: error.message });
        return error.message;
      }
    }
    const waiting = [...this.#pending].filter(([, it]) => it.value !== undefined);
    const own = waiting.filter(([path]) => changes.has(path));
    const tried = (some) => {
      const wanted = this.#overridden(new Map(some.map(([path, { value }]) => [path, value])));
      const refused = this.#commit(wanted, types, seed);
      for (const [path] of refused === null ? some : []) this.#pending.delete(path);
      return refused;
    };
    let refused = tried(waiting);
    if (refused !== null && own.length < waiting.length) refused = tried(own);
    if (refused !== null) for (const [, it] of own) it.message = refused;
    return refused;
  }

  // As above, of keys that belong together: refused ones are not remembered.
  #changeAll(changes, receivers, seed) {
    const refused = this.#change(changes, receivers, seed);
    if (refused !== null) for (const path of changes.keys()) this.#pending.delete(path);
    return refused;
  }

  // The given keys with changes; presets and water replace the keys that they set.
  #overridden(changes) {
    const found = new Map(this.#given), set = (path) => changes.get(path) ?? null;
    for (const { path, table, sets } of this.keys)
      if (sets && set(path) !== null)
        for (const key of new Set(Object.values(sets).flatMap(Object.keys)))
          found.delete(`${table}.${key}`);
    const { water } = this.#data.rules;
    if (water.setters.some((key) => set(`acoustics.${key}`) !== null))
      found.delete("acoustics.sound_speed_m_s");
    else if (set("acoustics.sound_speed_m_s") !== null)
      for (const key of water.keys) found.delete(`acoustics.${key}`);
    for (const [path, value] of changes)
      if (value === null) found.delete(path);
      else found.set(path, value);
    return found;
  }

  #commit(given, receivers, seed) {
    const problems = this.#try(given, receivers, seed);
    return problems.length ? problems.map(({ message }) => message).join("\n") : null;
  }

  // The modules of a number of beacons, loaded once. A browser without vectors (simd128) has only the
  // numbers of which the page has a module without them: that of its scenario.
  async #ready(beacons) {
    if (!this.#data.systems[beacons] || this.#engines.has(beacons)) return;
    const { modules, systems } = this.#data, [two, one] = [2, 1].map((n) => modules[`engine.${beacons}.${n}`]);
    const [settings, engine] = await Promise.all([
      unpacked(modules[`settings.${beacons}`]).then((it) => Settings.load(it, systems[beacons].settings)),
      unpacked(two ?? one).then((it) => Engine.load(it)).catch(async (error) => {
        if (two && one) {
          this.#plain = true;
          return Engine.load(await unpacked(one));
        }
        if (this.#plain) return null;
        throw error;
      }),
    ]);
    if (!engine) {
      const { [beacons]: _, ...others } = systems;
      this.#data = { ...this.#data, systems: others };
      return;
    }
    this.#settings.set(beacons, settings);
    this.#engines.set(beacons, engine);
  }

  // Take a state over if it is valid; otherwise its problems.
  #try(given, receivers, seed) {
    const found = this.#made(given, receivers, seed);
    if (found.problems.length) return found.problems;
    this.#given = given;
    this.#receivers = receivers;
    this.#seed = seed;
    this.#state = found;
    return [];
  }

  // A state: values of all keys, start values, and plans; or its problems.
  #made(given, receivers, seed) {
    const data = this.#data, beacons = beaconsOf(data, given), system = data.systems[beacons];
    if (!system) {
      const message = `[platform] beacons: must be one of ${this.counts.join(", ")} in this page, got ${beacons}`;
      return { problems: [{ path: "platform.beacons", message }] };
    }
    if (!this.#settings.has(beacons)) {
      const message = `[platform] beacons: the components for ${beacons} beacons are still being loaded`;
      return { problems: [{ path: "platform.beacons", message }] };
    }
    given = this.#withEchoes(given, receivers);
    const values = filled(data, given, seed);
    const problems = problemsOf(data, values, given, receivers, beacons);
    if (problems.length) return { problems };
    const told = given.get("receiver.prior") === "true";
    if (told && !given.has("receiver.initialisation")) values.set("receiver.initialisation", "prior");
    const starts = this.#settings.get(beacons).computed(values, given, this.#numbers);
    const chosen = receivers.map((type) => ({ type, label: type }));
    if (!receivers.includes(FIX)) chosen.push({ type: FIX, label: RAW });
    const state = { given, values, beacons, starts, chosen, told, seed, problems: [] };
    try {
      state.times = this.#timesOf(state, seed);
      state.problems = problemsOfTimes(...this.#ticksOf(state, system));
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      return { problems: [{ path: error.path ?? "time.duration_s", message: error.message }] };
    }
    return state;
  }

  // Along a path of points, receivers keep what they assumed of echoes in the scenario as loaded: a
  // key of the file, as the settings module cannot compute it.
  #withEchoes(given, receivers) {
    const { late: { key, value }, receiver_keys: keys } = this.#data.rules;
    const has = receivers.some((it) => keys[it].includes(this.byPath.get(key).key));
    const points = ["waypoints", "file"].includes(given.get("target.trajectory"));
    const echoes = ["surface", "bottom"].some((it) => given.get(`acoustics.${it}_echo_probability`));
    return has && points && echoes && value !== null && !given.has(key)
      ? new Map(given).set(key, value) : given;
  }

  // Numbers of names, for the settings module.
  get #numbers() {
    const of = (path, name) => this.byPath.get(path).numbers[name];
    return Object.assign(of, {
      columns: (path) => this.byPath.get(path).columns ?? 1,
      start: (path) => this.byPath.get(path).default,
    });
  }

  // Start values of a component: a function of its label and type.
  #valuesOf({ given, values, starts, beacons, told, seed }, own = seed) {
    const { parts, settings: { copies } } = this.#data.systems[beacons];
    return (label, type) => {
      const found = new Map(), part = parts[type];
      for (const parameter of Object.keys(part.parameters)) {
        const path = copies[`${type}.${parameter}`], [, size] = part.parameters[parameter];
        const value = path === undefined ? starts(`${type}.${parameter}`) : values.get(path);
        if (value === undefined || value === null) continue;
        const numbers = [value].flat().map((it) => {
          if (typeof it === "number") return it;
          const { choices, names, numbers } = this.byPath.get(path);
          return names && !choices ? part.named[parameter]?.[it] ?? NaN : numbers[it];
        });
        if (!numbers.some(Number.isNaN)) found.set(parameter, numbers.slice(0, size));
        else if (path === undefined) throw unknown(this.#data.keys, part, parameter);
        if (parameter === "seed" && !given.has(path)) found.set(parameter, [own]);
      }
      if (told && part.parameters.prior_velocity) found.set("prior_velocity", [0, 0, 0]);
      return found;
    };
  }

  // Communication intervals by label, and the stop of a run [ns].
  #timesOf(state, seed) {
    const { values, given, starts, chosen } = state;
    const interval = {};
    for (const name of CORE) interval[name] = nanoseconds(values.get(`${name}.interval_s`));
    for (const { label, type } of chosen) {
      const update = given.get("receiver.update_interval_s") ?? starts(`${type}.update_interval`)[0];
      interval[label] = nanoseconds(given.get("receiver.interval_s") ?? update);
    }
    const all = Object.values(interval), asked = values.get("time.duration_s");
    const { common } = stopOf(all, 0n);
    if (asked !== PATH && nanoseconds(asked) < common)
      throw refusal("time.duration_s", `[time] duration_s: must be at least ${brief(Number(common) / 1e9)} s, ` +
        `the least common multiple of all intervals, got ${written(asked)}`);
    const duration = asked === PATH ? this.#pathDuration(state, interval.target, seed) : nanoseconds(asked);
    if (duration < common)
      throw refusal("time.duration_s", `[time] duration_s: must be at least ${brief(Number(common) / 1e9)} s, ` +
        `the least common multiple of all intervals, got 'path', which takes ${brief(Number(duration) / 1e9)} s`);
    const { stop } = stopOf(all, duration), instants = countOf(all, stop);
    if (instants > MOST_INSTANTS)
      throw refusal("time.duration_s", `[time] duration_s: a run in a page must have at most ` +
        `${MOST_INSTANTS.toLocaleString("en")} communication instants, got ` +
        `${instants.toLocaleString("en")}; make it shorter or the sampling time longer`);
    return { interval, stop };
  }

  // Parts, communication intervals and ticks [ns] by label.
  #ticksOf(state, { parts }) {
    const valuesOf = this.#valuesOf(state);
    const own = [...CORE.map((name) => ({ label: name, type: name })), ...state.chosen]
      .map((it) => ({ ...it, ...parts[it.type] }));
    const ticks = Object.fromEntries(own.map(({ label, type, tick, parameters, start }) =>
      [label, nanoseconds(valuesOf(label, type).get(tick)?.[0] ?? start[parameters[tick][0]])]));
    return [own, state.times.interval, ticks];
  }

  // The time until the end of the path [ns], as the target itself says.
  #pathDuration(state, interval, seed) {
    const system = { ...this.#data.systems[state.beacons], beacons: state.beacons };
    const plan = assembled({
      system, chosen: [], valuesOf: this.#valuesOf(state, seed),
      times: { interval: { target: interval }, stop: 0n }, seeded: [], record: () => true,
    });
    const engine = this.#engines.get(state.beacons);
    const [duration] = engine.record(plan, seed)["target.path_duration"];
    if (duration > 0 && duration < Infinity) return nanoseconds(duration);
    if (state.values.get("target.speed_m_s") === 0 && state.values.get("target.trajectory") !== "white_noise_acceleration")
      throw refusal("target.speed_m_s", "[target] speed_m_s: must be more than 0 for a run until the end of the " +
        "path ([time] duration_s is 'path'), got 0.0");
    throw refusal("time.duration_s", "[time] duration_s: must be a number for a target that does not state when " +
      "its path ends, or whose path has no length, got 'path'");
  }

  // The plan of a state; record: for one dive.
  #plan(state, { record = () => false, seed = state.seed, settling = 0n } = {}) {
    const times = seed === state.seed ? state.times : this.#timesOf(state, seed);
    return assembled({
      system: { ...this.#data.systems[state.beacons], beacons: state.beacons },
      chosen: state.chosen, valuesOf: this.#valuesOf(state, seed), times, record, settling,
      seeded: [...CORE, ...state.chosen.map(({ label }) => label)].filter(
        (it) => !state.given.has(`${it}.seed`)),
      told: state.told, lag: this.#data.rules.lag,
    });
  }

  // --- Files, commands and links ------------------------------------------------------------------

  toml() { return fileOf(this.#data, this.#state.given, this.#seed); }

  command() {
    const chosen = this.#receivers.map((it) => ` --receiver ${it}`).join("");
    const file = /^[\w.-]+$/.test(this.file) ? this.file : `'${this.file.replaceAll("'", "'\\''")}'`;
    return `sblcosim run ${file}${chosen}`;
  }

  link() {
    const given = Object.fromEntries(this.changed.map((it) => [it, this.#given.get(it) ?? null]));
    const settings = {
      ...(Object.keys(given).length ? { given } : {}),
      ...(this.#seed === this.#data.seed ? {} : { seed: this.#seed }),
      ...(same(this.#receivers, this.#loadedReceivers) ? {} : { receivers: this.receivers }),
    };
    return Object.keys(settings).length ? `#${encodeURIComponent(JSON.stringify(settings))}` : "";
  }

  /** The settings of a link; null if it has none that can be read. */
  static settingsOf(hash) {
    try {
      const found = JSON.parse(decodeURIComponent(hash.replace(/^#/, "")));
      return typeof found === "object" ? found : null;
    } catch {
      return null;
    }
  }

  // --- Results ------------------------------------------------------------------------------------

  /** The record of a dive: by name, the values of all outputs at all instants. */
  record(seed = this.#seed, outputs = () => true) {
    const plan = this.#plan(this.#state, { record: outputs, seed });
    return { plan, values: this.#engines.get(this.#state.beacons).record(plan, seed) };
  }

  dive(seed = this.#seed) {
    const { plan, values } = this.record(seed, isDrawn), { beacons, times } = this.#state;
    return runOf({
      record: values, instants: plan.instants, interval: times.interval.target, beacons,
      looks: this.#looks, arms: this.#hasArms(values["platform.beacon_position"], beacons),
      sails: this.isUnderWay,
    });
  }

  /** The receivers on a recorded dive, see `recorded.js`; an Error says what does not fit. */
  replay(dive, outputs = isDrawn) {
    const state = this.#state, { parts } = this.#data.systems[state.beacons];
    return replayed(dive, {
      ...state, parts, outputs, valuesOf: this.#valuesOf(state), looks: this.#looks,
      engine: this.#engines.get(state.beacons), lag: this.#data.rules.lag,
    });
  }

  get #looks() {
    const { lines, colours } = this.#data.rules.style;
    const filters = [...new Set([...this.#loadedReceivers, ...this.#data.types])].filter((it) => it !== FIX);
    return this.#state.chosen.map(({ label, type }) => {
      if (type === FIX) return { label, fix: true, colour: "soft", dash: [] };
      const number = filters.indexOf(type); // a receiver keeps its colour, whatever others are shown
      return { label, fix: false, colour: `line-${number % colours}`, dash: lines[number % lines.length] };
    });
  }

  #hasArms(positions, beacons) {
    const rows = rowsOf(Array.from(positions.slice(0, 3 * beacons)), 3);
    return [0, 1, 2].every((axis) => {
      const middle = rows.reduce((sum, it) => sum + it[axis], 0) / beacons;
      return rows.every((it) => Math.abs(it[axis] - middle) <= this.#data.rules.far);
    });
  }

  async dives(count, onPart = () => {}) {
    const state = this.#state, plan = this.#plan(state);
    const seeds = Array.from({ length: count }, (_, i) => state.seed + i);
    let shown = 0;
    const found = await this.#run("dives", state, plan, seeds, (result, done) => {
      if (done < GROWN * shown) return; // so that summaries take the same share of any number
      shown = done;
      onPart(this.#summary(state, plan, result, done, count));
    });
    return found && this.#summary(state, plan, found, count, count);
  }

  #summary(state, plan, result, done, count) {
    const { sums } = this.#engines.get(state.beacons), duration = plan.instants.at(-1);
    return {
      n: count, done,
      receivers: Object.fromEntries(plan.receivers.map((label) => [
        label, summaryOf(sums, result.sums[label], result.order[label], duration, state.seed)])),
    };
  }

  // Results of seeds, part by part in their order; null if the state no longer holds.
  async #run(name, state, plan, seeds, onPart) {
    const holds = () => state === this.#state;
    const pool = await this.#pool(state.beacons);
    const engine = this.#engines.get(state.beacons);
    pool?.add(name, plan);
    const parts = [];
    const size = pool ? PART * pool.workers.length : PART;
    for (let first = 0; first < seeds.length; first += size) {
      const own = seeds.slice(first, first + size);
      if (!pool) await new Promise((done) => setTimeout(done));
      if (!holds()) return null;
      parts.push(pool ? await pool.run(name, own, PERCENTAGES, PART) : engine.run(plan, own, PERCENTAGES));
      if (!holds()) return null;
      const all = joined(parts);
      parts.splice(0, parts.length, all);
      if (first + size < seeds.length) onPart(all, Math.min(first + size, seeds.length));
    }
    return parts[0];
  }

  async #pool(beacons) {
    if (!this.#makeWorker) return null;
    if (!this.#pools.has(beacons))
      this.#pools.set(beacons, new Pool(this.#engines.get(beacons), this.#makeWorker, this.#workers, undefined, this.#kit));
    return this.#pools.get(beacons);
  }

  /** What causes switch: see `switchesOf`. */
  get switches() { return switchesOf({ ...this.#data, byPath: this.byPath }, this.#state); }

  /** What is wrong with receivers; see the head of this file. */
  get doubts() { return doubtsOf((path) => this.#state.values.get(path), this.#data.rules, this.#kit.facts); }

  /** What limits the first receiver; see the head of this file. */
  async causes(onPart = () => {}, count = CAUSES) {
    return causesOf(this.#laboratory(), this.switches, count, onPart);
  }

  /** 95 % errors by place, as of `sblcosim map`; see the head of this file. */
  async water(grid, onPart = () => {}, wanted = undefined, what = "error") {
    return (what === "possible" ? possibleWaterOf : waterOf)(this.#laboratory(), grid, onPart, wanted);
  }

  // What dives of the first receiver need, as long as the state holds.
  #laboratory() {
    const state = this.#state, [{ label }] = state.chosen, { lengths } = this.#engines.get(state.beacons);
    return {
      state, label, holds: () => state === this.#state, isUnderWay: this.isUnderWay,
      drawsLosses: drawsLosses((path) => state.values.get(path), this.#kit.facts),
      conditions: (changes) => {
        const own = this.#variant(state, changes, state.chosen.slice(0, 1));
        return own && this.#conditions(own);
      },
      each: (task, all) => this.#each(state, task, all),
      plan: (changes, options) => {
        const own = this.#variant(state, changes, state.chosen.slice(0, 1));
        return own && this.#plan(own, options);
      },
      width: async () => (await this.#pool(state.beacons))?.workers.length ?? 1,
      // The percentages of the errors of each dive [m]; null if the state no longer holds.
      lengths: async (name, plan, seeds, isNew) => {
        const found = await this.#part(state, name, plan, seeds, isNew);
        return found && seeds.map((_, run) => lengthsOf(found.order[label], run, TOTAL, lengths.length));
      },
    };
  }

  // A state with other keys; null if they contradict each other.
  #variant(state, changes, chosen = state.chosen) {
    const given = this.#overridden(new Map(Object.entries(changes)));
    const found = this.#made(given, chosen.map(({ type }) => type), state.seed);
    return found.problems.length ? null : { ...found, chosen };
  }

  // Results of a few seeds, of a worker or here; null if the state no longer holds.
  async #part(state, name, plan, seeds, isNew) {
    const pool = await this.#pool(state.beacons), engine = this.#engines.get(state.beacons);
    if (state !== this.#state) return null;
    if (pool) {
      if (isNew) pool.add(name, plan);
      // A part for each worker: several runs at a time would all begin with the first one.
      return pool.run(name, seeds, PERCENTAGES, Math.ceil(seeds.length / pool.workers.length));
    }
    await new Promise((done) => setTimeout(done));
    return state === this.#state ? engine.run(plan, seeds, PERCENTAGES) : null;
  }

  /** What was possible in the first dives, as of `sblcosim run`; see the head of this file. */
  async possible(count = POSSIBLE) {
    const state = this.#state, told = this.#conditions(state), { facts } = this.#kit;
    const plan = (seed) => this.#plan(state, { record: isNeeded, seed });
    const first = plan(state.seed), most = Math.min(count, Math.ceil(MOST_POSSIBLE / first.instants.length));
    const found = await this.#each(state, "possible", Array.from({ length: most }, (_, i) =>
      ({ plan: { ...(i ? plan(state.seed + i) : first) }, seed: state.seed + i, told })));
    if (!found || found[0].why) return found && found[0];
    return togetherOf(found, facts);
  }

  // What workers give for each argument of a task, see `worker.js`; null if the state no longer holds.
  async #each(state, task, all) {
    const pool = await this.#pool(state.beacons), held = { engine: this.#engines.get(state.beacons), kit: this.#kit };
    if (state !== this.#state) return null;
    const found = pool ? await pool.each(task, all) : all.map((it) => TASKS[task](held, it));
    return state === this.#state ? found : null;
  }

  // What is needed to know what is possible, as a message can hold it: see `worker.js`.
  #conditions({ values, given, beacons, told, chosen: [{ type }], times: { interval } }) {
    const { rules } = this.#data, { facts } = this.#kit, known = rules.receiver_keys[type];
    const has = (path) => !path.startsWith("receiver.") || known.includes(this.byPath.get(path).key);
    const of = (path) => has(path) ? values.get(path) : undefined, settings = this.#settings.get(beacons);
    const own = new Map([...given].filter(([path]) =>
      has(path) && (path === SOURCE || !path.startsWith("receiver."))));
    const starts = settings.computed(values, own, this.#numbers);
    return {
      values: new Map([...values].filter(([path]) => has(path))), beacons, interval: interval.target,
      starts: Object.fromEntries(Object.keys(settings.values).map((it) => [it, starts(it)])),
      effects: new Set(facts.unmodelled.filter((path) => hasEffect({ byPath: this.byPath }, values, path))),
      knownStart: told || of("receiver.initialisation") === "prior",
      ownBeacon: rules.contents[of("acoustics.packet_content")].only_own
        || (type === "coupled" && of(SOURCE) === "own_beacon"),
    };
  }

  /** Stop: results of what runs now are never delivered. */
  cancel() { if (this.#state) this.#state = { ...this.#state }; }
}

function refusal(path, message) {
  return Object.assign(new Refusal(message), { path });
}

// Echoes along a path of points: their mean excess is not part of the settings module.
function unknown(keys, part, parameter) {
  const key = keys.find((it) => it.table === "receiver" && it.parameter === parameter)?.key ?? parameter;
  return refusal("acoustics.surface_echo_probability", "[acoustics] surface_echo_probability and " +
    "bottom_echo_probability: must be 0 in a page for a path of points, unless the scenario has " +
    `echoes, or [receiver] ${key} is given`);
}

const toMillimetres = (length) => Math.round(length * 1000) / 1000;
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);

function rowsOf(flat, columns) {
  const found = [];
  for (let i = 0; i < flat.length; i += columns) found.push(flat.slice(i, i + columns));
  return found;
}

// Results one after another.
function joined(parts) {
  if (parts.length === 1) return parts[0];
  return Object.fromEntries(Object.entries(parts[0]).map(([kind, by]) => [kind, Object.fromEntries(
    Object.keys(by).map((name) => {
      const all = new Float64Array(parts.reduce((sum, it) => sum + it[kind][name].length, 0));
      parts.reduce((at, it) => { all.set(it[kind][name], at); return at + it[kind][name].length; }, 0);
      return [name, all];
    }))]));
}

