// What was possible in a dive: `orchestrator/limits/` (run, parameters, verdict).

import { isUnderWay } from "./boat.js";
import { echoChances, fisherFactor, lost, pathPsd, sharesAlong } from "./information.js";
import { leftOut } from "./leftout.js";
import { epochOf, epochsOf, stateOf } from "./record.js";
import { lastAt } from "./series.js";

const BOUND = "bound", REFERENCE = "reference", STOCHASTIC = "white_noise_acceleration";
const NEEDED = /^(target\.(position|velocity|depth_epoch)|platform\.(position|attitude|beacon_position)|acoustics\.(range_epoch|reception_count)|[^.]+\.(valid|update_count|epoch))$/;

/** Whether what is possible needs an output. */
export const isNeeded = (name) => NEEDED.test(name);

/**
 * What is the same for all dives.
 *
 * bound: a `Bound`; facts, sources, legs: of the contents, the first its `bound`; of: values of keys, of
 * [receiver] only those of the first receiver; hasEffect(path); starts: start values of parameters, as
 * if no key of [receiver] but its source of the pose were given; knownStart: whether the receiver has a
 * prior; ownBeacon: whether packets hold only their own beacon's position; beacons: how many;
 * interval: of the target [ns].
 */
export function conditionsOf(told) {
  const { of, starts, facts } = told, isArray = facts.inverted.includes(of("acoustics.ranging"));
  const acoustics = (key) => of(`acoustics.${key}`), ownErrors = hasOwnErrors(of, facts);
  const conditions = {
    ...told, acoustics, ownErrors, legs: told.legs[of("acoustics.ranging")],
    arms: rowsOf(starts("coupled.beacon_offset")), timed: starts("array.common_clock")[0] !== 0,
    isBound: of("target.trajectory") === STOCHASTIC, echoes: echoChances(acoustics).some((it) => it),
  };
  const name = ownErrors ? "field" : isArray ? "array" : "platform", fixes = rangeStds(conditions, isArray);
  const ranges = ownErrors && isArray ? rangeStds(conditions, false) : fixes;
  return { ...conditions, fixes, model: modelOf(conditions, facts.models[name], ranges) };
}

/**
 * What was possible in a dive, by receiver, at the epochs of its estimates: { receivers: { label:
 * { kind, absolute [m], relative [m], bearing [rad], accuracy, psd, timed, without, leftOut: [{ words,
 * square }] } } }; or a sentence `why` there is none.
 *
 * conditions: of `conditionsOf`; dive: its `record`, `instants` (see `record.js`) and the `labels` of
 * the receivers.
 */
export function possibleOf(conditions, { record, instants, labels }) {
  const { facts, model, timed, isBound, beacons: count } = conditions, dive = { record, instants };
  const estimates = new Map(labels.map((label) => [label, epochsOf(record, instants, label)]));
  const first = Number(instants[0]), last = Number(instants[instants.length - 1]);
  const at = [...new Set([...estimates.values()].flat())].filter((it) => first <= it && it <= last);
  const most = 2 * facts.most_epochs;
  if (instants.length + at.length > most)
    return { why: `only known for dives of up to ${most.toLocaleString("en")} instants and estimates` };
  const { epochs, ...events } = eventsOf(dive, count, at);
  const psd = isBound ? conditions.of("target.acceleration_psd_m2_s3") : psdOf(conditions, dive);
  const { positions, velocities, beacons, arrays } = along(conditions, dive, epochs, events);
  if (conditions.echoes) {
    const shares = sharesAlong(conditions.acoustics, conditions.legs,
      conditions.starts("levels.range_noise")[0], positions, velocities, beacons);
    arrays.heard = arrays.heard.map((it, i) => it * shares[i]);
  }
  const found = conditions.bound.covariances(model.number, count, {
    ...arrays, acceleration_psd: [psd], parameters: model.values(psd),
  });
  const judged = judgedOf(found, positions, arrays.platform, conditions);
  const without = leftOut(conditions, positions, epochs.map((it) => (it - first) / 1e9));
  const receivers = labels.flatMap((label) => {
    const which = estimates.get(label).map((it) => Math.max(lastAt(epochs, it), 0));
    const mean = (values) => which.reduce((sum, i) => sum + values(i), 0) / which.length;
    const rms = (P) => Math.sqrt(mean((i) => P[9 * i] + P[9 * i + 4] + P[9 * i + 8]));
    const absolute = rms(found.absolute), relative = rms(found.relative);
    if (!Number.isFinite(absolute) || !Number.isFinite(relative)) return []; // NaN without estimates
    return [[label, {
      kind: isBound ? BOUND : REFERENCE, absolute, relative, psd, timed,
      bearing: median(which.map((i) => judged[i].bearing)),
      accuracy: mean((i) => Number(judged[i].ring)) <= 0.5,
      without: without.keys,
      leftOut: without.errors.map((it) => ({ ...it, square: mean((i) => it.square[i]) })),
    }]];
  });
  return { receivers: Object.fromEntries(receivers) };
}

