// The page in which a scenario can be explored: joins the explorer, the controls and the pictures.

import { savePicture } from "../../web/js/save.js";
import { Stage } from "../../web/js/stage.js";
import { lookOf } from "../../web/js/style.js";
import { surface } from "../../web/js/surface.js";
import { BeaconEditor } from "./beacons.js";
import { Before } from "./before.js";
import { causesPicture, showCauses } from "./causes.js";
import { isShown, makeControls } from "./controls.js";
import { $, download, element, put, swatch } from "./dom.js";
import { Explorer } from "./explorer.js";
import { drawHistogram, histogramPicture } from "./histogram.js";
import { DiveView } from "./log.js";
import { PathEditor } from "./path.js";
import { length } from "./phrases.js";
import { showReach } from "./reach.js";
import { ReceiverChoice } from "./receivers.js";
import { SettingsList } from "./settings.js";
import { TrackEditor } from "./track.js";
import { Changes } from "./changes.js";
import { Comparison } from "./compared.js";
import { showBuy, showVerdict, tell } from "./verdict.js";
import { unpacked } from "./unpacked.js";
import { Water } from "./water.js";

const NO_FIT = "The link has settings that do not fit this page: ";
const PAUSE = 80; // ms without a change before many dives start

class Page {
  constructor(explorer, changes, run) {
    Object.assign(this, { explorer, changes, turn: 0, summary: null });
    this.stage = new Stage(run, { title: explorer.title, kind: "total", keys: $("dive") });
    this.fields = makeControls(this);
    this.before = new Before(this);
    this.receivers = new ReceiverChoice(this);
    this.comparison = new Comparison(this);
    this.beacons = new BeaconEditor(this);
    this.path = new PathEditor(this);
    this.track = new TrackEditor(this);
    this.water = new Water(this);
    this.list = new SettingsList(this);
    this.log = new DiveView(this);
    this.histogram = surface($("histogram"), (width, height) => {
      this.size = { width, height };
      this.drawHistogram();
    });
    this.bind();
    this.log.show();
    this.stage.player.seek(run.stop);
    this.show();
    this.isComputed();
    this.compute();
  }

