// The water in colours: what 95 % of the errors at each place are within, or what is possible there, over
// what the map shows.
//
//   new Water(page)     .clear(), .on
//   .outdate()            the settings are others: the colours turn pale, and words say why
//   .isOld                whether they are to be computed again
//   .isRunning            whether some are being computed
//
// With a limit [m], two colours: where the error is within it, and where it is not.

import { $, put } from "./dom.js";
import { line } from "../../web/js/pen.js";
import { length, share } from "./phrases.js";

// Matplotlib's viridis, from bright to dark, as the maps of `sblcosim map` have it.
const COLOURS = ["#fde725", "#90d743", "#35b779", "#21918c", "#31688e", "#443983", "#440154"];
const WITHIN = "#35b779", BEYOND = "#e69f00";
const CELLS = 15; // along the longer side
const PAUSE = 400; // ms without a move before what is seen then is computed
const CLEAR = 0.75, PALE = 0.25; // of old colours
const OLD = "out of date: of other settings; coloured again after the dives …";
const SPARE = 0.02, LARGER = 2; // of what is seen: missing, and times its size, without another one

export class Water {
  constructor(page) {
    Object.assign(this, { page, on: false, isOld: false, cells: null, before: null, limit: null });
    $("colour").addEventListener("click", () => { if (this.on) this.clear(); else this.compute(); });
    $("water-limit").addEventListener("change", () => this.confine());
    $("water-what").addEventListener("change", () => {
      Object.assign(this, { isOld: false, cells: null, before: null }); // of another quantity
      if (this.on) this.compute();
    });
  }

  clear() {
    Object.assign(this, { on: false, isOld: false, cells: null, before: null, grid: null });
    clearTimeout(this.timer);
    $("colour").setAttribute("aria-pressed", "false");
    $("water-scale").hidden = true;
    this.page.stage.state.under = null;
    this.page.stage.drawMap();
  }

  outdate() {
    if (!this.on) return;
    clearTimeout(this.timer);
    Object.assign(this, { isOld: true, grid: null }); // what runs is no longer wanted
    put($("water-words"), OLD);
    this.page.stage.drawMap();
  }

  get isRunning() { return this.on && (this.isOld || !this.cells || this.cells.done < this.cells.n); }

  async compute() {
    const { explorer, stage } = this.page, grid = this.grid = gridOf(stage);
    this.on = true;
    if (!this.isOld) {
      this.before = this.cells ?? this.before;
      this.cells = null;
    }
    $("colour").setAttribute("aria-pressed", "true");
    put($("water-words"), this.isOld ? OLD : "computing …");
    $("water-scale").hidden = false;
    const wanted = () => this.grid === grid;
    const result = await explorer.water(grid, (part) => this.take(part), wanted, $("water-what").value);
    if (!wanted() || !result) return;
    if (result.why) {
      Object.assign(this, { isOld: false, cells: null, before: null });
      put($("water-words"), result.why);
      stage.drawMap();
    } else this.take(result);
  }

  // values [m] by row of north and column of east; NaN where it is not known yet, Infinity where no
  // accuracy is.
  take(result) {
    if (this.isOld) this.before = null;
    this.isOld = false;
    this.cells = result;
    if (result.done === result.n) this.before = null;
    this.show();
  }

  confine() {
    const text = $("water-limit").value.trim(), limit = Number(text.replace(",", "."));
    const fits = text === "" || limit > 0 && limit < Infinity;
    $("water-problem").hidden = fits;
    $("water-limit").setAttribute("aria-invalid", String(!fits));
    put($("water-problem"), fits ? "" : `limit: must be a number above 0, got '${text}'`);
    if (!fits) return;
    this.limit = text === "" ? null : limit;
    this.show();
  }

  // What the colours mean, for the page and for pictures of the map.
  get scale() {
    const all = Array.from(this.cells.values).filter((it) => !Number.isNaN(it));
    const known = all.filter(Number.isFinite).sort((a, b) => a - b);
    const low = known[0] ?? 0, high = Math.max(known[Math.floor(0.95 * (known.length - 1))] ?? 1, low * 1.0001);
    const within = all.filter((it) => it <= this.limit).length / all.length, none = 1 - known.length / all.length;
    return { none, low, high, within, colour: (value) => this.limit === null
      ? colourOf((value - low) / (high - low)) : value <= this.limit ? WITHIN : BEYOND };
  }

  show() {
    if (!this.cells) return;
    const { limit, cells: { done, n, depth, words = [] } } = this, { low, high, within, none } = this.scale;
    $("water-bar").classList.toggle("two", limit !== null);
    put($("water-low"), limit === null ? length(low) : `within ${length(limit)}`);
    put($("water-high"), limit === null ? length(high) : "beyond");
    put($("water-words"), (limit === null ? "" : `${share(within)} of the water shown is within it: `)
      + `${this.quantity} at ${depth} m depth`
      + (words.length ? `; left out: ${words.join(", ")}` : "")
      + (none > 0 ? `; no ${this.isPossible ? "accuracy" : "estimates"} in ${share(none)} of it` : "")
      + (done < n ? `, ${Math.round(100 * done / n)} % done` : ""));
    const { stage } = this.page;
    stage.state.under = Object.assign((pen, view) => this.draw(pen, view), { legend: this.legend });
    stage.drawMap();
  }

