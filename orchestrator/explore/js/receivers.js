// Which receiver the verdict is about, and which others are beside it.

import { $, element, put } from "./dom.js";

const WORDS = {
  coupled: "estimates GPS, compass, clock and sound speed, too", ekf: "the paper's filter",
  sequential: "one range at a time", fixed_lag: "a few seconds late", raw: "without a filter",
  long_baseline: "for beacons far apart", array: "hydrophones close together",
};

export class ReceiverChoice {
  constructor(page) {
    this.page = page;
    const own = page.explorer.types.filter((it) => it !== "raw");
    this.main = element("select", { id: "main-receiver" }, ...own.map((it) => new Option(it, it)));
    this.main.addEventListener("change", () => this.choose());
    this.boxes = new Map(own.map((it) => [it, element("input", { type: "checkbox", "data-beside": it })]));
    for (const box of this.boxes.values()) box.addEventListener("change", () => this.choose());
    $("receivers").append(
      element("div", { class: "field" }, element("label", { for: "main-receiver" }, "The diver's"),
        element("span", { class: "value" }, this.main)),
      element("p", { class: "note", id: "main-words" }),
      ...[...this.boxes].map(([name, box]) => element("label", { class: "beside" }, box, `beside it: ${name}`)));
  }

  choose() {
    const main = this.main.value;
    const beside = [...this.boxes].filter(([name, box]) => box.checked && name !== main).map(([name]) => name);
    const problem = this.page.explorer.setReceivers([main, ...beside]);
    $("receivers-problem").hidden = !problem;
    put($("receivers-problem"), problem ?? "");
    this.page.changed();
  }

  show() {
    const [main, ...beside] = this.page.explorer.receivers;
    this.main.value = main;
    put($("main-words"), `${main}: ${WORDS[main] ?? ""}`);
    for (const [name, box] of this.boxes) {
      box.checked = name === main || beside.includes(name);
      box.closest("label").hidden = name === main;
    }
  }
}