  bind() {
    $("reset-all").addEventListener("click", () => {
      this.explorer.reset();
      this.log.restore();
      for (const field of [...this.fields, ...this.list.fields.values()]) field.tell(null);
      this.changed();
    });
    $("link").addEventListener("click", () => this.copyLink());
    $("download").addEventListener("click", () => download(this.explorer.file, this.explorer.toml()));
    $("count").addEventListener("change", () => this.compute());
    $("seed").addEventListener("change", () => this.seed($("seed").value.trim()));
    $("next-seed").addEventListener("click", () => this.seed(this.explorer.seed + 1));
    for (const name of Object.keys(this.pictures)) {
      document.querySelectorAll(`[data-save^="${name} "]`).forEach((button) => {
        button.addEventListener("click", () => this.save(name, button.dataset.save.split(" ")[1]));
      });
    }
    // Where the verdict is out of sight, one line of it stays.
    new IntersectionObserver(([{ isIntersecting }]) => { $("glance").hidden = isIntersecting; })
      .observe($("verdict"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.drawHistogram());
    addEventListener("hashchange", () => this.follow());
  }

  seed(value) {
    const problem = this.explorer.setSeed(value);
    put($("seed-problem"), problem ?? "");
    $("seed-problem").hidden = !problem;
    $("seed").setAttribute("aria-invalid", String(Boolean(problem)));
    this.changed();
  }

  // A link carries settings: explore.html#…
  async follow() {
    if (!Explorer.settingsOf(location.hash)) return;
    await this.explorer.loaded;
    const problem = this.adopt(location.hash);
    if (problem) requestAnimationFrame(() => this.report(NO_FIT + problem));
  }

  // The settings of a link in place of all others; null, or why they are refused.
  adopt(link) {
    this.explorer.reset();
    const problem = link ? this.explorer.apply(Explorer.settingsOf(link)) : null;
    this.changed();
    return problem;
  }

  report(sentence) {
    $("problem").hidden = !sentence;
    put($("problem"), sentence ?? "");
  }

  async copyLink() {
    const address = location.href.split("#")[0] + this.explorer.link();
    try {
      await navigator.clipboard.writeText(address);
      put($("link"), "Copied");
    } catch { // not allowed here: it is in the address line instead
      location.hash = this.explorer.link();
      put($("link"), "In the address");
    }
    setTimeout(() => put($("link"), "Copy link"), 2000);
  }

  // After any change, accepted or not: once for all changes of a frame.
  changed() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.report(null);
      this.changes.refresh();
      this.show();
      if (this.isComputed()) return; // refused
      this.before.leave();
      this.turn++;
      if (this.log.dive) this.water.clear(); else this.water.outdate();
      put($("so-far"), "…"); // what is shown beside it is of other settings, for a moment
      document.body.classList.add("computing");
      this.stage.replace(this.log.run() ?? this.explorer.dive());
      this.log.show();
      this.showLegend();
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.compute(), PAUSE);
    });
  }

  // Whether what is shown is of these settings; from now on it will be.
  isComputed() {
    const settings = this.explorer.toml() + this.explorer.command(), same = settings === this.settings;
    this.settings = settings;
    return same;
  }

  show() {
    const { explorer, changes } = this;
    for (const field of this.fields) {
      field.show();
      field.element.hidden = !isShown(this, field);
    }
    for (const part of [this.receivers, this.comparison, this.beacons, this.path, this.track, this.list]) part.show();
    $("reset-all").hidden = !explorer.link();
    if ($("seed-problem").hidden) $("seed").value = explorer.seed;
    put($("command"), explorer.command());
    put($("which"), `The dive on this page is that of seed ${explorer.seed}.`);
    this.showLegend();
  }

  showLegend() {
    const { receivers } = this.stage.run;
    for (const id of ["of-receivers", "of-errors-receivers"])
      $(id).replaceChildren(...receivers.map((it) => element("span", {}, swatch(it), it.label)));
  }

  // --- Many dives -----------------------------------------------------------------------------------

  async compute() {
    const { explorer } = this, [main] = explorer.receivers;
    if (this.water.isRunning) this.water.outdate(); // it is cancelled, too
    explorer.cancel();
    const turn = ++this.turn;
    if (this.log.isRough) return; // its settings have no path for other dives
    document.body.classList.add("computing");
    showBuy(null);
    let possible = null, last = null;
    const compare = () => showReach(possible, last, main);
    compare();
    const take = (summary) => {
      if (!summary || turn !== this.turn) return;
      this.take(last = summary, main);
      compare();
    };
    try {
      const known = explorer.possible().then((it) => { // while workers do the dives
        if (turn !== this.turn) return;
        possible = it;
        compare();
      });
      const [summary] = await Promise.all([explorer.dives(Number($("count").value), take), known]);
      if (!summary || turn !== this.turn) return;
      take(summary);
      this.before.keep(summary.receivers[main].p95, main);
      if (this.water.isOld) this.water.compute();
      const found = await explorer.causes((part) => this.takeCauses(part, turn));
      if (!found || turn !== this.turn) return;
      this.takeCauses(found, turn);
      showBuy(found, summary.receivers[main].p95);
      tell(summary.receivers[main].p95, main, this.before.sentence);
      document.body.classList.remove("computing");
    } catch (error) {
      if (turn === this.turn) this.report(`The dives could not be computed: ${error.message}`);
    }
  }

  takeCauses(found, turn) {
    if (turn !== this.turn) return;
    this.causes = found.causes;
    showCauses(found.causes, found);
    put($("then"), `${found.done} of ${found.n} dives without each cause`);
  }

  take(summary, main) {
    this.summary = { ...summary, main };
    const styles = Object.fromEntries(this.stage.run.receivers.map((it) => [it.label, it]));
    showVerdict(summary, styles, main);
    this.before.show();
    this.comparison.take(summary.receivers, styles, main);
    put($("dives-note"), `Bars: how often an error of that size occurs. ${summary.done} dives, each with its own waves, noise and losses: seeds ${seedsOf(this.explorer.seed, summary.done)}.`);
    const { p50, p95 } = summary.receivers[main];
    $("histogram").setAttribute("aria-label", `Histogram of the errors of ${summary.done} dives with `
      + `${main}: half within ${length(p50)}, 95 % within ${length(p95)}`);
    this.drawHistogram();
  }

  get compared() {
    if (!this.summary) return [];
    const { receivers, main } = this.summary;
    return [main, ...Object.keys(receivers).filter((it) => it !== main)].flatMap((label) => {
      const style = this.stage.run.receivers.find((it) => it.label === label);
      return style ? [{ ...style, ...receivers[label] }] : [];
    });
  }

  drawHistogram() {
    if (this.size) drawHistogram(this.histogram.pen, this.size, this.compared, lookOf(document.body));
  }

  // Pictures of the page itself; those of one dive are of its stage.
  get pictures() {
    const { title, receivers: [main] } = this.explorer;
    return {
      histogram: (look) => ({ name: "dives", title: `${title}, errors of ${this.summary.done} dives`,
        ...histogramPicture(this.size, this.compared, look) }),
      causes: (look) => ({ name: "causes", title: `${title}, what limits ${main}`, ...causesPicture(this.causes, look) }),
      beacons: (look) => ({ name: "beacons", title: `${title}, beacons: forward, right, down`, ...this.beacons.pictureOf(look) }),
    };
  }

  async save(name, kind) {
    if (name !== "beacons" && !(this.summary && this.causes)) return; // not known yet
    const { name: file, ...picture } = this.pictures[name](lookOf(document.body));
    await savePicture(kind, file, picture);
  }
}

const seedsOf = (first, count) => `${first} to ${first + count - 1}`;

// Chromium lets a page in a file start workers only from a text.
const makeWorker = (script) => () =>
  new Worker(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));

async function start() {
  if (typeof WebAssembly === "undefined") throw new Error("this browser has no WebAssembly");
  if (typeof DecompressionStream === "undefined") throw new Error("this browser has no DecompressionStream");
  const { modules, packed } = JSON.parse($("contents").textContent);
  const contents = { ...JSON.parse(new TextDecoder().decode(await unpacked(packed))), modules };
  const explorer = await Explorer.open(contents, makeWorker(contents.worker));
  const changes = new Changes(explorer), settings = Explorer.settingsOf(location.hash);
  if (settings) await explorer.loaded;
  const problem = settings ? explorer.apply(settings) : null;
  changes.refresh();
  window.page = new Page(explorer, changes, explorer.dive());
  if (problem) window.page.report(NO_FIT + problem);
  if (contents.dive) await window.page.log.begin(contents.dive);
  document.body.classList.add("ready");
}

start().catch((error) => {
  $("problem").hidden = false;
  $("problem").textContent = `This page cannot simulate here: ${error.message}`;
  throw error;
});
