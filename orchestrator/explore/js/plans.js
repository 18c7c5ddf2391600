// Plans of the lanes master from the parts of a system: what `orchestrator/wasm/plans.py` writes for
// a scenario, assembled here for any receivers, start values and intervals.

import { Plan } from "../../wasm/engine.js";
import { leastMultiple, nanoseconds } from "./numbers.js";

const CORE = ["target", "platform", "acoustics"];

/** Numbers of bytes, one after another, each array aligned to 8. */
class Content {
  parts = [];
  size = 0;

  placed(array) {
    this.size += (8 - this.size % 8) % 8;
    const place = [this.size, array.byteLength];
    this.parts.push([this.size, array]);
    this.size += array.byteLength;
    return place;
  }

  get buffer() {
    const all = new Uint8Array(this.size);
    for (const [at, { buffer, byteOffset, byteLength }] of this.parts)
      all.set(new Uint8Array(buffer, byteOffset, byteLength), at);
    return all.buffer;
  }
}

/**
 * Make a plan.
 *
 * system: `parts` of the contents, and `beacons`.
 * chosen: the receivers, each { label, type }.
 * valuesOf(label, type): Map of parameters and their elements.
 * times: `interval` of each component [ns], by label, and `stop` [ns], a multiple of all of them.
 * seeded: labels of the components that get the seed of a run; told: whether receivers are told the
 * true start; settling: errors count from this time after the start [ns]; record: whether a record
 * holds an output, by its name; lag: name of the parameter with the largest additional age of estimates.
 */
export function assembled({
  system, chosen, valuesOf, times, seeded, told = false, settling = 0n, record = () => false, lag = "",
}) {
  const labels = [...CORE.map((name) => ({ label: name, type: name })), ...chosen]
    .filter(({ label }) => label in times.interval);
  const parts = labels.map(({ label, type }) => ({ label, type, ...system.parts[type] }));
  const number = new Map(parts.map(({ label }, i) => [label, i]));
  const content = new Content(), int32 = (rows) => content.placed(Int32Array.from(rows.flat()));
  const starts = parts.map((it) => startOf(it, valuesOf(it.label, it.type)));
  const receivers = parts.filter(({ judged }) => judged && number.has("platform"));
  const links = parts.flatMap((it, to) => it.inputs.filter(([source]) => number.has(source)).map(
    ([source, , from, element, size]) => [number.get(source), from, to, element, size]));
  const handovers = told ? handed(parts, number) : [];
  const columns = parts.flatMap((it) => it.outputs.map(
    ([name, first, shape, type]) => ({ label: it.label, name, first, shape, type })))
    .filter((it) => record(`${it.label}.${it.name}`));
  const spans = columns.map(({ label, first, shape }) => [number.get(label), first, sizeOf(shape)]);
  const intervals = parts.map(({ label }) => times.interval[label]);
  const instants = instantsOf(intervals, times.stop);
  const base = shortest(instants), same = new Set(intervals).size === 1;
  const held = intervals.map((it) => !same && it !== base);
  const ticks = parts.map((it, i) => tickOf(it, starts[i]));
  const truth = number.has("platform") ? truthOf(parts, number, system.beacons) : [];
  const arrays = {
    interval_ns: content.placed(BigInt64Array.from(intervals)),
    links: int32(links), handovers: int32(handovers),
    receivers: int32(receivers.map((it) => [number.get(it.label), ...it.judged])),
    ...(truth.length ? { truth: int32([truth]) } : {}),
    spans: int32(spans), instants_ns: content.placed(instants),
  };
  const lags = parts.map((it, i) => it.judged && it.parameters[lag]
    ? starts[i][it.parameters[lag][0]] : 0);
  const longest = parts.map((_, i) => larger(ticks[i], intervals[i]));
  const room = roomOf(parts, longest, times.stop), values = room * 4;
  const description = {
    beacons: system.beacons,
    components: parts.map((it, i) => ({
      name: it.label, type: it.type, held: held[i], start: content.placed(starts[i]),
      parameters: Object.fromEntries(
        Object.entries(it.parameters).map(([name, [first]]) => [name, first])),
    })),
    numbers: {
      n_components: parts.length, n_links: links.length, n_handovers: handovers.length,
      n_receivers: receivers.length, n_spans: spans.length, n_instants: instants.length,
      remembered: remembered(parts, longest, instants, base, lags),
      sparse: Number(truth.length > 0 && held[number.get("target")]),
      settling_ns: Number(settling),
    },
    arrays,
    seeds: seeded.filter((it) => parts[number.get(it)]?.parameters.seed).map(
      (it) => [number.get(it), parts[number.get(it)].parameters.seed[0]]),
    receivers: receivers.map(({ label }) => label),
    room,
    errors_bytes: {
      squares: receivers.length * values * 8, keys: values * 2, candidates: values * 8,
    },
    record: columns.map(({ label, name, shape, type }) => ({ name: `${label}.${name}`, shape, type })),
  };
  return new Plan(description, content.buffer);
}

