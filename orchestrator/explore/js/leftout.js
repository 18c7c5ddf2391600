// Errors that a bound does not include, and how large they are: `orchestrator/limits/unknown.py`.

import { wayOf } from "./boat.js";

const SINGULAR = 1e-12, MOST_CONDITION = 1e12;
const PLATFORM = "platform.";
const radians = (degrees) => degrees / 180 * Math.PI;
const dot = (one, other) => one.reduce((sum, it, i) => sum + it * other[i], 0);

/**
 * The errors that are left out: `keys` of the scenario, and `errors` of each source, [{ words, square }]
 * with the mean squares at epochs [m²]; NaN where nothing is known.
 *
 * positions: of the diver, NED [m]; since: times since the start [s].
 */
export function leftOut({ facts, sources, of, hasEffect, ownErrors, arms, starts }, positions, since) {
  const known = ownErrors ? [facts.survey, facts.delays] : [];
  const isZero = (path) => ![of(path) ?? 0].flat().some((it) => it);
  const keys = facts.unmodelled.filter((it) => !isZero(it) && !known.includes(it) && hasEffect(it));
  if (!keys.length) return { keys, errors: [] };
  const place = placed(of, arms), moved = beside(of, positions, since);
  const state = { of: (key) => of(PLATFORM + key), starts, place, positions: moved, since };
  const errors = sources.flatMap(({ words, parts }) => {
    const own = parts.flatMap((it) => it.unmodelled), mine = keys.filter((it) => own.includes(it));
    if (!mine.length) return [];
    const square = mine.includes(facts.delays) ? delayed(state, starts("levels.lasting_delay")[0])
      : mine.every((it) => it in MOUNTED) ? mounted(state, mine)
        : mine.every((it) => it.startsWith(`${PLATFORM}imu_`)) ? turned(state, mine)
          : positions.map(() => NaN);
    return [{ words, square: square.map((it) => Number.isFinite(it) ? it : NaN) }];
  });
  return { keys, errors };
}

// Where divers were beside a boat, had it stayed where it was and kept its heading.
function beside(of, positions, since) {
  const wayAt = wayOf(of), [north, east] = of("platform.mean_position_m");
  return positions.map(([x, y, z], i) => {
    const [n, e, turned] = wayAt(since[i]), c = Math.cos(turned), s = Math.sin(turned);
    if (!turned) return [x - n, y - e, z];
    const [ahead, right] = [x - north - n, y - east - e];
    return [north + c * ahead + s * right, east + c * right - s * ahead, z];
  });
}

/** From body to NED, the arms, and the beacons in still water, NED [m]. */
export function placed(of, arms) {
  const heading = radians(of("platform.mean_heading_deg")), c = Math.cos(heading), s = Math.sin(heading);
  const turn = ([x, y, z]) => [c * x - s * y, s * x + c * y, z], mean = of("platform.mean_position_m");
  return { turn, arms, beacons: arms.map((it) => turn(it).map((x, i) => x + mean[i])) };
}

const MOUNTED = { "platform.mounting_error_m": true, "platform.mounting_std_m": true };

function mounted({ of, place, positions }, keys) {
  const flat = of("mounting_error_m") ?? [], std = of("mounting_std_m");
  const shift = place.arms.map((_, i) => place.turn(flat.slice(3 * i, 3 * i + 3)));
  return positions.map((it) =>
    (keys.includes("platform.mounting_std_m") ? std ** 2 * dilution(it, place.beacons) : 0)
    + (keys.includes("platform.mounting_error_m") ? response(it, place.beacons, shift) : 0));
}

const delayed = ({ place, positions }, delay) =>
  positions.map((it) => delay ** 2 * dilution(it, place.beacons));

