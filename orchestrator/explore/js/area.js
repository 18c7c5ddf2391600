// What is possible at places of the water, for divers who circle there: `orchestrator/areas/possible.py`,
// `orchestrator/limits/places.py`. Packets that are lost with a probability count with the rest of their
// information. Losses that `sblcosim map` draws are not known here: see `drawsLosses`.

import { lostIn, shareOf } from "./information.js";
import { leftOut, placed } from "./leftout.js";
import { within } from "./lengths.js";
import { fixDensity, judgedOf, mattering } from "./possible.js";
import { even } from "./series.js";

const MOST_STEPS = 300, GROWTH = 0.1, LONGEST = 10, MOST_KEPT = 8, TIMES = 8;
const PASSES = 30, FIRST_PSD = 0.01, LEAST_TOLD = 1e-12;

/** Whether `sblcosim map` draws sequences of losses, from NumPy's numbers; of: values of keys. */
export function drawsLosses(of, facts) {
  const own = (key) => of(`acoustics.${key}`), p = own("loss_probability");
  return own("shadow_loss_probability") > 0
    || p > 0 && p < 1 && (own("loss_burst_length") > 0 || facts.inverted.includes(own("ranging")));
}

/**
 * What is possible at places, NED [m]: for each { within, rms [m], accuracy }, and the `words` of errors
 * that are left out and matter somewhere. within: a length that holds 95 % of the errors.
 *
 * conditions: of `conditionsOf`; circle: { radius, speed }; span: when errors begin to count, and the end
 * [s]. Each place has the same numbers, whatever the others are.
 */
export function possibleAt(conditions, { radius, speed }, span, places) {
  const still = placed(conditions.of, conditions.arms).beacons, slot = conditions.acoustics("sampling_time_s");
  const slots = slotsOf(conditions, span[1]), total = slots.heard.length;
  const late = Array.from({ length: total }, (_, i) => i).filter((i) => (i + 1) * slot >= span[0]);
  const counted = late.length ? late : [total - 1], picked = evenly(counted, MOST_KEPT);
  const groups = groupsOf(total, picked, slot), epochs = combined(slots, groups);
  const middles = groups.slice(1).map((end, i) => (groups[i] + end + 1) / 2);
  const dt = middles.map((it, i) => (it - (i ? middles[i - 1] : 0)) * slot);
  const kept = picked.map((it) => groups.indexOf(it)), turned = middles.map((it) => speed * it * slot / radius);
  const situation = { conditions, still, dt, kept, turned, radius, speed, epochs };
  const found = places.map((place) => at(situation, place, span[1]));
  const since = Array.from({ length: TIMES }, (_, i) => span[0] + (span[1] - span[0]) * i / (TIMES - 1));
  const words = new Set(places.flatMap((place, n) => {
    if (!found[n].accuracy) return [];
    const { errors } = leftOut(conditions, since.map(() => place), since);
    const squares = errors.map((it) => ({ words: it.words, square: mean(it.square) }));
    return Object.keys(mattering(found[n].rms, squares, conditions.facts.matters));
  }));
  return { places: found, words: [...words] };
}

function at({ conditions, still, dt, kept, turned, radius, speed, epochs }, place, end) {
  const { bound, beacons: count, arms, ownErrors, model, acoustics, legs, of, starts, echoes } = conditions;
  const middle = [0, 1, 2].map((k) => mean(still.map((it) => it[k])));
  const square = place.reduce((sum, it, k) => sum + (it - middle[k]) ** 2, 0);
  const psd = circlePsd(speed, radius, square * fixDensity(conditions), end);
  const positions = turned.map((it) => [place[0] + radius * Math.cos(it), place[1] + radius * Math.sin(it), place[2]]);
  const usual = [0, 1, 2].map((k) => mean(kept.map((i) => positions[i][k])));
  const told = still.map((it) => !echoes ? 1
    : Math.max(shareOf(acoustics, legs, starts("levels.range_noise")[0], usual, [0, 0, 0], it), LEAST_TOLD));
  const heading = of("platform.mean_heading_deg") / 180 * Math.PI, mid = of("platform.mean_position_m");
  const found = bound.covariances(model.number, count, {
    acceleration_psd: [psd], parameters: model.values(psd), dt, readings: epochs.readings, packets: epochs.packets,
    heard: epochs.heard.flat(), told, position: positions.flat(), platform: dt.flatMap(() => mid),
    attitude: dt.flatMap(() => [0, 0, heading]), beacon: dt.flatMap(() => (ownErrors ? still : arms).flat()),
  }, kept);
  const absolute = kept.map((_, i) => Array.from(found.absolute.slice(9 * i, 9 * i + 9)));
  const judged = judgedOf(found, kept.map((i) => positions[i]), kept.flatMap(() => mid), conditions);
  return {
    within: within(absolute), accuracy: mean(judged.map(({ ring }) => Number(ring))) <= 0.5 || ownErrors,
    rms: Math.sqrt(Math.max(mean(absolute.map((P) => P[0] + P[4] + P[8])), 0)),
  };
}

