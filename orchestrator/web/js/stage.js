// One run on a page: its map, its errors, and the player with its controls.
//
//   new Stage(run, { title, kind, onTime, keys })     takes the elements of the page by their ids;
//                                               keys: where the player's keys work
//   .replace(run)                               another run, at the same time and in the same view
//   .remeasure()                                after `.state.kind` or `.state.shown` have changed
//   .view, .player, .state                      see view.js, player.js, map.js and errors.js
//
// Elements: canvases map and errors; buttons play, space, nearer, farther and whole; range time,
// output clock, select speed; and buttons with data-save, such as "map png".

import { errorOf, pointAt, standing } from "./data.js";
import { ErrorPlot } from "./errors.js";
import { attach } from "./gestures.js";
import { WAY, boatAt, boxOf, drawMap } from "./map.js";
import { Player, SPEEDS, listen, usualSpeed } from "./player.js";
import { savePicture } from "./save.js";
import { lookOf } from "./style.js";
import { surface } from "./surface.js";
import { View } from "./view.js";
import { clock, metres } from "./words.js";

const $ = (id) => document.getElementById(id);

export class Stage {
  constructor(run, { title, kind, onTime = () => {}, keys = document }) {
    Object.assign(this, { title, onTime, keys });
    this.look = lookOf(document.body);
    this.view = new View();
    this.state = { kind, time: run.stop, shown: run.receivers.map(() => true) };
    this.player = new Player(run.start, run.stop, {
      onTime: (t) => this.show(t), onState: () => this.showState(),
    });
    this.take(run);
    this.map = surface($("map"), (width, height) => {
      Object.assign(this.view, { width, height });
      this.drawMap();
    });
    this.base = document.createElement("canvas");
    this.errors = surface($("errors"), (width, height) => {
      this.plot.resize(width, height, this.state);
      this.drawErrors();
    });
    this.bind();
    this.player.speed = usualSpeed(this.span);
    $("speed").value = this.player.speed;
  }

  // Everything that follows from the run.
  take(run) {
    this.run = run;
    this.span = run.stop - run.start;
    this.plot = new ErrorPlot(run);
    this.state.fixes = run.receivers.map((it) => it.fix);
    this.state.box = boxOf(run, this.state.shown);
    Object.assign(this.player, { start: run.start, stop: run.stop });
    Object.assign($("time"), { min: run.start, max: run.stop });
  }

  replace(run) {
    const { state, player } = this, ended = player.time >= this.run.stop;
    if (run.receivers.length !== state.shown.length) state.shown = run.receivers.map(() => true);
    this.take(run);
    player.time = state.time = ended ? run.stop : Math.min(player.time, run.stop);
    this.remeasure();
  }

  bind() {
    const { player, view } = this;
    const slider = $("time");
    slider.addEventListener("input", () => { player.pause(); player.seek(Number(slider.value)); });
    $("play").addEventListener("click", () => player.toggle());
    $("speed").replaceChildren(...SPEEDS.map((speed) => new Option(`${speed}×`, speed)));
    $("speed").addEventListener("change", () => { player.speed = Number($("speed").value); });
    listen(this.keys, player, () => ({ small: Math.max(this.span / 400, 0.1), large: this.span / 20 }));
    this.moved = attach($("map"), view, () => this.drawMap());
    $("space").addEventListener("click", () => this.turnTo(view.isPlan));
    $("nearer").addEventListener("click", () => { view.magnify(1.5); this.moved(); });
    $("farther").addEventListener("click", () => { view.magnify(1 / 1.5); this.moved(); });
    $("whole").addEventListener("click", () => { view.reset(); this.moved(); });
    for (const which of ["map", "errors"]) {
      document.querySelectorAll(`[data-save^="${which} "]`).forEach((button) => {
        button.addEventListener("click", () => this.save(...button.dataset.save.split(" ")));
      });
    }
    const plot = $("errors"), seek = (event) => { player.pause(); player.seek(this.plot.timeAt(event.offsetX)); };
    plot.addEventListener("pointerdown", (event) => {
      plot.setPointerCapture?.(event.pointerId);
      seek(event);
    });
    plot.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
  }

  turnTo(space) {
    if (space) this.view.space(); else this.view.plan();
    $("space").setAttribute("aria-pressed", String(space));
    this.moved();
    this.describe();
  }

  recolour() {
    this.look = lookOf(document.body);
    this.drawMap();
    this.drawErrors();
  }

