// What is possible, beside what the receivers reach: a figure of the verdict, and a sentence.

import { decimal } from "../../web/js/pen.js";
import { $, put } from "./dom.js";
import { length, share } from "./phrases.js";

const LITTLE = 0.05; // a gain that is not worth a better receiver
const DEGREES = 180 / Math.PI;

/**
 * From `explorer.possible`, null while it is not known, and the summary of `explorer.dives`, if there is
 * one. All of them are RMS errors of the same dives, the first ones: the possible one must not be compared
 * with a 95 % error, nor with other dives.
 */
export function showReach(found, summary, main) {
  const own = found?.receivers?.[main], reached = reachedIn(found?.dives, summary), rms = reached[main];
  put($("possible"), !found ? "…" : !own ? "–" : own.accuracy ? length(own.absolute) : "none");
  const best = own?.kind === "bound" ? "RMS: no receiver can do better" : "RMS error of a perfect receiver";
  put($("reached"), `${best}${rms ? `; ${main} has ${length(rms)} in ${first(found.dives)}` : ""}`);
  put($("reach"), found ? [...said(found, own, reached, main)].join(" ") : "…");
}

// RMS errors of receivers over the first dives, by label; without those that have none in some of them.
function reachedIn(dives, summary) {
  const all = Object.entries(summary?.receivers ?? {}).map(([label, { each }]) => [label, each.rms.slice(0, dives)]);
  return Object.fromEntries(all.filter(([, own]) => own.length === dives && own.every(Number.isFinite)).map(
    ([label, own]) => [label, Math.sqrt(own.reduce((sum, it) => sum + it * it, 0) / dives)]));
}

function* said(found, own, reached, main) {
  if (found.why) yield `What is possible is ${found.why}.`;
  else if (!own) yield `What is possible is judged where a receiver has estimates, and ${main} has none.`;
  else if (!own.accuracy) yield noAccuracy(own);
  else {
    const best = length(own.absolute);
    yield own.kind === "bound"
      ? `With the pings of ${first(found.dives)}, no receiver can have an RMS error below ${best} on average.`
      : `With the pings of ${first(found.dives)}, the best receiver would have an RMS error of about ${best}.`;
    const words = Object.keys(own.leftOut), labels = Object.keys(reached);
    if (words.length)
      yield `That leaves out ${listed(words)}; ${Number.isFinite(own.all)
        ? `with this, about ${length(own.all)} is possible` : "how much this adds is not known"}.`;
    if (labels.length)
      yield `There, ${listed(labels.map((it, i) => `${it} ${i ? "" : "has "}${length(reached[it])}`))}.`;
    yield* advice(own, reached[main], words.length);
  }
}

const first = (dives) => dives > 1 ? `the first ${dives} dives` : "the first dive";

const listed = (words) => [words.slice(0, -1).join(", "), words.at(-1)].filter((it) => it).join(" and ");

// Whether a better receiver helps.
function* advice({ absolute, all }, rms, leavesOut) {
  const gain = 1 - (leavesOut ? all : absolute) / rms;
  if (!Number.isFinite(gain)) return;
  yield gain < LITTLE ? "A better receiver would gain little. Only better equipment or more pings could help."
    : `A better receiver could gain up to ${share(gain)}.`;
}

function noAccuracy({ bearingOnly, bearing }) {
  const known = bearing * DEGREES;
  return bearingOnly
    ? `No receiver can know the distance: without a common clock, only the bearing is known, to ${decimal(known, 1)}°.`
    : `No receiver can know the position: the bearing is only known to ${decimal(known, 0)}°, so places all around the platform fit.`;
}