/**
 * What was possible in several dives: { dives, each, receivers: { label: { kind, accuracy, absolute,
 * relative [m], bearing [rad], bearingOnly, timed, without, leftOut: { words: m }, all [m] } } }.
 * leftOut: the errors that are left out, if they matter; all: what is possible with them, NaN if that is
 * not known; bearingOnly: whether no distance is known.
 */
export function togetherOf(each, facts) {
  const labels = [...new Set(each.flatMap((it) => Object.keys(it.receivers)))];
  const receivers = Object.fromEntries(labels.map((label) => {
    const own = each.map((it) => it.receivers[label]).filter((it) => it), [{ kind, timed, without }] = own;
    const mean = (of) => own.reduce((sum, it) => sum + of(it), 0) / own.length;
    const [absolute, relative] = ["absolute", "relative"].map((frame) => Math.sqrt(mean((it) => it[frame] ** 2)));
    const accuracy = mean((it) => Number(it.accuracy)) >= 0.5, bearing = median(own.map((it) => it.bearing));
    const squares = own[0].leftOut.map(({ words }, i) =>
      ({ words, square: mean((it) => it.leftOut[i].square) }));
    return [label, {
      kind, timed, without, accuracy, absolute, relative, bearing,
      bearingOnly: !accuracy && bearing <= facts.most_bearing,
      leftOut: accuracy ? mattering(absolute, squares, facts.matters) : {},
      all: Math.sqrt(squares.reduce((sum, it) => sum + it.square, absolute ** 2)),
    }];
  }));
  return { dives: each.length, each: each.map((it) => it.receivers), receivers };
}

/** The errors that are left out, by words [m], if they matter: `matter` of `limits/unknown.py`. */
export function mattering(possible, squares, least) {
  const known = squares.filter(({ square }) => Number.isNaN(square) || square > 0);
  const total = known.reduce((sum, { square }) => sum + (square || 0), 0);
  const isUnknown = known.some(({ square }) => Number.isNaN(square));
  if (!isUnknown && Math.sqrt(possible ** 2 + total) <= (1 + least) * possible) return {};
  return Object.fromEntries(known.filter(({ square }) => !(square < total / 20)).map(
    ({ words, square }) => [words, Math.sqrt(square)]));
}

function rowsOf(flat, first = 0, count = flat.length / 3) {
  return Array.from({ length: count }, (_, i) => Array.from(flat.slice(first + 3 * i, first + 3 * i + 3)));
}

