// Errors by place: dives that circle in the cells of an area, as those of `sblcosim map`.

import { PERCENTAGES } from "./statistics.js";

const RADIUS = 3, DURATION = 60, MOST_TURNS = 1000, REACH = 2, SHARE = 0.95;
const NOISE = ["depth_std_m", "depth_bias_m", "depth_bias_std_m", "sampling_time_s", "seed", "stream",
  "interval_s"];
/** Time from which errors count [ns]. */
export const SETTLING = 20_000_000_000n;
/** Dives in each cell. */
export const RUNS = 10;

/** Keys that let the diver of a state circle about the origin at a depth [m]; null unsets one. */
export function circling({ given, values }, depth) {
  const speed = values.get("target.speed_m_s") || 0.3;
  const turns = speed * DURATION / (2 * Math.PI * RADIUS), changes = {};
  for (const path of given.keys())
    if (path.startsWith("target.") && !NOISE.includes(path.slice(7))) changes[path] = null;
  return {
    ...changes, "target.trajectory": "circle", "target.center_m": [0, 0], "target.radius_m": RADIUS,
    "target.speed_m_s": speed, "target.turns": Math.min(1.01 * turns + 0.01, MOST_TURNS),
    "target.depth_start_m": depth, "target.depth_end_m": depth, "time.duration_s": DURATION,
  };
}

/** The percentages of the errors of one dive [m], from results of `Engine.run`. */
export function lengthsOf(order, run, length, lengths) {
  const from = (run * lengths + length) * PERCENTAGES.length;
  return order.slice(from, from + PERCENTAGES.length);
}

/**
 * Radius that holds 95 % of the errors in each cell and its neighbours [m], row by row; NaN where no
 * dive is known. cells: of each cell, the errors of its dives in increasing or any order.
 */
export function withinOf(cells, rows, columns) {
  return Float64Array.from(cells, (_, at) => {
    if (!cells[at].length) return NaN;
    const row = Math.floor(at / columns), column = at % columns, all = [];
    for (let i = -REACH; i <= REACH; i++)
      for (let j = -REACH; j <= REACH; j++) {
        const [y, x] = [row + i, column + j];
        if (y < 0 || x < 0 || y >= rows || x >= columns) continue;
        const weight = Math.exp(-(i * i + j * j) / 2);
        for (const it of cells[y * columns + x]) all.push([Number.isNaN(it) ? Infinity : it, weight]);
      }
    all.sort(([a], [b]) => (a < b ? -1 : a > b ? 1 : 0));
    const wanted = SHARE * all.reduce((sum, [, weight]) => sum + weight, 0);
    let sum = 0;
    return (all.find(([, weight]) => (sum += weight) >= wanted) ?? [Infinity])[0];
  });
}
