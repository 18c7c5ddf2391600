// The map of a run at a time: path, platform, estimates with their ellipses.
//
//   boxOf(run, shown)                       what a view should show: {low, high}, points [m]
//   drawMap(pen, view, run, state, look)    draws it all
//
// `state` has `time`, `shown`, a flag for each receiver, and if anything is below the drawing,
// `under(pen, view)`, with its `legend` for pictures; `look` is of `style.js`.

import { factorOf, indexAt, pointAt, standing, wavePointAt } from "./data.js";
import { decimal, line, roundStep, ticks, write } from "./pen.js";

// Standard deviations that hold 95 % of a normal error in a plane, and in space.
const REACH_PLANE = 2.4477, REACH_SPACE = 2.7955;
const PAST_ELLIPSES = 12, MOST_WITH_PAST = 2;
export const WAY = [2, 4]; // dashes of a boat's way
const MARGINS = { left: 34, right: 14, top: 14, bottom: 24 };

const rows = (track) => Array.from(track.x, (_, i) => [track.x[i], track.y[i], track.z[i]]);
const known = (values) => Array.from(values).filter((v) => !Number.isNaN(v));

// Truth and beacons, and estimates near them: as far beyond as half of their extent, at least 3 m.
export function boxOf(run, shown) {
  const keys = ["x", "y", "z"];
  const seen = [run.diver, ...run.beacons, ...run.reported].filter(Boolean);
  const some = run.receivers.filter((it, i) => shown[i] && it.epoch.length);
  const main = some.filter((it) => !it.fix).length ? some.filter((it) => !it.fix) : some;
  const ends = (values, least, most) => {
    let low = least, high = most;
    for (const v of values) { if (v < low) low = v; if (v > high) high = v; }
    return [low, high];
  };
  const sure = keys.map((k) => seen.reduce(
    ([low, high], track) => ends(track[k], low, high), [Infinity, -Infinity]));
  if (!seen.length) keys.forEach((k, i) => { sure[i] = middleOf(main, k); });
  const reach = Math.max(...sure.map(([low, high]) => high - low)) / 2;
  const box = keys.map((k, i) => {
    const far = Math.max(reach, 3), [low, high] = sure[i];
    return main.reduce(([a, b], it) => {
      const [c, d] = ends(known(it.position[k]), low, high);
      return [Math.min(a, Math.max(c, low - far)), Math.max(b, Math.min(d, high + far))];
    }, [low, high]);
  });
  return {
    low: box.map(([low, high]) => low - Math.max(0.04 * (high - low), (1 - high + low) / 2, 0)),
    high: box.map(([low, high]) => high + Math.max(0.04 * (high - low), (1 - high + low) / 2, 0)),
  };
}

// Where most estimates are.
function middleOf(receivers, key) {
  const values = receivers.flatMap((it) => known(it.position[key])).sort((a, b) => a - b);
  if (!values.length) return [0, 1];
  const at = (share) => values[Math.round(share * (values.length - 1))];
  return [at(0.01), at(0.99)];
}

export function drawMap(pen, view, run, state, look) {
  view.fit(state.box, view.width, view.height, MARGINS);
  pen.save();
  pen.beginPath();
  pen.rect(0, 0, view.width, view.height);
  pen.clip();
  pen.fillStyle = look.water;
  pen.fillRect(0, 0, view.width, view.height);
  pen.lineJoin = "round";
  state.under?.(pen, view);
  (view.isPlan ? drawPlanGrid : drawSpace)(pen, view, run, state, look);
  if (run.sails) drawWay(pen, view, run, state.time, look);
  drawPath(pen, view, run, state.time, look);
  const shown = run.receivers.filter((it, i) => state.shown[i]).reverse(); // the main one on top
  for (const it of shown) drawTrail(pen, view, it, state, look);
  if (run.reported.length) drawBeacons(pen, view, run, run.reported, state.time, look, true);
  if (run.beacons.length) drawBeacons(pen, view, run, run.beacons, state.time, look, false);
  for (const it of shown) drawEstimate(pen, view, run, it, state, look);
  if (run.diver) drawDiver(pen, view, run, state.time, look);
  drawLabels(pen, view, run, look);
  pen.restore();
}

function drawPlanGrid(pen, view, run, state, look) {
  const step = roundStep(90 / view.scale);
  const [north, west] = view.under(0, 0), [south, east] = view.under(view.width, view.height);
  pen.strokeStyle = look.grid;
  pen.lineWidth = 1;
  for (const y of ticks(west, east, step)) {
    const [x] = view.project(0, y, 0);
    line(pen, [[x, 0], [x, view.height]]);
  }
  for (const x of ticks(south, north, step)) {
    const [, y] = view.project(x, 0, 0);
    line(pen, [[0, y], [view.width, y]]);
  }
}

