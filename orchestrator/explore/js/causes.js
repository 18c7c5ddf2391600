// What limits the accuracy: how much of the 95 % error goes away without each cause, and with better
// equipment, on the same dives; with their 95 % intervals. As a list, and as a picture to be saved.
//
//   showCauses(causes, { done, n })
//   causesPicture(causes, look)     { width, height, legend, draw }, see web/js/save.js

import { write } from "../../web/js/pen.js";
import { $, element } from "./dom.js";
import { inside } from "./names.js";
import { share } from "./phrases.js";

const LEAST = 0.01, MOST = 8;
const WIDTH = 560, ROW = 54, BAR = 11, SIDE = 8, FAINT = 0.3;

// The largest causes, and the reach of their bars.
function chosen(causes) {
  const large = causes.filter((it) => it.share >= LEAST).slice(0, MOST);
  return { large, scale: Math.max(0.05, ...large.map((it) => it.interval[1])) };
}

export function showCauses(causes, { done, n }) {
  const { large, scale } = chosen(causes);
  $("causes").replaceChildren(...large.map((it) => row(it, scale)));
  const small = causes.filter((it) => !large.includes(it)).map((it) => inside(it.label));
  $("causes-note").textContent = `${done < n ? `${done} of ${n}` : n} dives each, the same for all. `
    + (small.length ? `Less than ${share(LEAST)}, or unclear: ${small.join(", ")}.` : "");
}

// A change of the error: −12 %, 0 %, +3 %.
function minus(x) {
  const text = share(Math.abs(x));
  return Number.parseInt(text) === 0 ? text : `${x > 0 ? "−" : "+"}${text}`;
}

const range = ([low, high]) => `(${minus(low).replace(/ %$/, "")} to ${minus(high)})`;
const gained = (better) => `${minus(better.gain)}${better.clear ? "" : ", not clear of chance"}`;
const cut = (x, scale) => Math.min(Math.max(x / scale, 0), 1);

// Parts of the bar of a cause: kind, from and to, as shares of its width.
function partsOf({ share: without, interval: [low, high], better }, scale) {
  const parts = [["without", 0, without], ...(better ? [["better", 0, better.gain]] : []), ["interval", low, high]];
  return parts.map(([kind, from, to]) => [kind, cut(from, scale), cut(to, scale)]);
}

function row(cause, scale) {
  const { label, share: without, interval, better } = cause;
  const bar = element("div", { class: "bar", "aria-hidden": "true" });
  for (const [kind, from, to] of partsOf(cause, scale)) {
    const it = element("i", { class: kind });
    it.style.left = `${100 * from}%`;
    it.style.width = `${100 * (to - from)}%`;
    bar.append(it);
  }
  return element("li", {},
    element("p", { class: "cause" }, element("b", {}, label), element("span", {},
      element("b", {}, minus(without)), ` ${range(interval)}`)),
    bar,
    better ? element("p", { class: "note" }, element("b", {}, better.device),
      ` ${better.detail ? `(${better.detail})` : ""} ${gained(better)}`) : null);
}

export function causesPicture(causes, look) {
  const { large, scale } = chosen(causes), own = look.surface;
  return {
    width: WIDTH, height: ROW * large.length + SIDE, look,
    legend: [
      { label: "without the cause", colour: own, dash: [], mark: "area", alpha: FAINT },
      { label: "with better equipment", colour: own, dash: [], mark: "area", alpha: 1 },
      { label: "95 % interval", colour: look.ink, dash: [], mark: "line" },
    ],
    draw: (pen) => large.forEach((it, i) => drawRow(pen, it, scale, ROW * i, look)),
  };
}

function drawRow(pen, cause, scale, top, look) {
  const { label, share: without, interval, better } = cause, width = WIDTH - 2 * SIDE;
  const text = (words, x, y, align, colour, bold = false) => {
    pen.font = look.font(12, bold);
    pen.textAlign = align;
    write(pen, words, x, y, colour, look.paper);
  };
  text(label, SIDE, top + 16, "left", look.ink, true);
  text(`${minus(without)} ${range(interval)}`, SIDE + width, top + 16, "right", look.ink);
  for (const [kind, from, to] of partsOf(cause, scale)) {
    pen.globalAlpha = kind === "without" ? FAINT : 1;
    pen.fillStyle = kind === "interval" ? look.ink : look.surface;
    const [y, height] = kind === "interval" ? [top + 22 + BAR / 2 - 1, 2] : [top + 22, BAR];
    pen.fillRect(SIDE + width * from, y, width * (to - from), height);
  }
  pen.globalAlpha = 1;
  if (better) text(`${better.device} ${gained(better)}`, SIDE, top + 47, "left", look.soft);
  pen.textAlign = "left";
}
