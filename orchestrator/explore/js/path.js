// The diver's path: drawn on the map, typed as points, or read from a file.
//
//   new PathEditor(page)     .show()
//
// Points are north, east and depth in metres, rounded to centimetres.

import { $, put, shape } from "./dom.js";
import { readPath } from "./trackfile.js";
import { decimal } from "../../web/js/pen.js";

const NEAR = 9; // pixels between points of a line that is drawn
const SPARE = 0.15; // m by which a path with fewer points may miss the one that was drawn, at least
const rounded = (x) => Math.round(x * 100) / 100;

export class PathEditor {
  constructor(page) {
    Object.assign(this, { page, drawn: null });
    this.most = page.changes.keys.get("target.waypoint_m").rows[1];
    this.sketch = $("sketch");
    $("draw").addEventListener("click", () => { if (this.drawn) this.finish(); else this.begin(); });
    $("undo").addEventListener("click", () => { this.strokes.pop(); this.redraw(); });
    $("cancel-drawing").addEventListener("click", () => this.end());
    $("use-points").addEventListener("click", () => this.use(this.read($("points").value)));
    $("path-file").addEventListener("change", (event) => this.open(event.target.files[0]));
    $("reset-path").addEventListener("click", () => this.reset());
    this.listen();
    this.show();
  }

  listen() {
    this.sketch.addEventListener("pointerdown", (event) => {
      this.sketch.setPointerCapture(event.pointerId);
      this.strokes.push([]);
      this.add(event);
    });
    // A pointer that was pressed elsewhere draws nothing.
    this.sketch.addEventListener("pointermove", (event) => {
      if (event.buttons && this.strokes?.length) this.add(event);
    });
    document.addEventListener("keydown", (event) => {
      if (!this.drawn) return;
      if (event.key === "Escape") this.end();
      else if (event.key === "Enter" && event.target === document.body) this.finish();
    });
    const place = $("dive");
    const over = (on) => (event) => { event.preventDefault(); place.classList.toggle("dropping", on); };
    place.addEventListener("dragover", over(true));
    place.addEventListener("dragleave", over(false));
    place.addEventListener("drop", (event) => {
      over(false)(event);
      this.page.track.drop(event.dataTransfer.files[0]);
    });
  }

  // --- Drawing --------------------------------------------------------------------------------------

  begin() {
    const { stage } = this.page;
    stage.player.pause();
    if (!stage.view.isPlan) stage.turnTo(false);
    this.drawn = true;
    this.strokes = [];
    this.mode(true);
    this.redraw();
  }

  mode(on) {
    this.sketch.toggleAttribute("hidden", !on);
    for (const id of ["undo", "cancel-drawing", "drawing-note"]) $(id).hidden = !on;
    put($("draw"), on ? "Use this path" : "Draw a path");
    document.body.classList.toggle("drawing", on);
  }

  add(event) {
    const stroke = this.strokes.at(-1), last = stroke.at(-1) ?? this.strokes.at(-2)?.at(-1);
    const [x, y] = [event.offsetX, event.offsetY];
    if (last && Math.hypot(x - last[0], y - last[1]) < NEAR) return;
    stroke.push([x, y]);
    this.redraw();
  }

  redraw() {
    const places = this.strokes.flat(), { width, height } = this.page.stage.view;
    this.sketch.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.sketch.replaceChildren(
      shape("polyline", { points: places.map((it) => it.join(",")).join(" ") }),
      ...[places[0], places.at(-1)].filter(Boolean).map(([cx, cy], i) =>
        shape("circle", { cx, cy, r: i ? 6 : 4 })));
    $("undo").disabled = !this.strokes.length;
    $("draw").disabled = places.length < 2;
  }

  finish() {
    const { view } = this.page.stage, depth = this.depth();
    if (depth === null) return;
    const places = simplified(this.strokes.flat().map((it) => view.under(...it)), this.most);
    if (places.length > 1) this.use(places.map(([n, e]) => [n, e, depth]));
    this.end();
  }