/** Number of elements of a shape. */
export const sizeOf = (shape) => shape.reduce((a, b) => a * b, 1);
const larger = (a, b) => (a > b ? a : b);
const elementOf = (part, name) => part.outputs.find(([it]) => it === name)[1];

/** Parameters and inputs of a part before the start; values: Map of parameters and elements. */
export function startOf(part, values) {
  const start = Float64Array.from(part.start);
  for (const [name, elements] of values) start.set(elements, part.parameters[name][0]);
  return start;
}

function tickOf(part, start) {
  return part.tick ? nanoseconds(start[part.parameters[part.tick][0]]) : 0n;
}

function handed(parts, number) {
  const target = parts[number.get("target")], from = elementOf(target, "position");
  return parts.filter((it) => it.judged && it.parameters.prior_position).map((it) => [
    number.get("target"), from, number.get(it.label), ...it.parameters.prior_position]);
}

function truthOf(parts, number, beacons) {
  const [target, platform] = ["target", "platform"].map((name) => number.get(name));
  const at = (part, name) => elementOf(parts[part], name);
  return [target, at(target, "position"), at(target, "velocity"), platform,
    at(platform, "position"), at(platform, "beacon_position"),
    at(platform, "reported_beacon_position"), beacons];
}

// All communication instants [ns]: the multiples of all intervals.
function instantsOf(intervals, stop) {
  const needed = different(intervals);
  if (needed.length === 1) {
    const count = Number(stop / needed[0]) + 1, found = new BigInt64Array(count);
    for (let i = 0; i < count; i++) found[i] = BigInt(i) * needed[0];
    return found;
  }
  const all = new Set();
  for (const interval of needed) for (let t = 0n; t <= stop; t += interval) all.add(t);
  return BigInt64Array.from(all).sort();
}

function shortest(instants) {
  let found = null;
  for (let i = 1; i < instants.length; i++) {
    const own = instants[i] - instants[i - 1];
    if (found === null || own < found) found = own;
  }
  return found ?? 1n;
}

// Largest number of estimates of any receiver in a run.
function roomOf(parts, longest, stop) {
  const ticks = longest.filter((_, i) => parts[i].judged);
  const least = ticks.length ? ticks.reduce((a, b) => (a < b ? a : b)) : stop;
  return Number(stop / (least > 0n ? least : 1n)) + 1;
}

// Number of instants for which the truth is kept; see `orchestrator/simulation/masters/lanes_layout.py`.
function remembered(parts, longest, instants, base, lags) {
  const most = (judged) => longest.reduce(
    (found, it, i) => Boolean(parts[i].judged) === judged ? larger(found, it) : found, 0n);
  const behind = 2n * most(true) + most(false), span = instants.at(-1) - instants[0];
  const lag = BigInt(Math.ceil(Math.min(Math.max(0, ...lags) * 1e9, Number(span))));
  const count = Number((behind + lag) / base + 2n);
  return Math.min(count, instants.length);
}

// Number of communication instants, at most.
export function countOf(intervals, stop) {
  return different(intervals).reduce((sum, it) => sum + Number(stop / it), 1);
}

// Intervals without those that are multiples of another one.
function different(intervals) {
  const all = [...new Set(intervals)];
  return all.filter((it) => !all.some((by) => by !== it && it % by === 0n));
}

// Stop of a run [ns]: the last common multiple of all intervals, and that multiple.
export function stopOf(intervals, duration) {
  const common = leastMultiple([...new Set(intervals)]);
  return { common, stop: duration - duration % common };
}
