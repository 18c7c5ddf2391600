// Numbers and names for people.

import { decimal } from "../../web/js/pen.js";

// A length for a verdict, such as 3.9 m, 0.42 m or 12 m.
export function length(x) {
  if (!Number.isFinite(x)) return "–";
  if (x > 1e4) return "more than 10 km";
  return `${decimal(x, x < 0.995 ? 2 : x < 99.5 ? 1 : 0)} m`;
}

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
