// What limits a receiver: its 95 % error without each source of error, and with better equipment, on
// the same dives. The switches are those of `sblcosim budget`.

import { chiSquareBeyond } from "./distributions.js";
import { causeOf, deviceOf } from "./names.js";
import { WEIGHTS } from "./statistics.js";

const ALL = "as it is", OFF = "without ", BETTER = "better ";
const PART = 32; // dives with each switch before they are shown
const DRAWS = 1000, FEW_DRAWS = 100, SHARE = 0.95;
const BITS = ["acoustics.packet_resolution_m", "acoustics.packet_angle_resolution_deg"];

// --- Switches ------------------------------------------------------------------------------------

/**
 * Switches of a state: [{ name, label, off, better }]. `off`: keys to change; better: { device, detail,
 * changes } or null.
 */
export function switchesOf(data, state) {
  return data.sources.flatMap(({ name, parts }) => {
    const off = {}, better = {}, levels = [];
    for (const part of parts) {
      Object.assign(off, reduced(data, state, part, part.off).changes);
      for (const [word, to] of part.better) {
        const { changes, from } = reduced(data, state, part, to);
        if (!Object.keys(changes).length) continue;
        Object.assign(better, changes);
        levels.push({ word, from, to });
        break;
      }
    }
    for (const changes of [off, better])
      if (BITS.some((key) => key in changes) && state.values.get("acoustics.packet_bits"))
        changes["acoustics.packet_bits"] = null; // bits cannot hold values that are not rounded
    if (!Object.keys(off).length) return [];
    const known = levels.length ? { ...deviceOf(name, levels), changes: better } : null;
    return [{ name, label: causeOf(name), off, better: known }];
  });
}

// The keys of a part that have an effect, scaled to a level: { changes, from }, the latter their size
// now; no changes if it is not above the level.
function reduced(data, { values }, part, to) {
  const about = part.about ? values.get(part.about) : 0;
  const keys = part.keys.filter((path) => values.get(path) !== undefined && hasEffect(data, values, path));
  const flat = keys.flatMap((path) => [values.get(path)].flat());
  const size = Math.hypot(...flat.map((it) => it - about)), level = part.relative ? to * about : to;
  const changes = {}, from = part.relative ? size / about : size;
  if (!(size > level * (1 + 1e-9))) return { changes, from };
  for (const path of keys) {
    const value = values.get(path), each = [value].flat();
    const scaled = each.map((it) => about + (it - about) * (level / size));
    if (scaled.some((it, i) => it !== each[i])) changes[path] = Array.isArray(value) ? scaled : scaled[0];
  }
  return { changes, from };
}

/** Whether the conditions of a key hold. */
export function hasEffect(data, values, path) {
  const { needs, table } = data.byPath.get(path);
  return (needs ?? []).every((group) => group.some(([key, wanted]) => {
    const on = `${table}.${key}`, value = values.get(on);
    const numbers = [value].flat().map((it) => typeof it === "number" ? it : data.byPath.get(on).numbers[it]);
    return wanted.length ? wanted.includes(numbers[0]) : numbers.some((it) => it !== 0);
  }));
}

// --- Causes --------------------------------------------------------------------------------------

/**
 * What limits a receiver; lab: see `explorer.js`. Null if the state no longer holds.
 *
 * switches: from `switchesOf`; count: of dives with each of them; onPart: called with what is known.
 */
export async function causesOf(lab, switches, count, onPart) {
  const plans = {};
  const add = async (name, changes) => {
    await new Promise((done) => setTimeout(done));
    const plan = lab.holds() && lab.plan(changes);
    if (plan) plans[name] = plan;
  };
  await add(ALL, {});
  for (const { name, off, better } of switches) {
    await add(`${OFF}${name}`, off);
    if (better) await add(`${BETTER}${name}`, better.changes);
  }
  const lengths = Object.fromEntries(Object.keys(plans).map((name) => [name, []]));
  for (let first = 0; first < count && lab.holds(); first += PART) {
    const size = Math.min(PART, count - first), done = first + size;
    const seeds = Array.from({ length: size }, (_, i) => lab.state.seed + first + i);
    const found = await Promise.all(Object.entries(plans).map(async ([name, plan]) =>
      [name, await lab.lengths(name, plan, seeds, first === 0)]));
    if (found.some(([, own]) => !own) || !lab.holds()) return null;
    for (const [name, own] of found) lengths[name].push(...own);
    const draws = done === count ? DRAWS : FEW_DRAWS;
    const result = { n: count, done, receiver: lab.label, ...limitsOf(switches, lengths, lab.state.seed, draws) };
    if (done === count) return result;
    onPart(result);
  }
  return null;
}

