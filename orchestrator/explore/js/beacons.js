// Where the beacons are on the platform: dragged, moved by keys, typed, added and taken away.
//
//   new BeaconEditor(page)     .show(), .pictureOf(look)
//
// The picture is the platform from above, forward is up. Lengths are whole centimetres.

import { line, roundStep, write } from "../../web/js/pen.js";
import { PLACES } from "./controls.js";
import { $, element, put, shape } from "./dom.js";
import { typed } from "./phrases.js";

const SIZE = 260, LEAST = 3;
const AXES = ["forward", "right", "down"];
const MOVES = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1] };
const centimetres = (x) => Math.round(x * 100) / 100;

export class BeaconEditor {
  constructor(page) {
    this.page = page;
    this.picture = shape("svg", { viewBox: `0 0 ${SIZE} ${SIZE}`, role: "group", "aria-label": "Beacons from above, forward is up" });
    $("beacons-picture").append(this.picture);
    $("add-beacon").addEventListener("click", () => this.add());
    $("reset-beacons").addEventListener("click", () => {
      this.tell(page.changes.reset(...PLACES.filter((it) => page.changes.keys.has(it))));
      page.changed();
    });
    this.show();
  }

  get counts() { return this.page.explorer.counts; }
  get arms() { return this.page.explorer.arms.map((it) => [...it]); }

  // Try beacons at other places; refused ones leave those that were.
  async place(arms) {
    await this.page.explorer.loaded; // the modules of other numbers of beacons
    this.tell(this.page.explorer.setArms(arms.map((it) => it.map(centimetres))));
    this.page.changed();
  }

  tell(problem) {
    $("beacons-problem").hidden = !problem;
    put($("beacons-problem"), problem ?? "");
  }

  // In the middle of the widest gap, as far out as the others.
  add() {
    const arms = this.arms;
    const angles = arms.map(([x, y]) => Math.atan2(y, x)).sort((a, b) => a - b);
    const gaps = angles.map((a, i) => [(angles[i + 1] ?? angles[0] + 2 * Math.PI) - a, a]);
    const [gap, from] = gaps.reduce((a, b) => (b[0] > a[0] + 1e-9 ? b : a));
    const reach = arms.reduce((sum, [x, y]) => sum + Math.hypot(x, y) / arms.length, 0) || 1;
    const down = arms.reduce((sum, it) => sum + it[2] / arms.length, 0), at = from + gap / 2;
    this.place([...arms, [reach * Math.cos(at), reach * Math.sin(at), down]]);
  }

  take(i) {
    $("add-beacon").focus();
    return this.place(this.arms.filter((_, k) => k !== i));
  }

  show() {
    const arms = this.arms, count = arms.length;
    if (!this.dragging) {
      const reach = Math.max(0.1, ...arms.flatMap(([x, y]) => [Math.abs(x), Math.abs(y)]));
      this.scale = (SIZE / 2 - 26) / (1.15 * reach);
    }
    const marks = arms.map((arm, i) => this.mark(arm, i, count));
    const focused = marks.findIndex((_, i) => this.marks?.[i] === document.activeElement);
    this.marks = marks;
    this.picture.replaceChildren(...this.grid(), ...this.lines(arms), ...marks);
    if (focused >= 0) marks[focused].focus();
    this.showRows(arms);
    $("add-beacon").disabled = !this.counts.includes(count + 1);
    $("beacons-note").replaceChildren(...this.counts.length > 1
      ? [`${count} beacons; this page can have ${this.counts.join(", ")}.`]
      : ["A page made with ", element("code", {}, "--beacons"), " can have more or fewer beacons."]);
    const { changes } = this.page;
    $("reset-beacons").hidden = !PLACES.some((it) => changes.has(it));
  }

  at([x, y]) { return [SIZE / 2 + this.scale * y, SIZE / 2 - this.scale * x]; }

  grid() {
    const found = this.lattice().map(({ at, middle }) =>
      shape("path", { d: `M${at} 0V${SIZE}M0 ${at}H${SIZE}`, class: middle ? "axis" : "fine" }));
    const text = shape("text", { x: 6, y: SIZE - 8, class: "small" }, `grid ${typed(this.step)} m`);
    return [...found, text, shape("text", { x: SIZE / 2 + 5, y: 14, class: "small" }, "forward")];
  }

  /** As a picture to be saved, see web/js/save.js. */
  pictureOf(look) {
    const { arms } = this, name = ([x, y, down]) =>
      `${typed(centimetres(x))}, ${typed(centimetres(y))}, ${typed(centimetres(down))} m`;
    return {
      width: SIZE, height: SIZE, look,
      legend: arms.map((arm, i) => ({ label: `${i + 1}: ${name(arm)}`, colour: look.ink, dash: [], mark: "beacon" })),
      draw: (pen) => this.draw(pen, look),
    };
  }

