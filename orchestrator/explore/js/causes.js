// What limits the accuracy: how much of the 95 % error goes away without each cause, and with better
// equipment, on the same dives; with their 95 % intervals.

import { $, element } from "./dom.js";
import { share } from "./phrases.js";

const LEAST = 0.01, MOST = 8;

export function showCauses(causes, { done, n }) {
  const list = $("causes");
  const large = causes.filter((it) => it.share >= LEAST).slice(0, MOST);
  const scale = Math.max(0.05, ...large.map((it) => it.interval[1]));
  list.replaceChildren(...large.map((it) => row(it, scale)));
  const small = causes.filter((it) => !large.includes(it)).map((it) => it.name);
  $("causes-note").textContent = `${done < n ? `${done} of ${n}` : n} dives each, the same for all. `
    + (small.length ? `Less than ${share(LEAST)}, or unclear: ${small.join(", ")}.` : "");
}

// A change of the error: −12 %, 0 %, +3 %.
function minus(x) {
  const text = share(Math.abs(x));
  return Number.parseInt(text) === 0 ? text : `${x > 0 ? "−" : "+"}${text}`;
}

function row({ name, share: without, interval: [low, high], better }, scale) {
  const width = (x) => `${100 * Math.min(Math.max(x / scale, 0), 1)}%`;
  const bar = element("div", { class: "bar", "aria-hidden": "true" });
  const part = (kind, from, to) => {
    const it = element("i", { class: kind });
    it.style.left = width(from);
    it.style.width = `calc(${width(to)} - ${width(from)})`;
    bar.append(it);
  };
  part("without", 0, without);
  if (better) part("better", 0, better.gain);
  part("interval", low, high);
  return element("li", {},
    element("p", { class: "cause" }, element("b", {}, name), element("span", {},
      element("b", {}, minus(without)), ` (${range(low, high)})`)),
    bar,
    better ? element("p", { class: "note" }, element("b", {}, better.words),
      ` ${minus(better.gain)}${better.clear ? "" : ", not clear of chance"}`) : null);
}

const range = (low, high) => `${minus(low).replace(/ %$/, "")} to ${minus(high)}`;
