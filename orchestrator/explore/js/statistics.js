// What many runs say of a receiver: the definitions of `sblcosim run --runs`.

import { binomialBelow, chiSquareBeyond, shareInterval, studentQuantile } from "./distributions.js";

/** Percentages of a run's errors that stand for them; `orchestrator/judge/pooling.py`. */
export const PERCENTAGES = [5, 15, 25, 35, 45, 55, 65, 75, 81, 83, 85, 87, 89, 91, 93, 95, 97, 99];
/** What each stands for, in fiftieths. */
export const WEIGHTS = PERCENTAGES.map((it) => it < 80 ? 5 : 1);
const LENGTH = 1, LENGTHS = 4; // the total error; see LENGTHS of lanes_driver.py
const BEYOND_M = 1, MISLEADING_NEES = 15, MISLEADING_S = 20;
const DEGREES = 3, TAIL = 0.001, MEDIAN = 2.3659738843753377, MANY_LOST = 0.05;
const BIN = 0.01, MOST_BINS = 2000, NOTHING = -30, BARS = 40;

/**
 * Summary of the runs of a receiver.
 *
 * names: of the sums; sums, order: of all runs, see `Engine.run`, for PERCENTAGES.
 * Lengths in m; p50, p95: radii that hold a share of the errors of all runs, infinite where too many
 * runs have no estimate; rms: over runs; `each`: of every run.
 */
export function summaryOf(names, sums, order, duration) {
  const at = Object.fromEntries(names.map((name, i) => [name, i]));
  const count = sums.length / names.length, each = { rms: [], p95: [], lost: [], misleading: [], nees: [] };
  const lengths = [];
  for (let run = 0; run < count; run++) {
    const s = (name) => sums[run * names.length + at[name]];
    const rms = Math.sqrt((s("square_x") + s("square_y") + s("square_z")) / s("estimates"));
    const nees = s("nees") / s("nees_estimates"), longest = s("beyond_longest_ns") / 1e9;
    const own = PERCENTAGES.map((_, p) =>
      order[(run * LENGTHS + LENGTH) * PERCENTAGES.length + p]);
    lengths.push(own);
    each.rms.push(rms);
    each.p95.push(own[PERCENTAGES.indexOf(95)]);
    each.nees.push(nees);
    each.lost.push(s("late_estimates") === 0 || s("late_error_square") > s("late_distance_square"));
    each.misleading.push(s("nees_estimates") > 0
      ? (nees > MISLEADING_NEES && rms > BEYOND_M) || longest > MISLEADING_S : null);
  }
  const [p50, p95] = percentiles(lengths, [0.5, 0.95]);
  const good = each.rms.filter(Number.isFinite), known = each.misleading.filter((it) => it !== null);
  const lost = each.lost.filter(Boolean).length, misleading = known.filter(Boolean).length;
  return {
    runs: count, failed: count - good.length,
    p50, p95,
    rms: good.length ? Math.sqrt(good.reduce((sum, it) => sum + it * it, 0) / good.length) : NaN,
    lost, lostInterval: count ? shareInterval(lost, count) : null,
    misleading, misleadingKnown: known.length,
    misleadingInterval: known.length ? shareInterval(misleading, known.length) : null,
    claim: claimOf(each.nees, lost / Math.max(count, 1)),
    histogram: histogramOf(lengths), each, duration: Number(duration) / 1e9,
  };
}

/** The percentages of one kind of length of the errors of a run [m], from `order` of `Engine.run`. */
export function lengthsOf(order, run, length, lengths) {
  const from = (run * lengths + length) * PERCENTAGES.length;
  return order.slice(from, from + PERCENTAGES.length);
}

// --- Percentiles over runs -----------------------------------------------------------------------

/** Radii that hold shares of the errors of all runs [m]; see `orchestrator/judge/pooling.py`. */
function percentiles(lengths, shares) {
  const logs = Float64Array.from(lengths.flat(), (it) => Number.isNaN(it) ? Infinity : Math.log(it));
  let low = Infinity, high = -Infinity;
  for (const it of logs)
    if (Number.isFinite(it)) {
      low = Math.min(low, it);
      high = Math.max(high, it);
    }
  const bins = binsOf(logs, low <= high ? [low, high] : [NOTHING, NOTHING]);
  return shares.map((share) => Math.exp(inBins(bins, share)));
}