  end() {
    this.drawn = null;
    $("draw").disabled = false;
    this.mode(false);
  }

  depth() {
    const depth = Number($("path-depth").value);
    const fits = $("path-depth").value.trim() !== "" && Number.isFinite(depth);
    this.tell(fits ? null : `depth: must be a number, got '${$("path-depth").value}'`);
    return fits ? depth : null;
  }

  // --- Points and files -----------------------------------------------------------------------------

  // Points of lines such as "-15, -20, 3", north, east and depth; null with a problem.
  read(text) {
    const lines = text.split("\n").map((line) => line.trim()).filter(Boolean);
    const points = lines.map((line) => line.split(/[\s,;]+/).filter(Boolean).map(Number));
    const wrong = points.findIndex((it) => it.length !== 3 || !it.every(Number.isFinite));
    if (wrong >= 0)
      this.tell(`point ${wrong + 1}: must be three numbers, north, east and depth, got '${lines[wrong]}'`);
    return wrong < 0 ? points : null;
  }

  async open(file) {
    if (!file) return;
    try {
      const { points, words } = readPath(
        await file.text(), file.name, { origin: this.origin, depth: this.depth() ?? undefined });
      const kept = simplified(points, this.most);
      this.use(kept, `${file.name}: ${kept.length} of ${words}`);
    } catch (error) {
      this.tell(`${file.name}: ${error.message}`);
    }
  }

  get origin() {
    const [latitude, longitude] = ["latitude_deg", "longitude_deg"].map(
      (key) => this.page.explorer.given.get(`place.${key}`));
    return latitude === undefined || longitude === undefined ? null : { latitude, longitude };
  }

  use(points, words = null) {
    if (!points) return;
    if (this.drawn) this.end();
    this.tell(this.page.explorer.setPath(points.map((it) => it.map(rounded))));
    put($("path-words"), words ?? "");
    this.page.changed();
  }

  reset() {
    const { changes } = this.page;
    this.tell(changes.reset(...changes.all.filter((it) => it.startsWith("target."))));
    this.page.changed();
  }

  tell(problem) {
    $("path-problem").hidden = !problem;
    put($("path-problem"), problem ?? "");
  }

  show() {
    const points = this.page.explorer.pathPoints;
    if (document.activeElement !== $("points"))
      $("points").value = points.map((it) => it.map((x) => String(rounded(x))).join(", ")).join("\n");
    if (document.activeElement !== $("path-depth") && points.length) {
      const mean = points.reduce((sum, it) => sum + it[2] / points.length, 0);
      $("path-depth").value = decimal(mean, 1);
    }
    $("reset-path").hidden = !this.page.changes.all.some((it) => /^target\.(trajectory|waypoint_m)$/.test(it));
  }
}

/** At most that many points of a line, those that matter most (Douglas and Peucker). */
export function simplified(points, most) {
  for (let spare = SPARE; ; spare *= 1.5) {
    const kept = [0, ...between(points, 0, points.length - 1, spare), points.length - 1];
    if (kept.length <= most) return [...new Set(kept)].map((i) => points[i]);
  }
}

function between(points, first, last, spare) {
  let far = spare, at = -1;
  for (let i = first + 1; i < last; i++) {
    const off = distance(points[i], points[first], points[last]);
    if (off > far) [far, at] = [off, i];
  }
  return at < 0 ? [] : [...between(points, first, at, spare), at, ...between(points, at, last, spare)];
}

// From a point to a line between two others, in all coordinates.
function distance(point, from, to) {
  const along = to.map((x, k) => x - from[k]), off = point.map((x, k) => x - from[k]);
  const length = along.reduce((sum, x) => sum + x * x, 0);
  const share = length ? along.reduce((sum, x, k) => sum + x * off[k], 0) / length : 0;
  const near = Math.min(Math.max(share, 0), 1);
  return Math.hypot(...off.map((x, k) => x - near * along[k]));
}
