// A recorded dive: read from a file, and replayed through the receivers of the page. What
// `sblcosim process` decides before receivers run is in the file (`orchestrator/processing/dive.py`).
//
//   await readDive(text)        a Dive: the facts of `dive.py`, `tables` (by name, a Float64Array for
//                               each column) and `run`, what is drawn but for receivers. An Error
//                               says what is wrong with the file
//   adopt(explorer, dive)       take its settings over; null, or why they are refused
//   replayed(dive, state)       { run, record, instants }: a Run as in `web/js/data.js`, and outputs
//                               by name at their instants [ns] from the start of the ticks
//   commandOf(explorer, dive)   { text, file, changed }: the same estimates from the command line;
//                               file: whether the scenario file of the page must replace that of the
//                               log; changed: keys that differ from the settings of the dive

import { readRun } from "../../web/js/data.js";
import { median } from "./misfits.js";
import { nanoseconds, seconds } from "./numbers.js";
import { sizeOf, startOf } from "./plans.js";
import { cubic, estimatesOf, firstAt } from "./record.js";
import { unpacked } from "./unpacked.js";
import { short, textOfValue } from "./values.js";

const FORMAT = "sblcosim dive 1";
const MADE = "a recorded dive as 'sblcosim explore --log LOG --out DIVE.json' writes it";
const RAW = "raw", FIX = "multilateration";

export async function readDive(text) {
  let file = null;
  try {
    file = JSON.parse(text);
  } catch { /* it is said below */ }
  const { format, data } = file ?? {};
  if (format !== FORMAT || typeof data !== "string") {
    const got = file === null ? "a file of another kind" : format === undefined ? "other content"
      : `the format '${short(String(format))}'`;
    throw new Error(`must be ${MADE}, got ${got}`);
  }
  let bytes;
  try {
    bytes = await unpacked(data);
  } catch {
    throw new Error(`must be ${MADE}, got a damaged one`);
  }
  const size = new DataView(bytes).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, size)));
  const numbers = new Float64Array(bytes.slice(Math.ceil((4 + size) / 8) * 8));
  const tables = {};
  let at = 0;
  for (const [name, [rows, columns]] of Object.entries(facts.tables))
    tables[name] = Array.from({ length: columns }, () => numbers.subarray(at, at += rows));
  return { ...facts, tables, run: await readRun(facts.shown) };
}

export function adopt(explorer, { given, receivers }) {
  const others = [...explorer.given.keys()].filter((path) => !(path in given));
  const known = receivers.map((it) => it === FIX ? RAW : it).filter((it) => explorer.types.includes(it));
  return explorer.apply({
    given: { ...Object.fromEntries(others.map((path) => [path, null])), ...given },
    receivers: known.length ? known : undefined,
  });
}

export function replayed(dive, { values, given, beacons, starts, chosen, told, parts, outputs, valuesOf, looks, engine, lag }) {
  check(dive, { values, given, beacons, interval: starts(`${chosen[0].type}.update_interval`)[0] });
  const decided = { ...dive.parameters[told ? "told" : "usual"] };
  if (decided.prior_position_std)
    decided.prior_position_std = [Math.max(...decided.prior_position_std, values.get("acoustics.range_std_m"))];
  const receivers = chosen.map(({ label, type }) => {
    const part = parts[type], has = ([name]) => part.parameters[name];
    const own = new Map([...valuesOf(label, type), ...Object.entries(decided).filter(has)]);
    return { label, type, part, start: startOf(part, own) };
  });
  const lags = receivers.map(({ part, start }) => part.parameters[lag] ? start[part.parameters[lag][0]] : 0);
  const { ticks, rows } = ticksOf(dive, Number(nanoseconds(Math.max(...lags))));
  const interval = BigInt(dive.interval_ns), stop = BigInt(dive.tables.time[0].at(-1));
  const after = ticks.at(-1) + interval < stop ? [stop] : []; // until then, outputs hold
  const instants = BigInt64Array.from([...Array.from(ticks, (t) => t + interval), ...after]);
  const record = {};
  for (const { label, type, part, start } of receivers) {
    const columns = part.inputs.flatMap(([, name, , element]) => dive.tables[name].map(
      (column, i) => [element + i, rows.map((row) => column[row])]));
    const recorded = part.outputs.filter(([name]) => outputs(`${label}.${name}`));
    const spans = recorded.map(([, first, shape]) => [first, sizeOf(shape)]);
    const found = engine.replay({ type, start, startNs: 0n, interval, ticks, columns, spans });
    recorded.forEach(([name], k) => {
      record[`${label}.${name}`] = held(found[k], instants.length * spans[k][1], spans[k][1]);
    });
  }
  const truth = truthOf(dive);
  return {
    record, instants,
    run: {
      ...dive.run,
      receivers: looks.map((look) => ({ ...look, ...placed(dive, record, look.label, estimatesOf(
        record, instants, look.label, truth)) })),
    },
  };
}

