// The water in colours: what 95 % of the errors at each place are within.
//
//   new Water(page)     .clear(), .show()

import { $, put } from "./dom.js";
import { length } from "./phrases.js";

// Matplotlib's viridis, from bright to dark, as the maps of `sblcosim map` have it.
const COLOURS = ["#fde725", "#90d743", "#35b779", "#21918c", "#31688e", "#443983", "#440154"];
const CELLS = 15; // along the longer side

export class Water {
  constructor(page) {
    Object.assign(this, { page, on: false });
    $("colour").addEventListener("click", () => { if (this.on) this.clear(); else this.compute(); });
  }

  clear() {
    this.on = false;
    this.cells = null;
    $("colour").setAttribute("aria-pressed", "false");
    $("water-scale").hidden = true;
    this.page.stage.state.under = null;
    this.page.stage.drawMap();
  }

  async compute() {
    const { page } = this, { explorer, stage } = page;
    this.on = true;
    $("colour").setAttribute("aria-pressed", "true");
    put($("water-words"), "computing …");
    $("water-scale").hidden = false;
    const result = await explorer.water(this.grid(stage), (part) => this.take(part));
    if (result) this.take(result);
  }

  // Square cells over what the map shows, at the diver's mean depth.
  grid({ run, view, state: { box } }) {
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

  // values [m] by row of north and column of east; NaN where it is not known yet.
  take(result) {
    if (!this.on) return;
    const known = Array.from(result.values).filter(Number.isFinite).sort((a, b) => a - b);
    const low = known[0] ?? 0, high = Math.max(known[Math.floor(0.95 * (known.length - 1))] ?? 1, low * 1.0001);
    this.cells = { ...result, low, high };
    const { done, n, depth } = result;
    put($("water-low"), length(low));
    put($("water-high"), length(high));
    put($("water-words"), `95 % error of ${this.page.explorer.receivers[0]} at ${depth} m depth`
      + (done < n ? `, ${Math.round(100 * done / n)} % done` : ""));
    this.page.stage.state.under = (pen, view) => this.draw(pen, view);
    this.page.stage.drawMap();
  }

  draw(pen, view) {
    const { north, east, size, depth, values, low, high } = this.cells, half = size / 2;
    pen.save();
    pen.globalAlpha = 0.75;
    north.forEach((n, i) => east.forEach((e, j) => {
      const value = values[i * east.length + j];
      if (!Number.isFinite(value)) return;
      pen.fillStyle = colourOf((value - low) / (high - low));
      pen.beginPath();
      [[n - half, e - half], [n - half, e + half], [n + half, e + half], [n + half, e - half]].forEach(([x, y], k) => {
        const at = view.project(x, y, depth);
        if (k) pen.lineTo(...at); else pen.moveTo(...at);
      });
      pen.closePath();
      pen.fill();
    }));
    pen.restore();
  }
}

export function colourOf(share) {
  const at = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1), i = Math.min(Math.floor(at), COLOURS.length - 2);
  const part = (colour, k) => parseInt(colour.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => Math.round(
    part(COLOURS[i], k) + (at - i) * (part(COLOURS[i + 1], k) - part(COLOURS[i], k))));
  return `rgb(${mixed.join(",")})`;
}
