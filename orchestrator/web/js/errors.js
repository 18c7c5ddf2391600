// The errors of a run over time, with what receivers claim, and a cursor.
//
//   new ErrorPlot(run)                  measures once for each kind of error
//   .resize(width, height, state)       sets limits for what is shown
//   .draw(pen, state, look)             all but the cursor
//   .drawCursor(pen, state, look)       the time, and a dot on each curve
//   .timeAt(x)                          time under a place [px]
//
// `state` has `time`, `shown`, a flag for each receiver, and `kind`, one of data.KINDS. Without a
// truth, the claims are all there is.

import { KINDS, claimOf, errorOf, standing } from "./data.js";
import { decimal, line, roundStep, ticks, write } from "./pen.js";
import { unitOf } from "./words.js";

const MARGINS = { left: 46, right: 12, top: 22, bottom: 34 };
const MOST_BANDS = 2;

const known = (values) => values.filter((v) => !Number.isNaN(v));

// The value that a share of the values does not exceed; 0 without any.
function quantile(values, share) {
  const sorted = known(values).map(Math.abs).sort((a, b) => a - b);
  return sorted.length ? sorted[Math.ceil(share * sorted.length) - 1] : 0;
}

export class ErrorPlot {
  constructor(run) {
    this.run = run;
    this.measured = {};
    this.unit = unitOf(run.stop - run.start);
  }

  // Errors and claims of all receivers, of a kind.
  curves(kind) {
    this.measured[kind] ??= this.run.receivers.map((it) => {
      const each = Array.from(it.epoch, (_, i) => i);
      return { error: each.map((i) => errorOf(it, i, kind)), claim: each.map((i) => claimOf(it, i, kind)) };
    });
    return this.measured[kind];
  }

  // Filters' errors without outliers, and most of their claims, as in the figures of a run.
  resize(width, height, state) {
    Object.assign(this, { width, height });
    const all = this.curves(state.kind).map((curve, i) => ({ ...curve, fix: this.run.receivers[i].fix }))
      .filter((_, i) => state.shown[i]);
    const some = all.some((it) => !it.fix) ? all.filter((it) => !it.fix) : all;
    const tops = some.flatMap(({ error, claim }) => [
      Math.min(quantile(error, 1), 4 * quantile(error, 0.95)), quantile(claim, 0.9),
    ]);
    this.top = Math.max(1.1 * Math.max(...tops, 0), 1e-3);
    this.bottom = ["x", "y", "z"].includes(state.kind) ? -this.top : 0;
    if (!tops.some((top) => top > 0)) this.top = 1;
  }

  x(t) {
    const { left, right } = MARGINS, span = this.run.stop - this.run.start || 1;
    return left + (this.width - left - right) * (t - this.run.start) / span;
  }

  y(value) {
    const { top, bottom } = MARGINS;
    return top + (this.height - top - bottom) * (this.top - value) / (this.top - this.bottom);
  }

  timeAt(x) {
    const { left, right } = MARGINS, share = (x - left) / (this.width - left - right);
    return this.run.start + Math.min(Math.max(share, 0), 1) * (this.run.stop - this.run.start);
  }

  draw(pen, state, look) {
    pen.fillStyle = look.paper;
    pen.fillRect(0, 0, this.width, this.height);
    this.drawAxes(pen, state, look);
    const { left, right, top, bottom } = MARGINS;
    pen.save();
    pen.beginPath();
    pen.rect(left, top, this.width - left - right, this.height - top - bottom);
    pen.clip();
    pen.lineJoin = "round";
    const curves = this.curves(state.kind);
    const filters = this.run.receivers.filter((it, i) => state.shown[i] && !it.fix).length;
    const some = this.run.receivers.map((it, i) => [it, curves[i]]).filter((_, i) => state.shown[i]);
    for (const [it, curve] of some) if (!it.fix) this.drawClaim(pen, it, curve, filters, look);
    for (const [it, curve] of [...some].reverse()) this.drawErrors(pen, it, curve, look);
    pen.restore();
  }

