// All runs as a histogram of errors; it grows while they run.
//
//   drawHistogram(pen, { width, height }, receivers, look)
//
// `receivers` have label, colour, dash, histogram { edges [m], shares } and p95 [m]; the first one
// has bars, the others outlines.

import { decimal, line, roundStep, ticks, write } from "../../web/js/pen.js";
import { length } from "./phrases.js";

const MARGINS = { left: 12, right: 12, top: 24, bottom: 34 };

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

// Where the 95 % are; labels of later receivers are lower, so that none cover each other.
function drawMarks(pen, receivers, x, { top, floor, width }, look) {
  pen.font = look.font(11, true);
  receivers.forEach((it, i) => {
    const at = x(it.p95), low = top - 10 + 15 * i;
    if (!Number.isFinite(at) || at > width - 12) return;
    pen.strokeStyle = look.of(it);
    pen.lineWidth = 1.6;
    line(pen, [[at, low + 4], [at, floor]], 0);
    const left = at > width - 110;
    pen.textAlign = left ? "right" : "left";
    write(pen, `95 % within ${length(it.p95)}`, at + (left ? -5 : 5), low + 4, look.ink, look.paper);
  });
  pen.textAlign = "left";
}