// Of an attitude that is wrong.
function turned(state, keys) {
  const { of, place: { turn, arms, beacons }, positions, since } = state;
  const own = (axis, end) => keys.includes(`${PLATFORM}imu_${axis}_${end}`) ? of(`imu_${axis}_${end}`) : 0;
  const units = [0, 1, 2].map((axis) => arms.map((arm) => {
    const [j, k] = [(axis + 1) % 3, (axis + 2) % 3], found = [0, 0, 0];
    found[j] = -arm[k]; // the axis times the arm
    found[k] = arm[j];
    return turn(found);
  }));
  const swings = swinging(state, keys);
  return positions.map((it, i) => {
    const warm = of("imu_temperature_offset_K") + of("imu_temperature_rate_K_s") * since[i];
    const steady = (axis) => radians(own(axis, "drift_deg_s") * since[i]
      + (since[i] >= of("imu_step_time_s") ? own(axis, "step_deg") : 0)
      + own(axis, "temperature_coefficient_deg_K") * warm);
    const tilt = steady("tilt"), angles = [tilt, tilt, steady("heading")];
    const shift = arms.map((_, b) => [0, 1, 2].map((x) => dot(angles, units.map((unit) => unit[b][x]))));
    return swings.reduce((sum, size, axis) =>
      sum + (size ? size ** 2 * response(it, beacons, units[axis]) : 0), response(it, beacons, shift));
  });
}

// RMS errors of roll, pitch and yaw that follow the motion of the platform [rad].
function swinging({ of, starts }, keys) {
  const sines = of("motion") === "sines";
  const a = ["roll", "pitch", "yaw"].map((axis) => sines || axis === "yaw"
    ? radians(of(`${axis}_amplitude_deg`)) : Math.SQRT2 * starts("coupled.tilt_std")[0]);
  const squares = [0, 0, 0], e = of("imu_misalignment_deg").map(radians);
  for (const [axis, which] of [["tilt", [0, 1]], ["heading", [2]]]) {
    const key = `imu_${axis}_scale_factor_error`;
    for (const i of keys.includes(PLATFORM + key) ? which : []) squares[i] += (of(key) * a[i]) ** 2;
  }
  if (keys.includes(`${PLATFORM}imu_misalignment_deg`))
    for (const i of [0, 1, 2]) {
      const [j, k] = [(i + 1) % 3, (i + 2) % 3];
      squares[i] += (e[j] * a[k]) ** 2 + (e[k] * a[j]) ** 2;
    }
  return squares.map((it) => Math.sqrt(it / 2));
}

// The matrix of simultaneous ranges with known depth, [[a, b], [b, c]], and the directions to a diver.
function seen(diver, beacons) {
  const u = beacons.map((beacon) => {
    const o = diver.map((x, i) => x - beacon[i]), distance = Math.sqrt(dot(o, o));
    return o.map((x) => x / (distance > 0 ? distance : Infinity));
  });
  const sum = (i, j) => u.reduce((total, it) => total + it[i] * it[j], 0);
  const [a, b, c] = [sum(0, 0), sum(0, 1), sum(1, 1)];
  return { u, a, b, c, determinant: a * c - b * b };
}

// Square of the horizontal dilution of precision; infinite where there is no fix.
function dilution(diver, beacons) {
  const { a, c, determinant } = seen(diver, beacons), trace = a + c;
  return determinant > SINGULAR * trace ** 2 ? Math.max(trace / determinant, 0) : Infinity;
}

// Square of the horizontal error of a diver if beacons are displaced [m²].
function response(diver, beacons, shift) {
  const { u, a, b, c, determinant } = seen(diver, beacons);
  const half = Math.hypot((a - c) / 2, b), most = (a + c) / 2 + half;
  if (!(most < MOST_CONDITION * Math.abs(determinant / most))) return NaN;
  const right = [0, 1].map((i) => u.reduce((sum, it, n) => sum + it[i] * dot(it, shift[n]), 0));
  const north = (c * right[0] - b * right[1]) / determinant;
  const east = (a * right[1] - b * right[0]) / determinant;
  return north ** 2 + east ** 2;
}