  get isPossible() { return $("water-what").value === "possible"; }

  get quantity() {
    return this.isPossible ? "95 % error of a perfect receiver" : `95 % error of ${this.page.explorer.receivers[0]}`;
  }

  get legend() {
    const { low, high, colour } = this.scale, mark = "area", { limit } = this;
    const middle = (low + high) / 2, of = this.isPossible ? "possible 95 % error" : "95 % error";
    return limit === null
      ? [low, middle, high].map((it) => ({ label: `${of} ${length(it)}`, colour: colour(it), dash: [], mark }))
      : [{ label: `${of} within ${length(limit)}`, colour: WITHIN, dash: [], mark },
        { label: "beyond", colour: BEYOND, dash: [], mark }];
  }

  draw(pen, view) {
    this.follow();
    pen.save();
    pen.globalAlpha = this.isOld ? PALE : CLEAR;
    const { colour } = this.cells ? this.scale : {};
    for (const cells of [this.before, this.cells]) if (cells && colour) drawCells(pen, view, cells, colour, this.limit !== null);
    pen.globalAlpha = 1;
    if (this.cells && this.limit !== null) drawBorder(pen, view, this.cells, this.limit);
    pen.restore();
  }

  // Another grid where the map shows much that has no colour, or much less than is coloured.
  follow() {
    const { stage } = this.page;
    if (!this.grid || this.isOld || isCovered(gridOf(stage), this.grid)) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      if (this.on && !isCovered(gridOf(stage), this.grid)) this.compute();
    }, PAUSE);
  }
}

// Square cells over what the map shows, at the diver's mean depth.
function gridOf({ run, view, state: { box } }) {
  const seen = [view.under(0, view.height), view.under(view.width, 0)];
  const [low, high] = view.isPlan ? seen : [box.low, box.high];
  const size = Math.max(high[0] - low[0], high[1] - low[1]) / CELLS;
  const along = (k) => {
    const count = Math.max(Math.ceil((high[k] - low[k]) / size - 1e-9), 1);
    const middle = (low[k] + high[k]) / 2;
    return Array.from({ length: count }, (_, i) => Math.round((middle + (i - (count - 1) / 2) * size) * 100) / 100);
  };
  const depths = Array.from(run.diver.z), depth = depths.reduce((sum, z) => sum + z / depths.length, 0);
  return { north: along(0), east: along(1), size, depth: Math.round(depth * 10) / 10 };
}

function isCovered(seen, grid) {
  const reach = ({ size }, axis) => [axis[0] - size / 2, axis.at(-1) + size / 2];
  return grid.size <= LARGER * seen.size && ["north", "east"].every((name) => {
    const [low, high] = reach(seen, seen[name]), [least, most] = reach(grid, grid[name]);
    const spare = SPARE * (high - low) + grid.size / 2;
    return low >= least - spare && high <= most + spare;
  });
}

function drawCells(pen, view, { north, east, size, depth, values }, colour, beyond) {
  const half = size / 2;
  north.forEach((n, i) => east.forEach((e, j) => {
    const value = values[i * east.length + j];
    if (Number.isNaN(value) || (value === Infinity && !beyond)) return;
    pen.fillStyle = colour(value);
    pen.beginPath();
    [[n - half, e - half], [n - half, e + half], [n + half, e + half], [n + half, e - half]].forEach(([x, y], k) => {
      const at = view.project(x, y, depth);
      if (k) pen.lineTo(...at); else pen.moveTo(...at);
    });
    pen.closePath();
    pen.fill();
  }));
}

// Between cells within the limit and others.
function drawBorder(pen, view, { north, east, size, depth, values }, limit) {
  const half = size / 2, at = (i, j) => values[i * east.length + j] <= limit;
  const known = (i, j) => !Number.isNaN(values[i * east.length + j]);
  pen.strokeStyle = "#fff"; // tracks are dark
  pen.lineWidth = 1.5;
  const side = (i, j, k, l, from, to) => {
    if (k < north.length && l < east.length && known(i, j) && known(k, l) && at(i, j) !== at(k, l))
      line(pen, [from, to].map(([x, y]) => view.project(x, y, depth)), 0);
  };
  north.forEach((n, i) => east.forEach((e, j) => {
    side(i, j, i + 1, j, [n + half, e - half], [n + half, e + half]);
    side(i, j, i, j + 1, [n - half, e + half], [n + half, e + half]);
  }));
}

export function colourOf(share) {
  const at = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1), i = Math.min(Math.floor(at), COLOURS.length - 2);
  const part = (colour, k) => parseInt(colour.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => Math.round(
    part(COLOURS[i], k) + (at - i) * (part(COLOURS[i + 1], k) - part(COLOURS[i], k))));
  return `rgb(${mixed.join(",")})`;
}