  drawAxes(pen, state, look) {
    const { left, right, top, bottom } = MARGINS, end = this.width - right, floor = this.height - bottom;
    pen.font = look.font(11);
    pen.lineWidth = 1;
    const step = roundStep(46 * (this.top - this.bottom) / (floor - top));
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of ticks(this.bottom, this.top, step)) {
      pen.strokeStyle = Math.abs(value) < step / 2 ? look.soft : look.grid;
      line(pen, [[left, this.y(value)], [end, this.y(value)]], 0);
      write(pen, decimal(value, digits), left - 6, this.y(value), look.ink, look.paper);
    }
    const { seconds, name } = this.unit, { start, stop } = this.run;
    const every = roundStep(80 * (stop - start) / seconds / Math.max(end - left, 1));
    const places = Math.max(0, -Math.floor(Math.log10(every) + 1e-9));
    pen.textBaseline = "alphabetic";
    pen.textAlign = "center";
    for (const t of ticks(start / seconds, stop / seconds, every)) {
      const x = this.x(t * seconds);
      pen.strokeStyle = look.grid;
      line(pen, [[x, top], [x, floor]], 0);
      write(pen, decimal(t, places), x, floor + 14, look.ink, look.paper);
    }
    pen.textAlign = "right";
    write(pen, `Time [${name}]`, end, this.height - 4, look.soft, look.paper);
    pen.textAlign = "left";
    write(pen, `${KINDS[state.kind]} [m]`, 4, top - 10, look.soft, look.paper);
  }

  // A band from zero, or about it; of many filters, its edges alone.
  drawClaim(pen, receiver, { claim }, filters, look) {
    const edges = this.bottom < 0 ? [1, -1] : [1];
    const edge = (sign) => claim.map((v, i) => Number.isNaN(v)
      ? null : [this.x(receiver.epoch[i]), this.y(sign * Math.min(v, 2 * this.top))]);
    pen.save();
    pen.strokeStyle = pen.fillStyle = look.of(receiver);
    if (filters <= MOST_BANDS) {
      pen.globalAlpha = 0.15;
      for (const part of parts(edge(1))) this.fillBand(pen, part);
    }
    pen.globalAlpha = 0.7;
    pen.lineWidth = 0.8;
    pen.setLineDash(receiver.dash);
    for (const sign of edges) line(pen, edge(sign));
    pen.restore();
  }

  fillBand(pen, part) {
    const zero = this.y(0);
    const back = part.map(([x, y]) => [x, this.bottom < 0 ? 2 * zero - y : zero]).reverse();
    pen.beginPath();
    [...part, ...back].forEach(([x, y], i) => { if (i) pen.lineTo(x, y); else pen.moveTo(x, y); });
    pen.closePath();
    pen.fill();
  }

  drawErrors(pen, receiver, { error }, look) {
    const points = error.map((v, i) => Number.isNaN(v) ? null : [this.x(receiver.epoch[i]), this.y(v)]);
    pen.save();
    if (receiver.fix) {
      pen.globalAlpha = 0.6;
      pen.fillStyle = look.of(receiver);
      pen.beginPath();
      for (const p of points) if (p) pen.rect(p[0] - 1, p[1] - 1, 2, 2);
      pen.fill();
    } else {
      pen.strokeStyle = look.of(receiver);
      pen.lineWidth = 1.5;
      pen.setLineDash(receiver.dash.map((d) => d * pen.lineWidth));
      line(pen, points);
    }
    pen.restore();
  }

  drawCursor(pen, state, look) {
    const x = this.x(state.time), { top, bottom } = MARGINS;
    pen.save();
    pen.strokeStyle = look.ink;
    pen.lineWidth = 1.5;
    line(pen, [[x, top], [x, this.height - bottom]], 0);
    const curves = this.curves(state.kind);
    this.run.receivers.forEach((it, i) => {
      const at = state.shown[i] ? standing(this.run, it, state.time) : -1;
      const value = at < 0 ? NaN : curves[i].error[at];
      if (it.fix || Number.isNaN(value) || value > this.top || value < this.bottom) return;
      pen.fillStyle = look.of(it);
      pen.strokeStyle = look.paper;
      pen.beginPath();
      pen.arc(this.x(it.epoch[at]), this.y(value), 4, 0, 2 * Math.PI);
      pen.fill();
      pen.stroke();
    });
    pen.restore();
  }
}

// Runs of points between gaps.
function parts(points) {
  const found = [[]];
  for (const point of points) if (point) found.at(-1).push(point); else found.push([]);
  return found.filter((part) => part.length > 1);
}