const mean = (values) => values.reduce((sum, it) => sum + it, 0) / values.length;

// At most that many elements, evenly.
function evenly(values, most) {
  const count = Math.min(values.length, most), step = count > 1 ? (values.length - 1) / (count - 1) : 0;
  return Array.from({ length: count }, (_, i) => values[i && i === count - 1 ? values.length - 1 : even(i * step)]);
}

// q of a circle [m²/s³]; density: variance of a fix times the time between fixes [m² s].
function circlePsd(speed, radius, density, duration) {
  if (!(density > 0 && density < Infinity)) return 0;
  let q = FIRST_PSD;
  for (let pass = 0; pass < PASSES; pass++) {
    const tau = Math.min(Math.max(q > 0 ? (density / q) ** 0.25 : duration / 2, 0), duration / 2);
    q = (2 * speed * Math.sin(speed * tau / (2 * radius))) ** 2 / (2 * tau);
  }
  return q;
}

// --- Slots ---------------------------------------------------------------------------------------

// The slots of a run: what is heard of each beacon, and of any, in each slot.
function slotsOf({ acoustics, of, legs, facts, beacons }, duration) {
  const total = Math.max(Math.ceil(duration / acoustics("sampling_time_s") - 1e-9) - 1, 1); // the end is not sampled
  const isInverted = facts.inverted.includes(acoustics("ranging")), shared = isInverted && acoustics("arrivals_shared");
  const { together, first } = facts.schedules[isInverted ? "simultaneous" : acoustics("schedule")][beacons];
  const order = of("acoustics.slot_order"), missing = lostIn(acoustics, legs, 0);
  const heard = Array.from({ length: total }, (_, slot) => {
    const found = Array(beacons).fill(0);
    for (let i = 0; i < together; i++) found[order[(first[slot % beacons] + i) % beacons] - 1] += 1 - missing;
    return found;
  });
  return {
    readings: heard.map(() => 1), heard,
    packets: heard.map(() => 1 - (shared ? missing : missing ** together)),
  };
}

// The first slot of each group of slots that count together, and the end of the last group.
function groupsOf(total, kept, slot) {
  if (total <= MOST_STEPS) return Array.from({ length: total + 1 }, (_, i) => i);
  const most = Math.max(Math.floor(LONGEST / slot), 1), firsts = [];
  let begin = 0;
  for (const alone of kept) {
    const some = [alone];
    while (some.at(-1) > begin) {
      const size = Math.min(Math.max(Math.floor(GROWTH * (alone - some.at(-1) + 1)), 1), most);
      some.push(Math.max(some.at(-1) - size, begin));
    }
    firsts.push(...some.reverse());
    begin = alone + 1;
  }
  return [...firsts, begin];
}

function combined({ readings, heard, packets }, groups) {
  const sums = (values) => groups.slice(1).map((end, i) =>
    values.slice(groups[i], end).reduce((sum, it) => sum + it, 0));
  return {
    readings: sums(readings), packets: sums(packets),
    heard: groups.slice(1).map((end, i) => heard[0].map((_, b) =>
      heard.slice(groups[i], end).reduce((sum, it) => sum + it[b], 0))),
  };
}
