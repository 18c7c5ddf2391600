// The page that plays a run: reads its data, and joins drawings, player and controls.

import { KINDS, claimOf, errorOf, pointAt, readRun, standing } from "./data.js";
import { ErrorPlot } from "./errors.js";
import { attach } from "./gestures.js";
import { boxOf, drawMap } from "./map.js";
import { Player, SPEEDS, listen, usualSpeed } from "./player.js";
import { savePicture } from "./save.js";
import { lookOf } from "./style.js";
import { View } from "./view.js";
import { clock, metres } from "./words.js";

const $ = (id) => document.getElementById(id);

// A canvas with sharp pixels; draws once it has a size, and again when that changes.
function surface(canvas, changed) {
  const pen = canvas.getContext("2d");
  const fit = () => {
    const { clientWidth: width, clientHeight: height } = canvas, dense = devicePixelRatio || 1;
    if (!width || !height) return;
    Object.assign(canvas, { width: Math.round(width * dense), height: Math.round(height * dense) });
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    changed(width, height);
  };
  new ResizeObserver(fit).observe(canvas);
  return { pen, fit };
}

class Page {
  constructor(run, title, kind) {
    this.run = run;
    this.title = title;
    this.span = run.stop - run.start;
    this.look = lookOf(document.body);
    this.view = new View();
    this.plot = new ErrorPlot(run);
    this.state = {
      time: run.stop, kind, shown: run.receivers.map(() => true),
      fixes: run.receivers.map((it) => it.fix),
    };
    this.state.box = boxOf(run, this.state.shown);
    this.player = new Player(run.start, run.stop, {
      onTime: (t) => this.show(t), onState: () => this.showState(),
    });
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
    this.open();
  }

  bind() {
    const { player, view } = this, step = { small: Math.max(this.span / 400, 0.1), large: this.span / 20 };
    const slider = $("time");
    Object.assign(slider, { min: this.run.start, max: this.run.stop });
    slider.addEventListener("input", () => { player.pause(); player.seek(Number(slider.value)); });
    $("play").addEventListener("click", () => player.toggle());
    $("speed").replaceChildren(...SPEEDS.map((speed) => new Option(`${speed}×`, speed)));
    $("speed").addEventListener("change", () => { player.speed = Number($("speed").value); });
    listen(document, player, step);
    this.moved = attach($("map"), view, () => this.drawMap());
    $("space").addEventListener("click", () => this.turnTo(view.isPlan));
    $("nearer").addEventListener("click", () => { view.magnify(1.5); this.moved(); });
    $("farther").addEventListener("click", () => { view.magnify(1 / 1.5); this.moved(); });
    $("whole").addEventListener("click", () => { view.reset(); this.moved(); });
    $("kind")?.addEventListener("change", () => { this.state.kind = $("kind").value; this.remeasure(); });
    document.querySelectorAll("[data-receiver]").forEach((box) => {
      box.addEventListener("change", () => {
        this.state.shown[box.dataset.receiver] = box.checked;
        this.remeasure();
      });
    });
    document.querySelectorAll("[data-save]").forEach((button) => {
      button.addEventListener("click", () => this.save(...button.dataset.save.split(" ")));
    });
    const plot = $("errors"), seek = (event) => { player.pause(); player.seek(this.plot.timeAt(event.offsetX)); };
    plot.addEventListener("pointerdown", (event) => {
      plot.setPointerCapture?.(event.pointerId);
      seek(event);
    });
    plot.addEventListener("pointermove", (event) => { if (event.buttons) seek(event); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.recolour());
    addEventListener("hashchange", () => this.open());
  }

  // A link may name the time and the view: replay.html#t=120&view=space
  open() {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (asked.has("view")) this.turnTo(asked.get("view") === "space");
    if (KINDS[asked.get("error")]) {
      $("kind").value = this.state.kind = asked.get("error");
      this.remeasure();
    }
    const t = parseFloat(asked.get("t"));
    this.player.seek(Number.isNaN(t) ? this.state.time : t);
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
    this.plot.resize(this.plot.width, this.plot.height, this.state);
    this.drawMap();
    this.drawErrors();
    this.showNumbers();
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
    this.showNumbers();
    if (!this.player.playing) this.describe();
  }

  showState() {
    const { playing } = this.player, button = $("play");
    button.textContent = playing ? "❚❚" : "▶";
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
    document.body.classList.toggle("playing", playing);
    this.describe();
  }

  showNumbers() {
    const { run, state } = this, { time, kind } = state;
    const put = (cell, text) => { if (cell && cell.textContent !== text) cell.textContent = text; };
    $("time").value = time;
    put($("clock"), clock(time, this.span));
    const at = run.diver ? pointAt(run.diver, run.time, time) : [];
    ["x", "y", "z"].forEach((k, i) => put(document.querySelector(`[data-truth="${k}"]`), metres(at[i] ?? NaN)));
    run.receivers.forEach((it, i) => {
      const now = standing(run, it, time), row = $(`receiver-${i}`);
      row.classList.toggle("off", !state.shown[i]);
      const cell = (name, value) => put(
        row.querySelector(`[data-cell="${name}"]`), now < 0 ? "–" : metres(value()));
      cell("error", () => errorOf(it, now, kind));
      cell("claim", () => claimOf(it, now, kind));
      ["x", "y", "z"].forEach((k) => cell(k, () => it.position[k][now]));
    });
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
    const seen = this.view.isPlan ? "Map" : "Map in space";
    $("map").setAttribute("aria-label", `${seen} at ${clock(time, this.span)}: ${diver}${off.join(", ")}`);
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
      [run.beacons.length, { label: "beacons, true", colour: look.ink, dash: [], mark: "beacon" }],
      [run.reported.length, { label: "beacons, as reported", colour: look.soft, dash: [2, 1.5], mark: "beacon" }],
    ].filter(([there]) => there).map(([, entry]) => entry);
    const title = `${this.title}, at ${clock(state.time, this.span)}`;
    const drawing = which === "map"
      ? { width: view.width, height: view.height, legend: [...receivers, ...others],
        draw: (pen) => drawMap(pen, view, run, state, look) }
      : { width: plot.width, height: plot.height, legend: receivers,
        draw: (pen) => { plot.draw(pen, state, look); plot.drawCursor(pen, state, look); } };
    await savePicture(kind, `${which}-${Math.round(state.time - run.start)}s`, { title, look, ...drawing });
  }
}

async function start() {
  const content = JSON.parse($("run").textContent);
  const run = await readRun(content);
  window.replay = new Page(run, content.title, content.error);
  document.body.classList.add("ready");
}

start().catch((error) => {
  const problem = $("problem");
  problem.hidden = false;
  problem.textContent = typeof DecompressionStream === "undefined"
    ? "This browser is too old for this page: it lacks DecompressionStream." : `The run cannot be shown: ${error.message}`;
  throw error;
});
