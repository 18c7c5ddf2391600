// The control of one key: a slider or a list, a number to type, what is wrong with it, and a reset.
//
//   new Field(page, path, { label, stops, names, about, instead, wide })
//   .element, .show(), .said
//
// `page` has `explorer`, `changes` and `changed()`. `stops` are the values of the slider, `names` those
// of choices, `about` explains the key, by default in its own words. `instead` are keys that may take
// the effect of this one away: to set it resets them.

import { element, put } from "./dom.js";
import { labelled, typed } from "./phrases.js";

let count = 0;

export class Field {
  constructor(page, path, {
    label, stops = null, names = {}, about = null, instead = [], wide = false,
  } = {}) {
    const key = page.changes.keys.get(path);
    Object.assign(this, { page, path, key, stops, instead, id: `field-${count++}` });
    this.name = label ?? key.key;
    this.control = this.makeControl(names);
    this.control.id = this.id;
    this.problem = element("p", { class: "refused", role: "alert", id: `${this.id}-problem`, hidden: true });
    this.control.setAttribute("aria-describedby", this.problem.id);
    this.back = element("button", {
      type: "button", class: "back", title: "Reset", "aria-label": `Reset ${this.name}`, hidden: true,
    }, "↺");
    this.back.addEventListener("click", () => this.reset());
    const unit = key.unit && !["choice", "switch"].includes(key.kind)
      ? element("span", { class: "unit" }, key.unit) : null;
    this.element = element("div", { class: `field${wide ? " wide" : ""}`, "data-path": path },
      element("span", { class: "name" },
        element("label", { for: this.id }, this.name), wide ? null : this.makeHelp()),
      element("span", { class: "value" }, this.back, this.control, unit),
      this.about = element("p", { class: "note", id: `${this.id}-about`, hidden: !wide }, about ?? key.words),
      this.makeSlider(), this.problem);
    this.show();
  }

  // What a key means, for those who ask: by mouse, touch or keys.
  makeHelp() {
    const button = element("button", {
      type: "button", class: "what", "aria-label": `What is ${this.name}?`, "aria-expanded": "false",
      "aria-controls": `${this.id}-about`,
    }, "?");
    button.addEventListener("click", () => {
      this.about.hidden = !this.about.hidden;
      button.setAttribute("aria-expanded", String(!this.about.hidden));
    });
    return button;
  }

  makeControl(names) {
    const { key } = this;
    if (key.kind === "choice" || (key.sets && key.kind !== "number")) return this.makeList(names);
    if (key.kind === "switch") {
      const box = element("input", { type: "checkbox" });
      box.addEventListener("change", () => this.choose(box.checked));
      return box;
    }
    const many = key.kind === "vector" || key.kind === "matrix";
    const text = element("input", {
      type: "text", inputmode: many || key.names ? null : "decimal", autocomplete: "off", spellcheck: "false",
      class: many ? "many" : null,
    });
    text.addEventListener("change", () => this.choose(text.value.trim()));
    return text;
  }

  makeList(names) {
    const { key } = this, list = element("select");
    const choices = key.choices ?? Object.keys(key.sets);
    list.append(
      ...(key.sets || key.optional || key.default === null ? [new Option(key.sets ? "as given" : "–", "")] : []),
      ...choices.map((it) => new Option(names[it] ?? (this.isPlain ? String(it) : labelled(it)), it)));
    list.addEventListener("change", () => this.choose(list.value));
    return list;
  }

  makeSlider() {
    if (!this.stops) return null;
    const slider = element("input", {
      type: "range", min: 0, max: this.stops.length - 1, step: 1, "aria-label": this.name,
    });
    slider.addEventListener("input", () => this.choose(this.stops[Number(slider.value)]));
    this.slider = slider;
    return slider;
  }

  choose(value) {
    const { page: { changes }, path } = this, others = this.instead.filter((it) => changes.has(it));
    this.done(others.length ? changes.replace(path, value, others) : changes.choose(path, value));
  }

  reset() {
    this.control.focus();
    this.done(this.page.changes.reset(this.path));
  }

  done(problem) {
    this.tell(problem);
    this.page.changed();
  }

  // What is refused may be accepted after another key has changed.
  sync() {
    const problem = this.page.explorer.problems().find(({ path }) => path === this.path);
    this.tell(problem?.message ?? null);
  }

  // Refuse what was typed, and say why; it stays to be corrected.
  tell(problem) {
    this.problem.hidden = !problem;
    put(this.problem, problem ?? "");
    this.control.setAttribute("aria-invalid", String(Boolean(problem)));
  }

  /** What holds now, in words. */
  get said() {
    const { control, key: { unit } } = this;
    if (control.type === "checkbox") return control.checked ? "on" : "off";
    if (control.tagName === "SELECT") return control.selectedOptions[0]?.text ?? "";
    const text = typed(this.page.explorer.value(this.path));
    return !unit ? text : unit === "°" ? `${text}°` : `${text} ${unit}`;
  }

  show() {
    const { page, path, control, slider } = this;
    const value = page.explorer.value(path), changed = page.changes.has(path);
    this.element.classList.toggle("changed", changed);
    this.back.hidden = !changed;
    this.sync();
    if (!this.problem.hidden) return;
    if (control.type === "checkbox") control.checked = value === true;
    else {
      const text = control.tagName === "SELECT" && this.key.sets
        ? typed(page.explorer.given.get(path)) : typed(value);
      if (control.value !== text) control.value = text;
    }
    if (slider && typeof value === "number") {
      const nearest = this.stops.reduce((best, stop, i) =>
        Math.abs(stop - value) < Math.abs(this.stops[best] - value) ? i : best, 0);
      slider.value = nearest;
      slider.setAttribute("aria-valuetext", `${typed(value)} ${this.key.unit ?? ""}`.trim());
    }
  }
}
