// The record of a run as the Run that maps and figures draw: the form of `readRun` in
// `orchestrator/web/js/data.js`, with estimates and truth as `orchestrator/judge/definitions.py`
// defines them.

import { even } from "./series.js";

const SECOND = 1_000_000_000n, MOST_SECONDS = 9.2e9;
const NEVER = -(2n ** 63n);
const POSITION = [0, 2, 4]; // of the state (x, vx, y, vy, z, vz)

const DRAWN = /^(target\.(position|velocity)|platform\.(reported_)?beacon_position|[^.]+\.(valid|update_count|epoch|position|covariance|position_std))$/;
/** Whether a Run needs an output. */
export const isDrawn = (name) => DRAWN.test(name);

/**
 * The Run of a record.
 *
 * record: values of outputs by name; instants: their times [ns]; interval: of the target [ns];
 * beacons: number of beacons; looks: `label`, `fix`, `colour` and `dash` of each receiver; arms: whether
 * the beacons are on a platform; sails: whether it is a boat under way.
 */
export function runOf({ record, instants, interval, beacons, looks, arms, sails }) {
  const time = Float64Array.from(instants, (t) => Number(t) / 1e9);
  const state = stateOf(record, instants, interval), truth = (epoch) => state(epoch)[0];
  const known = record["platform.beacon_position"], said = record["platform.reported_beacon_position"];
  const each = (values) => Array.from({ length: beacons },
    (_, i) => trackOf(values, time.length, 3 * beacons, 3 * i));
  return {
    start: time[0], stop: time[time.length - 1], axes: ["North", "East"], arms, sails, time,
    diver: trackOf(record["target.position"], time.length, 3, 0),
    beacons: each(known), reported: known.every((it, i) => it === said[i]) ? [] : each(said),
    receivers: looks.map((look) => ({ ...look, ...estimatesOf(record, instants, look.label, truth) })),
  };
}

function trackOf(values, rows, width, first) {
  const [x, y, z] = [0, 1, 2].map((axis) => {
    const column = new Float64Array(rows);
    for (let i = 0; i < rows; i++) column[i] = values[i * width + first + axis];
    return column;
  });
  return { x, y, z };
}

// Rows of the estimates of a receiver, one for each change of its count while it is valid, and of the
// instants until which each stands.
function rowsOf(record, instants, label) {
  const count = record[`${label}.update_count`], valid = record[`${label}.valid`];
  const rows = [], until = [];
  const end = (i) => { if (rows.length > until.length) until.push(i); };
  for (let i = 0; i < instants.length; i++) {
    const holds = valid ? valid[i] !== 0 : count[i] > 0;
    const isNew = holds && count[i] !== (i ? count[i - 1] : 0);
    if (isNew || !holds) end(i);
    if (isNew) rows.push(i);
  }
  end(instants.length - 1);
  return { rows, until };
}

/** Epochs of the estimates of a receiver [ns]. */
export const epochsOf = (record, instants, label) => rowsOf(record, instants, label).rows
  .map((i) => Number(epochOf(record[`${label}.epoch`][i], instants)));

/** Estimates of a receiver; truth: the true position at an epoch. */
export function estimatesOf(record, instants, label, truth) {
  const { rows, until } = rowsOf(record, instants, label);
  const epochs = rows.map((i) => epochOf(record[`${label}.epoch`][i], instants));
  const seconds = (times) => Float64Array.from(times, (t) => Number(t) / 1e9);
  const true_ = epochs.map(truth);
  const column = (of) => Float64Array.from(rows, of);
  const track = (of) => ({ x: column((_, n) => of(n, 0)), y: column((_, n) => of(n, 1)), z: column((_, n) => of(n, 2)) });
  const position = record[`${label}.position`];
  return {
    rows, epoch: seconds(epochs), since: seconds(rows.map((i) => instants[i])),
    until: seconds(until.map((i) => instants[i])),
    position: track((n, axis) => position[3 * rows[n] + axis]),
    truth: track((n, axis) => true_[n][axis]),
    factor: factorOf(record, label, rows),
  };
}

/** An epoch [ns], matched to the instants. */
export function epochOf(epoch, instants) {
  if (!(Math.abs(epoch) < MOST_SECONDS)) return NEVER;
  const whole = Math.trunc(epoch), nearest = BigInt(whole) * SECOND + BigInt(even((epoch - whole) * 1e9));
  const at = Math.min(firstAt(instants, (t) => Number(t) / 1e9 >= epoch), instants.length - 1);
  return Number(instants[at]) / 1e9 === epoch ? instants[at] : nearest;
}

/** Index of the first element for which a condition holds; their number if there is none. */
export function firstAt(sorted, holds) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (holds(sorted[middle])) high = middle; else low = middle + 1;
  }
  return low;
}

/**
 * A function that gives the true position and velocity at an epoch [ns]: at the target's own instants
 * the recorded ones, between them on the cubic through positions and velocities at both ends.
 */
export function stateOf(record, instants, interval) {
  const own = Array.from(instants.keys()).filter((i) => instants[i] % interval === 0n);
  const times = own.map((i) => instants[i]), stop = instants[instants.length - 1];
  const position = record["target.position"], velocity = record["target.velocity"];
  return (epoch) => {
    if (epoch < instants[0] || epoch > stop || epoch > times[times.length - 1])
      return [[NaN, NaN, NaN], [NaN, NaN, NaN]];
    const right = firstAt(times, (t) => t >= epoch), at = own[right];
    if (times[right] === epoch) return [position, velocity].map((it) => Array.from(it.slice(3 * at, 3 * at + 3)));
    const before = own[right - 1], step = Number(times[right] - times[right - 1]);
    const h = step * 1e-9, u = Number(epoch - times[right - 1]) / step;
    const axes = [0, 1, 2].map((axis) => {
      const [p0, p1, v0, v1] = [position[3 * before + axis], position[3 * at + axis],
        velocity[3 * before + axis], velocity[3 * at + axis]];
      return cubic([p0, p1], [v0, v1], h, u);
    });
    return [0, 1].map((i) => axes.map((it) => it[i]));
  };
}

/** Place and velocity between two points with theirs, h [s] apart, at a share u of the way. */
export function cubic([p0, p1], [v0, v1], h, u) {
  const secant = (p1 - p0) / h, b = 3 * secant - 2 * v0 - v1, a = v0 + v1 - 2 * secant;
  return [p0 + h * u * (v0 + u * (b + u * a)), v0 + u * (2 * b + u * 3 * a)];
}

// Rows of the lower triangular L of the claimed covariance L Lᵀ of the position [m], or null.
function factorOf(record, label, rows) {
  const covariance = record[`${label}.covariance`], std = record[`${label}.position_std`];
  if (!covariance && !std) return null;
  const found = Array.from({ length: 6 }, () => new Float64Array(rows.length));
  rows.forEach((row, n) => {
    const P = (i, j) => covariance
      ? covariance[36 * row + 6 * POSITION[i] + POSITION[j]]
      : i === j ? std[3 * row + i] ** 2 : 0;
    const L = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    for (let i = 0; i < 3; i++)
      for (let j = 0; j <= i; j++) {
        let sum = 0;
        for (let k = 0; k < j; k++) sum += L[i][k] * L[j][k];
        L[i][j] = i === j ? Math.sqrt(P(j, i) - sum) : (P(j, i) - sum) / L[j][j];
      }
    const all = [L[0][0], L[1][0], L[1][1], L[2][0], L[2][1], L[2][2]];
    all.forEach((it, k) => { found[k][n] = all.every(Number.isFinite) ? it : NaN; });
  });
  return found;
}