function binsOf(logs, [low, high]) {
  const inner = Math.min(Math.max(Math.ceil((high - low) / BIN), 1), MOST_BINS);
  const end = Math.max(high, low + 1e-9), step = (end - low) / inner;
  const first = low + step - low; // as between the first two edges
  const counts = new Float64Array(inner + 3);
  let all = 0;
  logs.forEach((value, i) => {
    const weight = WEIGHTS[i % WEIGHTS.length];
    counts[value === Infinity ? inner + 2
      : Math.min(Math.max(Math.ceil((value - low) / first), 0), inner + 1)] += weight;
    all += weight;
  });
  return { counts, inner, low, end, first, all };
}

function inBins({ counts, inner, low, end, first, all }, share) {
  const wanted = share * all;
  let bin = 0, below = counts[0];
  while (below < wanted && bin < inner + 2) below += counts[++bin];
  if (bin === inner + 2 || all === 0) return Infinity;
  if (bin === 0) return low;
  if (bin === inner + 1) return end;
  const part = 1 - (below - wanted) / (counts[bin] || 1);
  return low + (bin - 1 + Math.min(Math.max(part, 0), 1)) * first;
}

// Shares of the errors of all runs in bars of equal width; the last one has what is beyond.
function histogramOf(lengths) {
  const all = lengths.flatMap((own) => own.map((it, p) => [it, WEIGHTS[p]]))
    .filter(([it]) => Number.isFinite(it)).sort(([one], [other]) => one - other);
  const whole = all.reduce((sum, [, weight]) => sum + weight, 0);
  if (!whole) return { edges: [0, 1], shares: [0], beyond: 0 };
  let below = 0;
  const most = all.find(([, weight]) => (below += weight) >= 0.99 * whole)[0] || 1;
  const size = 10 ** Math.floor(Math.log10(most / BARS * 2));
  const width = [1, 2, 5, 10].map((it) => it * size).find((it) => most / it <= BARS) ?? 10 * size;
  const count = Math.max(Math.ceil(most / width), 1), shares = new Array(count).fill(0);
  let beyond = 0;
  for (const [it, weight] of all)
    if (it < count * width) shares[Math.floor(it / width)] += weight / whole;
    else beyond += weight / whole;
  return { edges: Array.from({ length: count + 1 }, (_, i) => i * width), shares, beyond };
}

// --- Claims --------------------------------------------------------------------------------------

/**
 * Whether the covariance is right, from the mean NEES of each run: the verdict, the factor of the
 * standard deviation and the interval of the mean NEES; `orchestrator/judge/consistency.py`.
 */
export function claimOf(nees, lostShare) {
  const values = nees.filter((it) => !Number.isNaN(it)).sort((a, b) => a - b);
  const found = verdictOf(values);
  if (lostShare > MANY_LOST && found.verdict !== "optimistic") found.verdict = "unknown";
  return found;
}

function verdictOf(values) {
  const n = values.length, mean = values.reduce((a, b) => a + b, 0) / n;
  const factor = (value, expected) => Math.sqrt(value / expected);
  if (n < 2) return { verdict: n ? "one run" : "unknown", factor: factor(mean, DEGREES), low: NaN, high: NaN };
  const median = (values[(n - 1) >> 1] + values[n >> 1]) / 2;
  const limit = median * chiSquareBeyond(TAIL / n) / chiSquareBeyond(0.5);
  if (values[n - 1] > limit) return byMedian(values, median, factor);
  const variance = values.reduce((sum, it) => sum + (it - mean) ** 2, 0) / (n - 1);
  const spread = mean > 0 ? Math.sqrt(variance) / mean : 0;
  const reach = Math.exp(Math.min(studentQuantile(n - 1, 0.975) * spread / Math.sqrt(n), 700));
  const [low, high] = [mean / reach, mean * reach];
  return { verdict: word(low, high, DEGREES, DEGREES), factor: factor(mean, DEGREES), low, high };
}

function byMedian(values, median, factor) {
  const n = values.length;
  let place = 0;
  while (place < n && binomialBelow(place + 1, n, 0.5) < 0.025) place++;
  if (place < 1) return { verdict: "unknown", factor: NaN, low: NaN, high: NaN };
  const [low, high] = [values[place - 1], values[n - place]];
  const right = Math.min(Math.max(median, MEDIAN), DEGREES);
  return { verdict: word(low, high, MEDIAN, DEGREES), factor: factor(median, right), low, high };
}

const word = (low, high, least, most) =>
  low > most ? "optimistic" : high < least ? "pessimistic" : "in band";