// The surface of the water as a grid, the path's shadow on the floor of the box, and where the diver
// is between them.
function drawSpace(pen, view, run, state, look) {
  const { low, high } = state.box, step = roundStep(Math.hypot(high[0] - low[0], high[1] - low[1]) / 8);
  pen.strokeStyle = look.grid;
  pen.lineWidth = 1;
  for (const x of [low[0], ...ticks(low[0], high[0], step), high[0]]) {
    line(pen, [view.project(x, low[1], 0), view.project(x, high[1], 0)]);
  }
  for (const y of [low[1], ...ticks(low[1], high[1], step), high[1]]) {
    line(pen, [view.project(low[0], y, 0), view.project(high[0], y, 0)]);
  }
  const corner = ([i, j], z) => view.project(i ? high[0] : low[0], j ? high[1] : low[1], z);
  const round = [[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]];
  line(pen, round.map((at) => corner(at, high[2])));
  for (const at of round) line(pen, [corner(at, 0), corner(at, high[2])]);
  pen.save();
  pen.globalAlpha = 0.08;
  pen.fillStyle = look.surface;
  pen.beginPath();
  round.forEach((at, i) => { if (i) pen.lineTo(...corner(at, 0)); else pen.moveTo(...corner(at, 0)); });
  pen.fill();
  pen.restore();
  if (!run.diver) return;
  pen.save();
  pen.globalAlpha = 0.5;
  pen.strokeStyle = look.soft;
  line(pen, rows(run.diver).map(([x, y]) => view.project(x, y, high[2])));
  const [x, y] = pointAt(run.diver, run.time, state.time);
  if (Number.isNaN(x + y)) { pen.restore(); return; }
  pen.setLineDash([2, 3]);
  line(pen, [view.project(x, y, 0), view.project(x, y, high[2])]);
  pen.restore();
}

// The true path: what is to come is faint.
function drawPath(pen, view, run, time, look) {
  if (!run.diver) return;
  const now = indexAt(run.time, time);
  const path = rows(run.diver).map((p) => view.project(...p));
  pen.strokeStyle = look.soft;
  pen.globalAlpha = 0.45;
  pen.lineWidth = 1.2;
  line(pen, path.slice(Math.max(now, 0)));
  pen.globalAlpha = 1;
  pen.strokeStyle = look.ink;
  pen.lineWidth = 1.6;
  line(pen, [...path.slice(0, now + 1), view.project(...pointAt(run.diver, run.time, time))]);
}

const middleOfBeacons = ({ beacons }, at) =>
  [0, 1, 2].map((k) => beacons.reduce((sum, it) => sum + at(it)[k] / beacons.length, 0));

/** Where a boat is: the middle of its beacons. */
export const boatAt = (run, time) => middleOfBeacons(run, (it) => pointAt(it, run.time, time));

function drawWay(pen, view, run, time, look) {
  const way = Array.from(run.time, (_, i) => view.project(...middleOfBeacons(run, ({ x, y, z }) => [x[i], y[i], z[i]])));
  const now = Math.max(indexAt(run.time, time), 0);
  pen.save();
  pen.strokeStyle = look.ink;
  pen.lineWidth = 1.4;
  pen.setLineDash(WAY);
  line(pen, [...way.slice(0, now + 1), view.project(...boatAt(run, time))]);
  pen.globalAlpha = 0.45;
  line(pen, way.slice(now));
  pen.restore();
}

// All estimates up to now: a line, or dots.
function drawTrail(pen, view, receiver, state, look) {
  const now = indexAt(receiver.since, state.time);
  const { x, y, z } = receiver.position;
  const points = Array.from({ length: now + 1 }, (_, i) => view.project(x[i], y[i], z[i]));
  const colour = look.of(receiver);
  pen.save();
  if (receiver.fix) {
    pen.globalAlpha = 0.7;
    pen.fillStyle = colour;
    pen.beginPath();
    for (const [px, py] of points) if (inside(view, px, py)) pen.rect(px - 1.1, py - 1.1, 2.2, 2.2);
    pen.fill();
  } else {
    pen.globalAlpha = 0.85;
    pen.strokeStyle = colour;
    pen.lineWidth = 1.4;
    pen.setLineDash(receiver.dash.map((d) => d * pen.lineWidth));
    line(pen, points, 1.5);
    pen.setLineDash([]);
    const filters = state.shown.filter((on, i) => on && !state.fixes[i]).length;
    if (receiver.factor && filters <= MOST_WITH_PAST) {
      pen.globalAlpha = 0.35;
      pen.lineWidth = 1;
      const every = Math.max(Math.ceil(receiver.epoch.length / PAST_ELLIPSES), 1);
      for (let i = every >> 1; i <= now; i += every) ellipse(pen, view, receiver, i);
    }
  }
  pen.restore();
}

function ellipse(pen, view, receiver, i) {
  const L = factorOf(receiver, i);
  if (!L) return;
  const { x, y, z } = receiver.position;
  line(pen, view.outline([x[i], y[i], z[i]], L, view.isPlan ? REACH_PLANE : REACH_SPACE));
}