  remeasure() {
    this.state.box = boxOf(this.run, this.state.shown);
    const { clientWidth: width, clientHeight: height } = $("errors");
    if (width && height) this.plot.resize(width, height, this.state);
    this.drawMap();
    this.drawErrors();
    this.tell();
    this.describe();
  }

  drawMap() {
    if (this.view.width > 1) drawMap(this.map.pen, this.view, this.run, this.state, this.look);
  }

  // The curves are drawn once; the cursor moves over their picture.
  drawErrors() {
    const canvas = $("errors"), { width, height } = canvas;
    Object.assign(this.base, { width, height });
    const pen = this.base.getContext("2d"), dense = width / canvas.clientWidth;
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    if (this.plot.width) this.plot.draw(pen, this.state, this.look);
    this.drawCursor();
  }

  drawCursor() {
    if (!this.plot.width || !this.base.width) return;
    const { pen } = this.errors;
    pen.drawImage(this.base, 0, 0, this.plot.width, this.plot.height);
    this.plot.drawCursor(pen, this.state, this.look);
  }

  show(t) {
    this.state.time = t;
    this.drawMap();
    this.drawCursor();
    this.tell();
    if (!this.player.playing) this.describe();
  }

  // The time in numbers.
  tell() {
    const { time } = this.state, text = clock(time, this.span);
    $("time").value = time;
    if ($("clock").textContent !== text) $("clock").textContent = text;
    this.onTime(time);
  }

  showState() {
    const { playing } = this.player, button = $("play");
    button.textContent = playing ? "❚❚" : "▶";
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
    document.body.classList.toggle("playing", playing);
    this.describe();
  }

  // The picture in words, for those who do not see it; not while it plays.
  describe() {
    const { run, state } = this, { time, kind } = state;
    const off = run.receivers.map((it, i) => [it, i]).filter(([, i]) => state.shown[i]).map(([it]) => {
      const now = standing(run, it, time), error = now < 0 ? NaN : errorOf(it, now, kind);
      if (now < 0) return `${it.label} has no estimate`;
      return Number.isNaN(error) ? `${it.label} has an estimate` : `${it.label} is off by ${metres(error)} m`;
    });
    const [x, y, z] = run.diver ? pointAt(run.diver, run.time, time) : [];
    const [ahead, right] = run.axes.map((name) => name.toLowerCase());
    const diver = run.diver
      ? `the diver is at ${metres(x)} m ${ahead}, ${metres(y)} m ${right}, ${metres(z)} m deep; ` : "";
    const [n, e] = run.sails ? boatAt(run, time) : [];
    const boat = run.sails ? `the boat is at ${metres(n)} m ${ahead}, ${metres(e)} m ${right}; ` : "";
    const seen = this.view.isPlan ? "Map" : "Map in space";
    $("map").setAttribute("aria-label", `${seen} at ${clock(time, this.span)}: ${diver}${boat}${off.join(", ")}`);
    $("time").setAttribute(
      "aria-valuetext", `${clock(time, this.span)} of ${clock(run.stop, this.span)}; ${off.join(", ")}`);
  }

  async save(which, kind) {
    const { run, state, look, view, plot } = this;
    const receivers = run.receivers.filter((it, i) => state.shown[i]).map((it) => ({
      label: it.label, colour: look.of(it), dash: it.dash, mark: it.fix ? "dots" : "line",
    }));
    const others = [
      [run.diver, { label: "diver, true", colour: look.ink, dash: [], mark: "line" }],
      [run.sails, { label: "boat's way", colour: look.ink, dash: WAY.map((it) => it / 2), mark: "line" }],
      [run.beacons.length, { label: "beacons, true", colour: look.ink, dash: [], mark: "beacon" }],
      [run.reported.length, { label: "beacons, as reported", colour: look.soft, dash: [2, 1.5], mark: "beacon" }],
    ].filter(([there]) => there).map(([, entry]) => entry);
    const title = `${this.title}, at ${clock(state.time, this.span)}`;
    const drawing = which === "map"
      ? { width: view.width, height: view.height, legend: [...receivers, ...others, ...(state.under?.legend ?? [])],
        draw: (pen) => drawMap(pen, view, run, state, look) }
      : { width: plot.width, height: plot.height, legend: receivers,
        draw: (pen) => { plot.draw(pen, state, look); plot.drawCursor(pen, state, look); } };
    await savePicture(kind, `${which}-${Math.round(state.time - run.start)}s`, { title, look, ...drawing });
  }
}
