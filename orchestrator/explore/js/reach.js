// What is possible, beside what the receivers reach: a figure of the verdict, and a sentence.

import { decimal } from "../../web/js/pen.js";
import { $, put } from "./dom.js";
import { length, share } from "./phrases.js";

const LITTLE = 0.05; // a gain that is not worth a better receiver
const DEGREES = 180 / Math.PI;

/**
 * From `explorer.possible`, null while it is not known, and the summary of `explorer.dives`, if there is
 * one. All of them are RMS errors: the possible one must not be compared with a 95 % error.
 */
export function showReach(found, summary, main) {
  const own = found?.receivers?.[main], rms = summary?.receivers[main]?.rms;
  put($("possible"), !found ? "…" : !own ? "–" : own.accuracy ? length(own.absolute) : "none");
  const best = own?.kind === "bound" ? "RMS: no receiver can do better" : "RMS error of a perfect receiver";
  put($("reached"), `${best}${Number.isFinite(rms) ? `; ${main} has ${length(rms)}` : ""}`);
  put($("reach"), found ? [...said(found, own, summary?.receivers ?? {}, main)].join(" ") : "…");
}

function* said(found, own, receivers, main) {
  if (found.why) yield `What is possible is ${found.why}.`;
  else if (!own) yield `What is possible is judged where a receiver has estimates, and ${main} has none.`;
  else if (!own.accuracy) yield noAccuracy(own);
  else {
    const best = length(own.absolute);
    yield own.kind === "bound"
      ? `With the pings of ${first(found.dives)}, no receiver can have an RMS error below ${best} on average.`
      : `With the pings of ${first(found.dives)}, the best receiver would have an RMS error of about ${best}.`;
    const words = Object.keys(own.leftOut), reached = Object.entries(receivers).filter(
      ([, { rms }]) => Number.isFinite(rms));
    if (words.length)
      yield `That leaves out ${listed(words)}; ${Number.isFinite(own.all)
        ? `with this, about ${length(own.all)} is possible` : "how much this adds is not known"}.`;
    if (reached.length)
      yield `Here, ${listed(reached.map(([name, { rms }], i) => `${name} ${i ? "" : "has "}${length(rms)}`))}.`;
    yield* advice(own, receivers[main]?.rms, words.length);
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