// The estimate that stands now, its ellipse, and how far it is off.
function drawEstimate(pen, view, run, receiver, state, look) {
  const i = standing(run, receiver, state.time);
  if (i < 0) return;
  const { position: p, truth: q } = receiver, colour = look.of(receiver);
  const [px, py] = view.project(p.x[i], p.y[i], p.z[i]);
  pen.save();
  pen.strokeStyle = pen.fillStyle = colour;
  if (!receiver.fix) {
    pen.lineWidth = 2;
    ellipse(pen, view, receiver, i);
    if (q && !Number.isNaN(q.x[i])) {
      pen.lineWidth = 1;
      pen.globalAlpha = 0.8;
      line(pen, [[px, py], view.project(q.x[i], q.y[i], q.z[i])], 0);
      pen.globalAlpha = 1;
    }
  }
  pen.lineWidth = 1.5;
  pen.strokeStyle = look.paper;
  pen.beginPath();
  pen.arc(px, py, receiver.fix ? 3.5 : 5, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
  pen.restore();
}

function drawBeacons(pen, view, run, beacons, time, look, reported) {
  const at = beacons.map((it) => reported
    ? pointAt(it, run.time, time, true) : wavePointAt(it, run.time, time));
  const places = at.map((p) => view.project(...p)).filter(([x, y]) => !Number.isNaN(x + y));
  const middle = view.project(...[0, 1, 2].map((k) => at.reduce((sum, p) => sum + p[k] / at.length, 0)));
  const colour = reported ? look.soft : look.ink;
  pen.save();
  pen.strokeStyle = colour;
  pen.lineWidth = 1.5;
  if (run.arms) {
    pen.setLineDash(reported ? [4, 3] : []);
    for (const place of places) line(pen, [middle, place], 0);
  }
  pen.setLineDash([]);
  for (const [x, y] of places) {
    const up = reported ? -1 : 1;
    pen.beginPath();
    pen.moveTo(x, y - 5 * up);
    pen.lineTo(x + 4.5, y + 3.5 * up);
    pen.lineTo(x - 4.5, y + 3.5 * up);
    pen.closePath();
    pen.fillStyle = reported ? look.paper : colour;
    pen.fill();
    pen.stroke();
  }
  pen.restore();
}

function drawDiver(pen, view, run, time, look) {
  const [x, y] = view.project(...pointAt(run.diver, run.time, time));
  if (Number.isNaN(x + y)) return;
  pen.save();
  pen.beginPath();
  pen.arc(x, y, 5.5, 0, 2 * Math.PI);
  pen.fillStyle = look.paper;
  pen.fill();
  pen.lineWidth = 2.5;
  pen.strokeStyle = look.ink;
  pen.stroke();
  pen.restore();
}

function drawLabels(pen, view, run, look) {
  pen.font = look.font(11);
  if (view.isPlan) {
    const step = roundStep(90 / view.scale), digits = step < 1 ? 1 : 0;
    const [north, west] = view.under(0, 0), [south, east] = view.under(view.width, view.height);
    pen.textAlign = "center";
    for (const y of ticks(west, east, step)) {
      const [px] = view.project(0, y, 0);
      if (px > 40 && px < view.width - 78) {
        write(pen, decimal(y, digits), px, view.height - 7, look.soft, look.water);
      }
    }
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const x of ticks(south, north, step)) {
      const [, py] = view.project(x, 0, 0);
      if (py > 30 && py < view.height - 20) {
        write(pen, decimal(x, digits), 6, py, look.soft, look.water);
      }
    }
    pen.textBaseline = "alphabetic";
    pen.font = look.font(11, true);
    write(pen, `${run.axes[0]} [m] ↑`, 6, 17, look.ink, look.water);
    pen.textAlign = "right";
    write(pen, `${run.axes[1]} [m] →`, view.width - 6, view.height - 7, look.ink, look.water);
  } else {
    drawScale(pen, view, look);
    const { low, high } = view.box;
    pen.font = look.font(11, true);
    pen.textAlign = "center";
    const [e, n] = [(low[1] + high[1]) / 2, (low[0] + high[0]) / 2];
    write(pen, run.axes[0], ...view.project(high[0] + 0.06 * (high[0] - low[0]), e, 0), look.ink, look.water);
    write(pen, run.axes[1], ...view.project(n, high[1] + 0.06 * (high[1] - low[1]), 0), look.ink, look.water);
    pen.textAlign = "left";
    pen.textAlign = "right";
    const text = `box down to ${decimal(high[2], high[2] < 10 ? 1 : 0)} m`;
    write(pen, text, view.width - 8, view.height - 10, look.soft, look.water);
  }
  pen.textAlign = "left";
}

function drawScale(pen, view, look) {
  const length = roundStep(50 / view.scale), px = length * view.scale, y = view.height - 10;
  pen.strokeStyle = look.ink;
  pen.lineWidth = 1.5;
  line(pen, [[8, y], [8 + px, y]], 0);
  pen.textAlign = "left";
  write(pen, `${decimal(length, length < 1 ? 1 : 0)} m`, 8, y - 5, look.ink, look.water);
}

const inside = (view, x, y) => x > -5 && y > -5 && x < view.width + 5 && y < view.height + 5;