  draw(pen, look) {
    pen.fillStyle = look.water;
    pen.fillRect(0, 0, SIZE, SIZE);
    pen.lineWidth = 1;
    for (const { at, middle } of this.lattice()) {
      pen.strokeStyle = middle ? look.soft : look.grid;
      for (const points of [[[at, 0], [at, SIZE]], [[0, at], [SIZE, at]]]) line(pen, points, 0);
    }
    pen.strokeStyle = look.ink;
    pen.lineWidth = 1.5;
    if (this.page.stage.run.arms)
      for (const arm of this.arms) line(pen, [[SIZE / 2, SIZE / 2], this.at(arm)], 0);
    pen.font = look.font(11);
    write(pen, `grid ${typed(this.step)} m`, 6, SIZE - 8, look.ink, look.water);
    write(pen, "forward", SIZE / 2 + 5, 14, look.ink, look.water);
    pen.font = look.font(11, true);
    pen.textAlign = "center";
    this.arms.forEach((arm, i) => {
      const [x, y] = this.at(arm);
      pen.beginPath();
      pen.arc(x, y, 9, 0, 2 * Math.PI);
      pen.fillStyle = look.ink;
      pen.fill();
      pen.fillStyle = look.paper;
      pen.fillText(String(i + 1), x, y + 4);
    });
    pen.textAlign = "left";
  }

  get step() { return roundStep(30 / this.scale); }

  // Lines of the grid.
  lattice() {
    const found = Array.from({ length: 41 }, (_, k) => ({ at: SIZE / 2 + (k - 20) * this.step * this.scale, middle: k === 20 }));
    return found.filter(({ at }) => at >= 0 && at <= SIZE);
  }

  // Arms of one platform; buoys and beacons on the bottom have none.
  lines(arms) {
    return !this.page.stage.run.arms ? [] : arms.map((arm) => {
      const [x, y] = this.at(arm);
      return shape("line", { x1: SIZE / 2, y1: SIZE / 2, x2: x, y2: y, class: "arm" });
    });
  }

  mark(arm, i, count) {
    const [x, y] = this.at(arm), names = arm.map((v, k) => `${typed(centimetres(v))} m ${AXES[k]}`).join(", ");
    const mark = shape("g", {
      tabindex: 0, role: "button", class: "beacon", transform: `translate(${x} ${y})`,
      "aria-label": `Beacon ${i + 1}: ${names}. Arrows move it${count > LEAST ? ", Delete takes it away" : ""}.`,
    }, shape("circle", { r: 18, class: "reach" }), shape("circle", { r: 9 }),
    shape("text", { y: 4, "text-anchor": "middle" }, String(i + 1)));
    mark.addEventListener("pointerdown", (event) => this.drag(event, mark, i));
    mark.addEventListener("keydown", (event) => this.press(event, i));
    return mark;
  }

  press(event, i) {
    const move = MOVES[event.key];
    if (move) {
      const step = event.shiftKey ? 1 : 0.1, arms = this.arms;
      arms[i][0] += step * move[0];
      arms[i][1] += step * move[1];
      this.place(arms);
    } else if (event.key === "Delete" && this.arms.length > LEAST) this.take(i);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  // The picture keeps its scale while a beacon is dragged.
  drag(event, mark, i) {
    const picture = this.picture, box = picture.getBoundingClientRect(), arms = this.arms;
    event.preventDefault();
    mark.focus();
    picture.setPointerCapture(event.pointerId);
    this.dragging = true;
    const move = (now) => {
      const across = (now.clientX - box.left) * SIZE / box.width, down = (now.clientY - box.top) * SIZE / box.height;
      const inside = (v) => Math.min(Math.max(v, 4), SIZE - 4);
      arms[i][0] = (SIZE / 2 - inside(down)) / this.scale;
      arms[i][1] = (inside(across) - SIZE / 2) / this.scale;
      this.place(arms);
    };
    const done = () => {
      this.dragging = false;
      picture.removeEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) picture.removeEventListener(name, done);
      this.show();
    };
    picture.addEventListener("pointermove", move);
    for (const name of ["pointerup", "pointercancel"]) picture.addEventListener(name, done);
  }

  // The same numbers to type.
  showRows(arms) {
    const rows = $("beacons-rows");
    if (rows.contains(document.activeElement) && rows.children.length === arms.length) {
      arms.forEach((arm, i) => [...rows.children[i].querySelectorAll("input")].forEach((input, k) => {
        if (input !== document.activeElement) input.value = typed(centimetres(arm[k]));
      }));
      return;
    }
    rows.replaceChildren(...arms.map((arm, i) => element("tr", {},
      element("th", { scope: "row" }, String(i + 1)),
      ...arm.map((value, k) => {
        const input = element("input", {
          type: "text", inputmode: "decimal", value: typed(centimetres(value)), autocomplete: "off",
          "aria-label": `Beacon ${i + 1}, ${AXES[k]}, in metres`,
        });
        input.addEventListener("change", () => {
          const changed = this.arms;
          changed[i][k] = input.value.trim() === "" ? NaN : Number(input.value);
          if (Number.isFinite(changed[i][k])) this.place(changed);
          else this.tell(`beacon ${i + 1}, ${AXES[k]}: must be a number, got '${input.value}'`);
        });
        return element("td", {}, input);
      }),
      element("td", {}, this.takeButton(i, arms.length)))));
  }

  takeButton(i, count) {
    const button = element("button", {
      type: "button", class: "back", "aria-label": `Take away beacon ${i + 1}`, title: "Take away",
      disabled: count <= LEAST || !this.counts.includes(count - 1),
    }, "×");
    button.addEventListener("click", () => this.take(i));
    return button;
  }
}
