// Errors by place: dives that circle in the cells of an area, and what is possible there, as those of
// `sblcosim map`.

import { WEIGHTS } from "./statistics.js";

const RADIUS = 3, DURATION = 60, MOST_TURNS = 1000, REACH = 2, SHARE = 0.95;
const NOISE = ["depth_std_m", "depth_bias_m", "depth_bias_std_m", "sampling_time_s", "seed", "stream",
  "interval_s"];
const SETTLING = 20_000_000_000n; // errors count from here [ns]
const RUNS = 10; // dives in each cell
const CHUNK = 32; // cells that a worker computes before it shows them
const SAILS = "a boat under way leaves every place, so no place has an error of its own";
const RANDOM = "only known to 'sblcosim map' where losses come in bursts, from a shadow or to arrivals of one ping";
const NOWHERE = "no dive can circle in these cells with these settings";

/**
 * Errors in the cells of a grid; lab: see `explorer.js`. Null if the state no longer holds, or the
 * errors are no longer `wanted`; with a sentence `why` if there are none.
 */
export async function waterOf(lab, grid, onPart, wanted = () => true) {
  const { north, east, depth } = grid, places = north.flatMap((n) => east.map((e) => [n, e]));
  const changes = circling(lab.state, depth), cells = places.map(() => []);
  if (lab.isUnderWay) return { why: SAILS };
  if (!lab.plan(changes)) return lab.holds() ? { why: NOWHERE } : null;
  const result = (done) => ({
    ...grid, n: places.length, done, values: withinOf(cells, north.length, east.length),
  });
  const order = shuffled(places.length), width = 2 * await lab.width();
  for (let first = 0; first < order.length; first += width) {
    const found = await Promise.all(order.slice(first, first + width).map(async (cell, slot) => {
      const plan = lab.plan(changes, { settling: SETTLING });
      plan.set("target.center", places[cell]);
      plan.set("target.heading", [2 * Math.PI * ((cell * 0.618034) % 1)]);
      const seeds = Array.from({ length: RUNS }, (_, i) => lab.state.seed + i * places.length + cell);
      return [cell, await lab.lengths(`water ${slot}`, plan, seeds, true)];
    }));
    if (found.some(([, lengths]) => !lengths) || !lab.holds() || !wanted()) return null;
    for (const [cell, lengths] of found) cells[cell] = lengths.flatMap((it) => [...it]);
    if (first + width < order.length && first % (4 * width) === 0) onPart(result(first + width));
  }
  return result(places.length);
}

/** The same of what is possible: lengths that hold 95 % of the errors of a perfect receiver. */
export async function possibleWaterOf(lab, grid, onPart, wanted = () => true) {
  const { north, east, depth } = grid, places = north.flatMap((n) => east.map((e) => [n, e, depth]));
  const changes = circling(lab.state, depth), values = new Float64Array(places.length).fill(NaN);
  if (lab.isUnderWay) return { why: SAILS };
  const told = lab.conditions(changes), words = new Set();
  if (!told) return lab.holds() ? { why: NOWHERE } : null;
  if (lab.drawsLosses) return { why: RANDOM };
  const circle = { radius: RADIUS, speed: changes["target.speed_m_s"] }, span = [Number(SETTLING) / 1e9, DURATION];
  const result = (done) => ({ ...grid, n: places.length, done, values: values.slice(), words: [...words] });
  const order = shuffled(places.length), width = CHUNK * await lab.width();
  for (let first = 0; first < order.length; first += width) {
    const own = order.slice(first, first + width), parts = [];
    for (let i = 0; i < own.length; i += CHUNK) parts.push(own.slice(i, i + CHUNK));
    const found = await lab.each("places", parts.map((part) =>
      ({ told, circle, span, places: part.map((cell) => places[cell]) })));
    if (!found || !lab.holds() || !wanted()) return null;
    parts.forEach((part, i) => {
      part.forEach((cell, k) => {
        const { within, accuracy } = found[i].places[k];
        values[cell] = accuracy ? within : Infinity;
      });
      for (const it of found[i].words) words.add(it);
    });
    if (first + width < order.length) onPart(result(first + width));
  }
  return result(places.length);
}

// Numbers below n in an order that covers all of them evenly.
function shuffled(n) {
  const step = [7, 11, 13, 17, 19, 23].find((it) => n % it) ?? 1;
  const size = Math.max(Math.round(n * 0.382 / step) * step + 1, 1);
  const prime = Array.from({ length: n }, (_, i) => size + i).find((it) => coprime(it, n)) ?? 1;
  return Array.from({ length: n }, (_, i) => (i * prime) % n);
}

const coprime = (a, b) => (b ? coprime(b, a % b) : a === 1);

// Keys that let the diver of a state circle about the origin at a depth [m]; null unsets one.
function circling({ given, values }, depth) {
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

// Radius that holds 95 % of the errors in each cell and its neighbours [m], row by row; NaN where no
// dive is known. cells: of each cell, PERCENTAGES of the errors of its dives, dive after dive.
function withinOf(cells, rows, columns) {
  return Float64Array.from(cells, (_, at) => {
    if (!cells[at].length) return NaN;
    const row = Math.floor(at / columns), column = at % columns, all = [];
    for (let i = -REACH; i <= REACH; i++)
      for (let j = -REACH; j <= REACH; j++) {
        const [y, x] = [row + i, column + j];
        if (y < 0 || x < 0 || y >= rows || x >= columns) continue;
        const weight = Math.exp(-(i * i + j * j) / 2);
        cells[y * columns + x].forEach((it, p) =>
          all.push([Number.isNaN(it) ? Infinity : it, weight * WEIGHTS[p % WEIGHTS.length]]));
      }
    all.sort(([a], [b]) => (a < b ? -1 : a > b ? 1 : 0));
    const wanted = SHARE * all.reduce((sum, [, weight]) => sum + weight, 0);
    let sum = 0;
    return (all.find(([, weight]) => (sum += weight) >= wanted) ?? [Infinity])[0];
  });
}
