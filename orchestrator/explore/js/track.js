// The boat's track: typed as points, or read from a file; and whose track a dropped file is.
//
//   new TrackEditor(page)     .show()
//   .drop(file)                 of the diver or of the boat: asks, if this page can have both
//
// Points are a time, north and east in metres and perhaps a heading, as in a scenario file.

import { motionOf } from "./boat.js";
import { $, put } from "./dom.js";
import { interpolated, lastAt } from "./series.js";
import { readPath } from "./trackfile.js";

const TOLERANCE = 0.1; // m by which the motion may miss a recorded point, at least
const ARM = 1; // m: on it, headings are as exact as places
const TURN = 10; // s in which a boat turns at a corner
const CLOSE = 1e-3; // s between times that are one
const DEGREES = 180 / Math.PI;
const KEYS = /^platform\.(track_|departure_time|boat_)/;

export class TrackEditor {
  constructor(page) {
    Object.assign(this, { page, dropped: null });
    this.most = page.explorer.mostPoints; // 0: the page cannot have a track
    $("boat").hidden = !this.most;
    $("use-boat").addEventListener("click", () => this.use(this.read($("boat-points").value)));
    $("boat-file").addEventListener("change", (event) => this.open(event.target.files[0]));
    $("reset-boat").addEventListener("click", () => this.reset());
    for (const [id, act] of [["of-the-diver", (it) => page.path.open(it)],
      ["of-the-boat", (it) => this.open(it)], ["of-nobody", () => {}]])
      $(id).addEventListener("click", () => {
        const file = this.dropped;
        this.asks(null);
        act(file);
      });
    $("ask-whose").addEventListener("keydown", (event) => { if (event.key === "Escape") this.asks(null); });
  }

  drop(file) {
    if (this.most && file) this.asks(file); else this.page.path.open(file);
  }

  asks(file) {
    this.dropped = file;
    $("ask-whose").hidden = !file;
    put($("whose-file"), file ? `${file.name} is of` : "");
    if (file) $("of-the-diver").focus(); else $("map").focus();
  }

  // Points of lines such as "20, -15, 3.5, 90"; null with a problem.
  read(text) {
    const lines = text.split("\n").map((line) => line.trim()).filter(Boolean);
    const points = lines.map((line) => line.split(/[\s,;]+/).filter(Boolean).map(Number));
    const width = points[0]?.length === 3 ? 3 : 4;
    const wrong = points.findIndex((it) => it.length !== width || !it.every(Number.isFinite));
    if (wrong >= 0)
      this.tell(`point ${wrong + 1}: must be ${width === 3 ? "three" : "four"} numbers, time, north, east`
        + `${width === 3 ? "" : " and heading"}, as the first one is, got '${lines[wrong]}'`);
    return wrong < 0 ? points : null;
  }

  async open(file) {
    if (!file) return;
    const { explorer, path: { origin } } = this.page;
    try {
      const found = readPath(await file.text(), file.name, { origin, isBoat: true });
      const heading = explorer.given.get("platform.mean_heading_deg");
      if (heading !== undefined && found.headings)
        throw new Error(`[platform] mean_heading_deg: must be left out, as it has headings (heading_deg), got ${heading}`);
      const kept = thinned(found, this.most, heading === undefined);
      this.use(kept, `${file.name}: ${kept.length} points of ${found.words}`);
    } catch (error) {
      this.tell(`${file.name}: ${error.message}`);
    }
    $("boat-file").value = ""; // so that the same file can be opened again
  }

  use(points, words = "") {
    if (!points) return;
    this.tell(this.page.explorer.setTrack(points));
    put($("boat-words"), words);
    this.page.changed();
  }

  reset() {
    const { changes } = this.page;
    this.tell(changes.reset(...changes.all.filter((it) => KEYS.test(it))));
    put($("boat-words"), "");
    this.page.changed();
  }

  tell(problem) {
    $("boat-problem").hidden = !problem;
    put($("boat-problem"), problem ?? "");
  }

  show() {
    const { explorer, changes } = this.page;
    if (document.activeElement !== $("boat-points"))
      $("boat-points").value = explorer.track.map((it) => it.map((x) => String(Number(x.toFixed(3)))).join(", ")).join("\n");
    $("reset-boat").hidden = !changes.all.some((it) => KEYS.test(it));
    document.body.classList.toggle("under-way", explorer.isUnderWay);
  }
}

// Rows of a track with at most that many points: those that the motion needs to stay near all of them.
// Without headings of its own, the boat points where it goes if it turns.
function thinned({ times, points, headings }, most, turns) {
  const at = headings || !turns ? times : among(times), place = interpolated(times, points.map((_, i) => i));
  const along = at.map((time) => {
    const i = place(time), low = Math.floor(i), high = Math.min(low + 1, points.length - 1);
    return [0, 1].map((k) => points[low][k] + (i - low) * (points[high][k] - points[low][k]));
  });
  const turned = headings ? unwrapped(headings.map((it) => it / DEGREES)) : turns ? headed(at, along) : null;
  const places = along.map((it, i) => [...it, turned ? ARM * turned[i] : 0]);
  return kept(at, places, most).map((i) => [at[i], ...along[i], ...(turned ? [turned[i] * DEGREES] : [])]);
}

function kept(times, places, most) {
  for (let spare = TOLERANCE; ; spare *= 1.5) {
    let own = [0, times.length - 1], more = own;
    while (more.length && own.length <= most) {
      const motion = motionOf(own.map((i) => times[i]), own.map((i) => places[i]));
      more = own.slice(1).flatMap((last, n) => {
        let worst = spare, far = [];
        for (let i = own[n] + 1; i < last; i++) {
          const off = Math.hypot(...motion(times[i]).map((x, k) => x - places[i][k]));
          if (off > worst) [worst, far] = [off, [i]];
        }
        return far;
      });
      own = [...own, ...more].sort((a, b) => a - b);
    }
    if (own.length <= most) return own;
  }
}

// The times, and some beside them, as in `orchestrator/tracks/course.py`.
function among(times) {
  const beside = times.flatMap((it) => [-0.5, -0.25, 0.25, 0.5].map((part) => Math.round(1000 * (it + TURN * part)) / 1000));
  const apart = beside.filter((it) => it > times[0] && it < times.at(-1)).filter((it) => {
    const i = lastAt(times, it);
    return Math.min(it - times[i], times[i + 1] - it) > CLOSE;
  });
  return [...new Set([...times, ...apart])].sort((a, b) => a - b);
}

// Where a boat points that goes along a track [rad]; where it rests, as before.
function headed(times, points) {
  const [north, east] = [0, 1].map((k) => interpolated(times, points.map((it) => it[k])));
  const ways = times.map((it) => [north, east].map((at) => at(it + TURN / 2) - at(it - TURN / 2)));
  const moves = ways.map((it) => Math.hypot(...it) > TOLERANCE), first = moves.indexOf(true);
  if (first < 0) return times.map(() => 0);
  let last = first;
  return unwrapped(ways.map((_, i) => {
    if (moves[i]) last = i;
    return Math.atan2(ways[last][1], ways[last][0]);
  }));
}

// Angles without jumps of a turn [rad].
function unwrapped(angles) {
  let before = angles[0];
  return angles.map((it) => {
    const step = (it - before) % (2 * Math.PI);
    return before += step > Math.PI ? step - 2 * Math.PI : step < -Math.PI ? step + 2 * Math.PI : step;
  });
}