// What `sblcosim process` refuses, or decides anew, with other settings.
function check(dive, { values, given, beacons, interval }) {
  if (beacons !== dive.beacons)
    throw new Error(`[platform] beacons: must be as many as in the recorded dive, ${dive.beacons}, got ${beacons}`);
  const clock = values.get("acoustics.ranging") !== "inverted" || values.get("acoustics.common_clock") !== false;
  if (dive.differences && clock)
    throw new Error("[acoustics] ranging: must be 'inverted' and common_clock false, as the recorded dive has " +
      "differences of arrivals");
  const update = nanoseconds(given.get("receiver.update_interval_s") ?? interval), own = BigInt(dive.interval_ns);
  if (dive.simulated && update !== own)
    throw new Error(`[receiver] update_interval_s: must be ${seconds(own)} s, for which the recorded dive was ` +
      `prepared, got ${seconds(update)} s; 'sblcosim explore --log LOG --set KEY=VALUE' prepares it for others`);
}

// Ticks to step [ns] and the rows of the ports at them; see `orchestrator/processing/replaying.py`.
function ticksOf({ tables: { time: [time] }, interval_ns: interval, after }, lag) {
  const ticks = [], rows = [], last = time.length - 1;
  for (let row = 1; row < last; row++) {
    const end = lag ? Math.min(time[row + 1] - interval, time[row] + lag + after * interval) : time[row];
    for (let tick = time[row]; tick <= end; tick += interval) {
      ticks.push(BigInt(tick));
      rows.push(row);
    }
  }
  return { ticks: BigInt64Array.from(ticks), rows };
}

// Values up to a length: the last ones hold.
function held(values, length, size) {
  if (values.length === length) return values;
  const found = new Float64Array(length);
  found.set(values);
  found.set(values.subarray(values.length - size), values.length);
  return found;
}

// Estimates in the times and coordinates of the log, without those that know next to nothing:
// `orchestrator/processing/knowing.py`.
function placed({ start_ns: start, origin, knowing }, record, label, found) {
  const position = record[`${label}.position`];
  const broken = found.rows.some((row) => [0, 1, 2].some((i) => !Number.isFinite(position[3 * row + i])));
  const sizes = found.rows.map((row) => sizeOfClaim(record, label, row));
  const knows = knowing ? thatKnow(knowing, start, Array.from(found.epoch), sizes) : () => true;
  const kept = found.rows.map((_, i) => i).filter((i) => !broken && knows(i));
  const some = (column) => Float64Array.from(kept, (i) => column[i]);
  const later = (times) => some(times).map((t) => t + start / 1e9);
  const track = (own, off) => own && { x: some(own.x).map((v) => v + off[0]),
    y: some(own.y).map((v) => v + off[1]), z: some(own.z).map((v) => v + off[2]) };
  return {
    broken, epoch: later(found.epoch), since: later(found.since), until: later(found.until),
    position: track(found.position, origin), truth: track(found.truth, [0, 0, 0]),
    factor: found.factor && found.factor.map(some),
  };
}