function median(values) {
  const sorted = Float64Array.from(values).sort(), half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

// --- The model -----------------------------------------------------------------------------------

const any = (of, keys) => keys.some((key) => [of(`platform.${key}`) ?? 0].flat().some((it) => it));

/** Whether the beacons have only errors of their own: buoys, or a survey. */
export function hasOwnErrors(of, { motions, sensors }) {
  if (!of("platform.gps_shared")) return true;
  const moves = isUnderWay(of) || any(of, motions[of("platform.motion")]);
  return of("platform.mounting_std_m") > 0 && !moves && !any(of, sensors);
}

/** Whether the beacons share the errors of one platform's GPS and IMU. */
export const sharesErrors = (of, { sensors }) => of("platform.gps_shared") && any(of, sensors);

// Standard deviations of ranges for a receiver's model [m]; `common`: of what a ping shares.
function rangeStds({ acoustics, starts, timed }, isArray) {
  const level = (name) => starts(`levels.${name}`)[0], own = level(isArray ? "range_noise" : "noise");
  const shared = level("common_noise"), together = isArray && acoustics("arrivals_shared") && (shared || !timed);
  const share = fisherFactor(together ? shared : own, acoustics("outlier_probability"),
    acoustics("outlier_mean_m"), acoustics("outlier_distribution"));
  return together ? { range: own, common: shared / Math.sqrt(share) }
    : { range: own / Math.sqrt(share), common: starts("array.range_common_std")[0] };
}

// A model, and its numbers for a density of the diver's acceleration.
function modelOf(conditions, { number, receiver, parameters, start }, { range, common }) {
  const { of, acoustics, starts, facts, knownStart, ownBeacon, ownErrors } = conditions;
  const told = {
    range_std: range, range_common_std: common, depth_std: of("target.depth_std_m"),
    prior_position_std: of("receiver.prior_position_std_m"),
    prior_velocity_std: of("receiver.prior_velocity_std_m_s"),
    pings: 1, speed: acoustics("assumed_sound_speed_m_s") / acoustics("sound_speed_m_s") - 1,
    own_beacon: Number(ownBeacon && !ownErrors), known_start: Number(knownStart),
  };
  const values = (psd) => [...parameters, ...facts.situation].map((name) => name === "acceleration_psd"
    ? psd : told[name] ?? starts(`${receiver}.${name}`)?.[0] ?? start[name]);
  return { number, values };
}

/** Variance of a fix across the line to the platform, by the square of the distance, times the time between fixes [s]. */
export function fixDensity({ acoustics, starts, arms, legs, fixes }) {
  const missed = lost(acoustics, legs);
  const mean = [0, 1].map((axis) => arms.reduce((sum, it) => sum + it[axis], 0) / arms.length);
  const spread = arms.reduce((sum, it) => sum + (it[0] - mean[0]) ** 2 + (it[1] - mean[1]) ** 2, 0) / 2;
  const round = missed < 1 ? starts("levels.slots")[0] * acoustics("sampling_time_s") / (1 - missed) : Infinity;
  return fixes.range ** 2 / Math.max(spread, 1e-12) * round;
}

// Density of the acceleration of the path that the diver follows [m²/s³].
function psdOf(conditions, { record, instants }) {
  const density = fixDensity(conditions), { interval } = conditions;
  if (!(density < Infinity)) return 0;
  const [diver, platform] = [record["target.position"], record["platform.position"]];
  const square = diver.reduce((sum, it, i) => sum + (it - platform[i]) ** 2, 0) / instants.length;
  const own = Array.from(instants.keys()).filter((i) => instants[i] % interval === 0n);
  const velocity = record["target.velocity"];
  return pathPsd(Float64Array.from(own, (i) => Number(instants[i]) / 1e9),
    [0, 1].map((axis) => Float64Array.from(own, (i) => velocity[3 * i + axis])),
    density * square);
}

// --- What was measured, and where ----------------------------------------------------------------

// Epochs [ns], increasing, and the number of packets and readings at each.
function eventsOf({ record, instants }, beacons, at) {
  const count = record["acoustics.reception_count"], epoch = record["acoustics.range_epoch"];
  const depth = record["target.depth_epoch"], heard = [], read = [];
  for (let i = 0; i < instants.length; i++) {
    for (let b = 0; b < beacons; b++) {
      const k = i * beacons + b;
      if (count[k] > (i ? count[k - beacons] : 0)) heard.push([Number(epochOf(epoch[k], instants)), b]);
    }
    if (i && depth[i] > depth[i - 1]) read.push(Number(epochOf(depth[i], instants)));
  }
  const epochs = Float64Array.from(new Set([...heard.map(([it]) => it), ...read, ...at])).sort();
  const packets = new Float64Array(epochs.length * beacons), readings = new Float64Array(epochs.length);
  for (const [it, b] of heard) packets[lastAt(epochs, it) * beacons + b] = 1;
  for (const it of read) readings[lastAt(epochs, it)] = 1;
  return { epochs: Array.from(epochs), heard: packets, readings };
}

// True values at the epochs: of the diver and the beacons, and the arrays of the recursion.
function along({ interval, beacons: count, arms, ownErrors }, { record, instants }, epochs, events) {
  const times = Float64Array.from(instants, Number), state = stateOf(record, instants, interval);
  const states = epochs.map((it) => state(BigInt(it)));
  const held = epochs.map((it) => lastAt(times, it));
  const taken = (name, width) => Float64Array.from({ length: width * held.length }, (_, k) =>
    record[name][width * held[Math.floor(k / width)] + k % width]);
  const places = taken("platform.beacon_position", 3 * count), flat = arms.flat();
  const packets = epochs.map((_, i) => {
    const own = events.heard.subarray(i * count, (i + 1) * count);
    return Number(own.some((it) => it));
  });
  return {
    positions: states.map(([it]) => it), velocities: states.map(([, it]) => it),
    beacons: epochs.map((_, i) => rowsOf(places, 3 * count * i, count)),
    arrays: {
      dt: epochs.map((it, i) => (it - (i ? epochs[i - 1] : times[0])) * 1e-9),
      readings: events.readings, packets, heard: events.heard,
      position: states.flatMap(([it]) => it),
      platform: taken("platform.position", 3), attitude: taken("platform.attitude", 3),
      beacon: ownErrors ? places : epochs.flatMap(() => flat),
    },
  };
}

// --- What it means -------------------------------------------------------------------------------

/** At each epoch: the bearing's standard deviation [rad], and whether the posterior is no point. */
export function judgedOf({ relative: P }, positions, platform, { facts, timed, ownErrors }) {
  const { most_bearing, most_distance } = facts;
  return positions.map((it, n) => {
    const o = [0, 1].map((i) => it[i] - platform[3 * n + i]), reach = Math.hypot(...o);
    const [north, east] = reach > 0 ? o.map((x) => x / reach) : [1, 0];
    const along = ([a, b]) => Math.max(a * a * P[9 * n] + a * b * (P[9 * n + 1] + P[9 * n + 3])
      + b * b * P[9 * n + 4], 0);
    const radial = Math.sqrt(along([north, east]));
    const bearing = Math.sqrt(along([-east, north])) / Math.max(reach, 1e-9);
    const bent = bearing > most_bearing && reach * bearing ** 2 / 2 > radial;
    const long = !timed && radial > most_distance * reach;
    return { bearing: Math.min(bearing, Math.PI), ring: (bent || long) && !ownErrors };
  });
}
