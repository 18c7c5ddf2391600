// All runs as a histogram of errors; it grows while they run.
//
//   drawHistogram(pen, { width, height }, receivers, look)
//
// `receivers` have label, colour, dash, histogram { edges [m], shares } and p95 [m]; the first one
// has bars, the others outlines.

import { decimal, line, roundStep, ticks, write } from "../../web/js/pen.js";
import { length } from "./phrases.js";

const MARGINS = { left: 12, right: 12, top: 24, bottom: 34 };
const ROW = 15, GAP = 6; // of labels, in pixels

export function drawHistogram(pen, { width, height }, receivers, look) {
  pen.fillStyle = look.paper;
  pen.fillRect(0, 0, width, height);
  const [main] = receivers, { left, right, top, bottom } = MARGINS, floor = height - bottom;
  if (!main) return;
  const end = limitOf(receivers), most = Math.max(...receivers.map(densest));
  const x = (metres) => left + (width - left - right) * metres / end;
  const y = (density) => floor - (floor - top) * density / (most || 1);
  drawAxis(pen, x, floor, width, end, look);
  pen.save();
  pen.beginPath();
  pen.rect(left, 0, width - left - right, height);
  pen.clip();
  drawBars(pen, main, x, y, floor, look);
  for (const it of receivers.slice(1)) drawOutline(pen, it, x, y, look);
  pen.restore();
  drawMarks(pen, receivers, x, { top, floor, width }, look);
}

const densities = ({ histogram: { edges, shares } }) => shares.map(
  (share, i) => share / (edges[i + 1] - edges[i]));
const densest = (receiver) => Math.max(0, ...densities(receiver).filter(Number.isFinite));

// Where to cut the tails: beyond the 95 % of all, so that a lost receiver does not flatten the rest.
function limitOf(receivers) {
  const ends = receivers.map(({ p95, histogram: { edges } }) => Math.min(
    Number.isFinite(p95) ? 1.6 * p95 : Infinity, edges.findLast(Number.isFinite)));
  return Math.min(Math.max(...ends), 3 * ends[0]) || 1;
}

function drawAxis(pen, x, floor, width, end, look) {
  pen.font = look.font(11);
  pen.textAlign = "center";
  pen.lineWidth = 1;
  pen.strokeStyle = look.soft;
  line(pen, [[x(0), floor], [x(end), floor]], 0);
  const step = roundStep(end / Math.max(width / 80, 2)), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  for (const value of ticks(0, end, step)) {
    pen.strokeStyle = look.soft;
    line(pen, [[x(value), floor], [x(value), floor + 4]], 0);
    if (x(value) < width - 8) write(pen, decimal(value, digits), x(value), floor + 16, look.ink, look.paper);
  }
  pen.textAlign = "right";
  write(pen, "Error [m]", width - 12, floor + 30, look.soft, look.paper);
}

// Full colour up to the 95 %, faint beyond.
function drawBars(pen, receiver, x, y, floor, look) {
  const { edges } = receiver.histogram, found = densities(receiver);
  pen.fillStyle = look.of(receiver);
  const bar = (from, to, density, alpha) => {
    const gap = x(to) - x(from) > 4 ? 1 : 0;
    pen.globalAlpha = alpha;
    pen.fillRect(x(from), y(density), Math.max(x(to) - x(from) - gap, 0.5), floor - y(density));
  };
  found.forEach((density, i) => {
    const [from, to] = [edges[i], Number.isFinite(edges[i + 1]) ? edges[i + 1] : edges[i]];
    if (!(density > 0) || to <= from) return;
    const cut = Math.min(Math.max(receiver.p95, from), to);
    if (cut > from) bar(from, cut, density, 0.85);
    if (to > cut) bar(cut, to, density, 0.3);
  });
  pen.globalAlpha = 1;
}

function drawOutline(pen, receiver, x, y, look) {
  const { edges } = receiver.histogram;
  pen.strokeStyle = look.of(receiver);
  pen.lineWidth = 1.8;
  pen.setLineDash(receiver.dash.map((d) => d * pen.lineWidth));
  line(pen, densities(receiver).flatMap((density, i) => Number.isFinite(edges[i + 1])
    ? [[x(edges[i]), y(density)], [x(edges[i + 1]), y(density)]] : []), 0);
  pen.setLineDash([]);
}

// Where the 95 % are: lines, then their labels.
function drawMarks(pen, receivers, x, { top, floor, width }, look) {
  pen.font = look.font(11, true);
  const marks = marksOf(receivers, x, width, (text) => pen.measureText(text).width);
  const low = ({ row }) => top - 6 + ROW * row;
  for (const mark of marks) {
    pen.strokeStyle = look.of(mark.receiver);
    pen.lineWidth = 1.6;
    line(pen, [[mark.at, low(mark)], [mark.at, floor]], 0);
  }
  for (const mark of marks) write(pen, mark.text, mark.from, low(mark), look.ink, look.paper);
}

/**
 * Labels of the 95 %: { receiver, text, at, from, to, row }; places in pixels. None covers another
 * one, or leaves the picture: each is in the first row where it fits, on either side of its line.
 */
export function marksOf(receivers, x, width, measured) {
  const found = [];
  receivers.forEach((receiver, i) => {
    const at = x(receiver.p95), text = `${i ? receiver.label : "95 % within"} ${length(receiver.p95)}`;
    if (!Number.isFinite(at) || at > width - MARGINS.right) return;
    const size = measured(text), sides = [[at + 5, at + 5 + size], [at - 5 - size, at - 5]];
    const inside = sides.filter(([from, to]) => from >= 0 && to <= width);
    const fits = (row) => (inside.length ? inside : sides).find(([from, to]) =>
      found.every((it) => it.row !== row || to + GAP < it.from || it.to + GAP < from));
    const row = receivers.findIndex((_, k) => fits(k)), [from, to] = fits(row);
    found.push({ receiver, text, at, from, to, row });
  });
  return found;
}

/** As a picture to be saved, see web/js/save.js. */
export function histogramPicture(size, receivers, look) {
  return {
    ...size, look,
    legend: receivers.map((it) => ({ label: it.label, colour: look.of(it), dash: it.dash, mark: "line" })),
    draw: (pen) => drawHistogram(pen, size, receivers, look),
  };
}