function thatKnow({ silences, longest, usual }, start, epoch, sizes) {
  const spans = silences.map((ends) => ends.map((time) => (time - start) / 1e9));
  const last = epoch.map((time) => spans.findLastIndex(([begin]) => begin < time));
  const alone = epoch.map((time, i) => last[i] >= 0 && time < spans[last[i]][1]);
  const limit = usual * median(sizes.filter((_, i) => !alone[i]));
  const first = spans.map(() => Infinity);
  epoch.forEach((time, i) => {
    if (last[i] >= 0 && !alone[i] && sizes[i] <= limit) first[last[i]] = Math.min(first[last[i]], time);
  });
  return (i) => !alone[i] && !(last[i] >= 0 && epoch[i] < first[last[i]])
    && !(longest !== null && sizes[i] > longest);
}

// Claimed deviation north and east [m]; 0 without a claim.
function sizeOfClaim(record, label, row) {
  const covariance = record[`${label}.covariance`], std = record[`${label}.position_std`];
  const [north, east] = covariance ? [0, 14].map((i) => Math.sqrt(covariance[36 * row + i]))
    : std ? [std[3 * row], std[3 * row + 1]] : [0, 0];
  return Math.hypot(north, east) || 0;
}

// The true position at an epoch from the start of the ticks [ns]: on the cubic between two instants
// or, without velocities, on the straight line; unknown in gaps.
function truthOf({ tables, start_ns: start, truth_gap_ns: gap }) {
  const [time] = tables["truth.time"] ?? [[]], position = tables["truth.position"];
  const velocity = tables["truth.velocity"], unknown = [NaN, NaN, NaN];
  return (epoch) => {
    const t = Number(epoch) + start;
    if (!time.length || t < time[0] || t > time.at(-1)) return unknown;
    const right = firstAt(time, (it) => it >= t), left = right - 1;
    if (time[right] === t) return position.map((axis) => axis[right]);
    const step = time[right] - time[left], u = (t - time[left]) / step;
    if (step > gap) return unknown;
    return position.map((axis, k) => velocity
      ? cubic([axis[left], axis[right]], [velocity[k][left], velocity[k][right]], step * 1e-9, u)[0]
      : axis[left] + u * (axis[right] - axis[left]));
  };
}

export function commandOf(explorer, { command, given: own, simulated }) {
  const { given } = explorer, quoted = (text) => /^[\w./=-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
  const changed = [...given].filter(([path, value]) => JSON.stringify(value) !== JSON.stringify(own[path]));
  // A preset replaces keys there, too; others that are gone need the whole file.
  const replaced = new Set(changed.flatMap(([path]) => {
    const { table, sets = {} } = explorer.byPath.get(path);
    return Object.values(sets).flatMap(Object.keys).map((key) => `${table}.${key}`);
  }));
  const gone = Object.keys(own).filter((path) => !given.has(path) && !replaced.has(path));
  const option = (name, text) => text === null ? "" : ` --${name} ${quoted(text)}`;
  const file = gone.length > 0 || (!simulated && changed.length > 0);
  const set = file ? {} : { ...command.set, ...Object.fromEntries(changed.map(
    ([path, value]) => [path, textOfValue(explorer.byPath.get(path), value)])) };
  const scenario = file && !simulated ? explorer.file : command.scenario;
  return {
    changed: [...changed.map(([path]) => path), ...gone], file: file && simulated,
    text: `sblcosim process ${quoted(command.log)}${option("mapping", command.mapping)}`
      + option("scenario", scenario)
      + Object.entries(set).map(([path, text]) => option("set", `${path}=${text}`)).join("")
      + explorer.receivers.map((it) => option("receiver", it === RAW ? FIX : it)).join(""),
  };
}
