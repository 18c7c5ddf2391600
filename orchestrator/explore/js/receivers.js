// Which receiver the verdict is about; others are compared with it.
//
//   new ReceiverChoice(page)     .use(name), .compare(name, on), .show()

import { $, element, put } from "./dom.js";

/** What each receiver is, in plain words. */
export const WORDS = {
  coupled: "a filter that also estimates the errors of GPS, compass, clock and sound speed",
  ekf: "the paper's Kalman filter, which takes the beacons' reports as true",
  sequential: "a Kalman filter that takes each range at its own time",
  fixed_lag: "as coupled, but a few seconds late, and more accurate",
  raw: "no filter: a new position from the latest ranges each time",
  long_baseline: "for beacons far apart, each with an error of its own",
  array: "for several hydrophones close together that hear one ping",
};

export class ReceiverChoice {
  constructor(page) {
    this.page = page;
    const own = page.explorer.types.filter((it) => it !== "raw");
    this.main = element("select", { id: "main-receiver" }, ...own.map((it) => new Option(it, it)));
    this.main.addEventListener("change", () => this.use(this.main.value));
    $("receivers").append(
      element("div", { class: "field" }, element("label", { for: "main-receiver" }, "The diver's"),
        element("span", { class: "value" }, this.main)),
      element("p", { class: "note", id: "main-words" }));
  }

  use(name) {
    this.choose([name, ...this.page.explorer.receivers.filter((it) => it !== name)]);
  }

  compare(name, on) {
    const others = this.page.explorer.receivers.filter((it) => it !== name);
    this.choose(on ? [...others, name] : others);
  }

  choose(receivers) {
    const problem = this.page.explorer.setReceivers(receivers);
    $("receivers-problem").hidden = !problem;
    put($("receivers-problem"), problem ?? "");
    this.page.changed();
  }

  show() {
    const [main] = this.page.explorer.receivers;
    this.main.value = main;
    put($("main-words"), `${main}: ${WORDS[main] ?? ""}`);
  }
}
