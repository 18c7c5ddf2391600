// A boat on a recorded track: what receivers are told of it, and where it is.

import { lastAt } from "./series.js";

const LEAST = 1e-6; // s between two points
const RADIANS = Math.PI / 180;

/** Whether the boat follows a track; of: values of keys. */
export const isOnTrack = (of) => of("platform.track_count") > 0;

/** Whether the boat is under way. */
export const isUnderWay = (of) => isOnTrack(of) || of("platform.boat_speed_m_s") > 0;

/** The inputs of the settings module for a track: `inputs` of `models/settings/boat.py`. */
export function ratesOf(of) {
  const both = [ratesAlong(of, "track_m", 2), ratesAlong(of, "track_heading_deg", 1)];
  return Object.fromEntries(["track_m", "track_heading_deg"].flatMap((key, i) =>
    ["rates", "changes"].map((what, k) => [`platform.${key}[${what}]`, both[i][k]])));
}

// Mean square of a rate, and the squares of its changes per second.
function ratesAlong(of, key, width) {
  if (!isOnTrack(of)) return [0, 0];
  const flat = of(`platform.${key}`) ?? [];
  const times = of("platform.track_time_s").slice(0, of("platform.track_count"));
  const spans = times.slice(1).map((it, i) => Math.max(it - times[i], LEAST));
  const count = Math.min(times.length, Math.floor(flat.length / width)), rest = Array(width).fill(0), rates = [];
  for (let i = 1; i < count; i++)
    rates.push(rest.map((_, k) => (flat[width * i + k] - flat[width * (i - 1) + k]) / spans[i - 1]));
  const square = (one, other) => one.reduce((sum, it, k) => sum + (it - other[k]) * (it - other[k]), 0);
  const duration = Math.max(spans.reduce((sum, it) => sum + it, 0), LEAST) * width;
  const mean = rates.reduce((sum, it, i) => sum + spans[i] * square(it, rest), 0);
  const all = [rest, ...rates, rest];
  const changes = all.slice(1).reduce((sum, it, i) => sum + square(all[i], it), 0);
  return [mean / duration, changes / duration];
}

/**
 * What the boat has covered north and east [m], and how far it has turned [rad]: a function of the time
 * since the start [s].
 */
export function wayOf(of) {
  if (!isOnTrack(of)) {
    const course = RADIANS * of("platform.boat_course_deg"), speed = of("platform.boat_speed_m_s");
    return (since) => [since * speed * Math.cos(course), since * speed * Math.sin(course), 0];
  }
  const times = of("platform.track_time_s").slice(0, of("platform.track_count"));
  const flat = of("platform.track_m"), turned = of("platform.track_heading_deg");
  const at = motionOf(times, times.map((_, i) => [flat[2 * i], flat[2 * i + 1], RADIANS * (turned[i] ?? 0)]));
  return (since) => at(since - of("platform.departure_time_s"));
}

/** The motion through places at times, a function of the time: `motion` of `orchestrator/tracks/resample.py`. */
export function motionOf(times, places) {
  const duration = times.slice(1).map((it, i) => it - times[i]), last = duration.length - 1;
  const steps = duration.map((_, i) => places[i + 1].map((it, k) => it - places[i][k]));
  const velocities = places.map((place, i) => place.map((_, k) => i && i <= last
    ? passing(steps[i - 1][k], steps[i][k], duration[i - 1], duration[i]) : 0));
  return (at) => {
    const i = Math.min(Math.max(lastAt(times, at), 0), last);
    const tau = Math.min(Math.max((at - times[i]) / duration[i], 0), 1);
    return places[i].map((begin, k) => {
      const [one, two] = [i, i + 1].map((n) => duration[i] * velocities[n][k]), step = steps[i][k];
      return begin + tau * (one + tau * (3 * step - 2 * one - two + tau * (one + two - 2 * step)));
    });
  };
}

// Velocity at a point between two others: `velocity` of `models/track.py`.
function passing(before, after, first, second) {
  const left = before / first, right = after / second;
  if (!(left * right > 0)) return 0;
  return 3 * (first + second) * left * right
    / ((2 * second + first) * right + (second + 2 * first) * left);
}
