// Times and lengths in words.

import { decimal } from "./pen.js";

// Unit of a time axis, and its seconds: as in the figures of a run.
export function unitOf(span) {
  return [["h", 3600, 3 * 3600], ["min", 60, 20 * 60], ["s", 1, 0]]
    .map(([name, seconds, from]) => ({ name, seconds, from })).find((it) => span >= it.from);
}

// A time as a clock shows it, such as 8.0 s, 2:05 or 1:02:05.
export function clock(t, span) {
  if (span < 20 * 60) return `${decimal(t, 1)} s`;
  const whole = Math.round(Math.abs(t)), two = (n) => String(n).padStart(2, "0");
  const [h, m, s] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return `${t < 0 ? "−" : ""}${h ? `${h}:${two(m)}` : m}:${two(s)}`;
}

// A length in metres, to the centimetre; a dash where it is unknown.
export function metres(x) {
  return Number.isNaN(x) ? "–" : decimal(x, 2);
}