function limitsOf(switches, { [ALL]: whole, ...others }, seed, draws) {
  const { within, shares } = sharesOf(whole, others, seed, draws);
  const several = switches.filter(({ better }) => better).length;
  const causes = switches.flatMap(({ name, label, better }) => {
    const off = shares[`${OFF}${name}`], own = better && shares[`${BETTER}${name}`];
    if (!off || !Number.isFinite(off.share)) return [];
    return [{
      name, label, share: off.share, interval: off.interval,
      better: own && Number.isFinite(own.share) ? {
        device: better.device, detail: better.detail, gain: own.share, interval: own.interval, clear: isClear(own, several),
      } : null,
    }];
  }).sort((a, b) => b.share - a.share);
  const [first] = causes.filter((it) => it.better?.clear).sort((a, b) => b.better.gain - a.better.gain);
  return { within, causes, first: first?.name ?? null };
}

// --- Shares --------------------------------------------------------------------------------------

// What goes away of the 95 % error, with intervals by drawing dives again.
//
// whole: PERCENTAGES of each dive as it is; others: of the same dives, by name; seed, draws: of
// the drawing. Returns { within, shares: { name: { share, interval, spread } } }.
function sharesOf(whole, others, seed, draws) {
  const all = sorted(whole), within = percentile(all, null);
  const rest = Object.entries(others).map(([name, lengths]) => [name, sorted(lengths), []]);
  const random = generator(seed), count = whole.length, weights = new Float64Array(count);
  for (let draw = 0; draw < draws; draw++) {
    weights.fill(0);
    for (let i = 0; i < count; i++) weights[Math.floor(random() * count)]++;
    const base = percentile(all, weights);
    for (const [, own, found] of rest) found.push(1 - percentile(own, weights) / base);
  }
  return {
    within,
    shares: Object.fromEntries(rest.map(([name, own, found]) => {
      const share = 1 - percentile(own, null) / within, order = Float64Array.from(found).sort();
      const mean = found.reduce((a, b) => a + b, 0) / draws;
      const spread = Math.sqrt(found.reduce((sum, it) => sum + (it - mean) ** 2, 0) / (draws - 1));
      const at = (p) => order[Math.min(Math.floor(p * draws), draws - 1)];
      return [name, { share, interval: [at(0.025), at(0.975)], spread }];
    })),
  };
}

// Whether the largest of several gains is clear of chance, whichever it is (Bonferroni).
const isClear = ({ share, spread }, several) =>
  share > Math.sqrt(chiSquareBeyond(0.05 / Math.max(several, 1))) * spread;

// Errors of all dives in increasing order, each with its dive and what it stands for.
function sorted(lengths) {
  const all = lengths.flatMap((own, dive) =>
    Array.from(own, (it, p) => [Number.isNaN(it) ? Infinity : it, dive, WEIGHTS[p]]));
  all.sort(([a], [b]) => a - b || (a === b ? 0 : a < b ? -1 : 1));
  const [values, dives, parts] = [0, 1, 2].map((at) => Float64Array.from(all, (it) => it[at]));
  return { values, dives, parts };
}

// The error that a share of all errors does not exceed, dives counted by weights.
function percentile({ values, dives, parts }, weights) {
  const part = (i) => weights ? parts[i] * weights[dives[i]] : parts[i];
  let total = 0, sum = 0;
  for (let i = 0; i < values.length; i++) total += part(i);
  const wanted = SHARE * total;
  for (let i = 0; i < values.length; i++) {
    sum += part(i);
    if (sum >= wanted) return values[i];
  }
  return Infinity;
}

// Numbers from 0 to 1 (mulberry32), the same for the same seed.
function generator(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}
