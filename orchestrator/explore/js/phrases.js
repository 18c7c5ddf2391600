// Numbers and names for people.

import { decimal } from "../../web/js/pen.js";

// A length for a verdict, such as 120 m, 12.3 m, 3.9 m, 0.42 m or 0.042 m: two digits at least, and
// millimetres at most.
export function length(x) {
  if (!Number.isFinite(x)) return "–";
  if (x > 1e4) return "more than 10 km";
  if (x === 0) return "0 m";
  if (x < 0.0005) return "under 1 mm";
  return `${decimal(x, decimalsOf(x))} m`;
}

/** Decimals of a length [m]. */
export const decimalsOf = (x) => [0.0995, 0.995, 99.5].filter((it) => it > x).length;

export function share(x, digits = 0) {
  return Number.isFinite(x) ? `${decimal(100 * x, digits)} %` : "–";
}

export const whole = (n) => n.toLocaleString("en").replaceAll(",", " ");

// A value of a key as people type it.
export function typed(value) {
  if (value === null || value === undefined) return "";
  if (Array.isArray(value)) return `[${value.map(typed).join(", ")}]`;
  return String(value);
}

// A word of a scenario file as a label: rtk_fixed is "RTK fixed".
export function labelled(name) {
  const words = String(name).replaceAll("_", " ");
  const capital = words.replace(/\b(rtk|sbas|tcxo|ocxo|csac|ekf|gps|imu)\b/g, (it) => it.toUpperCase());
  return capital[0].toUpperCase() + capital.slice(1);
}
