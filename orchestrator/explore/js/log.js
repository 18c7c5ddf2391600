// The recorded dive of a page: opened from a file or dropped on the page, shown on the map in place
// of a simulated one, with what speaks for and against its estimates.
//
//   new DiveView(page)     .show(), .begin(contents)
//   .run()                     what the map shows; null without a recorded dive

import { $, element, put, swatch } from "./dom.js";
import { tablesOf } from "./misfits.js";
import { decimalsOf, length } from "./phrases.js";
import { adopt, commandOf, readDive } from "./recorded.js";
import { decimal } from "../../web/js/pen.js";

const NONE = "–";
const OTHERS = "The verdict, what limits you, and all dives remain those of simulated dives with these settings.";
const ROUGH = "This log has no scenario, so there are no simulated dives: sblcosim identify LOG finds one, with the path.";

export class DiveView {
  constructor(page) {
    Object.assign(this, { page, own: null, dive: null, shown: null, before: null });
    $("log-file").addEventListener("change", (event) => this.read(event.target.files[0]));
    $("log-close").addEventListener("click", () => this.close());
    this.listen();
  }

  // A dive may be dropped on its section and on the map, where other files are paths of the diver.
  listen() {
    for (const [id, takes] of [["log", () => true], ["dive", (file) => /\.json$/i.test(file.name)]]) {
      const place = $(id), mark = (on) => place.classList.toggle("dropping", on);
      place.addEventListener("dragover", (event) => { event.preventDefault(); mark(true); });
      place.addEventListener("dragleave", () => mark(false));
      place.addEventListener("drop", (event) => {
        const file = event.dataTransfer.files[0];
        event.preventDefault();
        mark(false);
        if (!file || !takes(file)) return;
        event.stopImmediatePropagation();
        this.read(file);
      }, { capture: true });
    }
  }

  async read(file) {
    if (!file) return;
    try {
      await this.take(await readDive(await file.text().catch(() => "")));
    } catch (error) {
      this.tell(`${file.name}: ${error.message}`);
    }
    $("log-file").value = ""; // so that the same file can be opened again
  }

  // The dive that the page was made with: its settings are those of the page, perhaps with a link's.
  async begin(contents) {
    const { explorer } = this.page;
    this.own = await readDive(JSON.stringify(contents));
    try {
      this.replay(this.own);
    } catch (error) {
      explorer.reset();
      this.replay(this.own);
      this.tell(error.message);
    }
  }

  // An Error says why the dive cannot be shown: then nothing changes.
  async take(dive) {
    const { explorer } = this.page;
    await explorer.loaded;
    const before = { given: Object.fromEntries(explorer.given), receivers: explorer.receivers };
    const refused = adopt(explorer, dive);
    if (refused) throw new Error(refused);
    try {
      this.replay(dive);
      this.before ??= before;
    } catch (error) {
      adopt(explorer, before);
      this.draw();
      throw error;
    }
  }

  replay(dive) {
    this.shown = this.page.explorer.replay(dive).run;
    this.dive = dive;
    this.tell(null);
    this.draw();
  }

  // Back to the settings of the dive.
  restore() { if (this.dive) adopt(this.page.explorer, this.dive); }

  // Back to what was there before: the page's own dive, or simulated ones.
  close() {
    if (this.before) adopt(this.page.explorer, this.before);
    this.before = null;
    if (this.own && this.dive !== this.own) {
      this.replay(this.own);
      return;
    }
    this.dive = this.shown = null;
    this.tell(null);
    this.draw();
  }

  // Settings that do not fit the dive leave what is shown, and say so.
  run() {
    if (!this.dive) return null;
    try {
      this.shown = this.page.explorer.replay(this.dive).run;
      this.tell(null);
    } catch (error) {
      this.tell(error.message);
    }
    return this.shown;
  }

  get isRough() { return Boolean(this.dive?.rough); }

  draw() {
    const { page, dive, shown } = this, { stage, explorer } = page;
    stage.title = dive ? dive.title : explorer.title;
    stage.state.kind = dive?.plane ? "horizontal" : "total";
    stage.replace(shown ?? explorer.dive());
    stage.player.seek(stage.run.stop);
    page.settings = null; // what is shown is of no settings yet
    page.changed();
  }

  tell(problem) {
    $("log-problem").hidden = !problem;
    put($("log-problem"), problem ?? "");
  }

  show() {
    const { dive, shown, page: { explorer } } = this, { classList } = document.body;
    classList.toggle("recorded", Boolean(dive));
    classList.toggle("rough", this.isRough);
    classList.toggle("no-truth", Boolean(dive && !shown.diver));
    put($("of-map"), dive ? `The recorded dive: ${dive.title}` : "One dive");
    put($("of-errors"), !dive || shown.diver ? "Its error over time, and what is claimed" : "What is claimed over time");
    $("log-close").hidden = !dive || (this.isRough && dive === this.own);
    for (const id of ["log-tables", "log-foot", "log-said", "log-others"]) $(id).hidden = !dive;
    if (!dive) return;
    const tables = tablesOf(dive, shown);
    $("log-tables").replaceChildren(...[
      verdicts(shown, tables, dive), residuals(shown, tables, dive),
      shown.diver ? null : agreement(shown, tables)].filter(Boolean));
    put($("log-others"), this.isRough ? ROUGH : OTHERS);
    const { text, file, changed } = commandOf(explorer, dive);
    const said = changed.length ? [...dive.said, `settings changed here: ${changed.join(", ")}`] : dive.said;
    $("log-said").replaceChildren(...said.map((it) => element("li", {}, it)));
    put($("log-command"), text);
    put($("log-how"), file ? `, with ${explorer.file} of this page as scenario.toml in the folder of the log:` : ":");
  }
}

const metres = (value) => Number.isFinite(value) ? length(value) : NONE;

function table(heads, rows, caption) {
  const cells = (row, kind) => row.map((it, i) => element(i ? kind : "th", { scope: i && kind === "td" ? null : kind === "th" ? "col" : "row" }, ...[it].flat()));
  return element("table", {}, element("caption", {}, caption),
    element("thead", {}, element("tr", {}, ...cells(heads, "th"))),
    element("tbody", {}, ...rows.map((row) => element("tr", {}, ...cells(row, "td")))));
}

const named = (receiver) => [swatch(receiver), receiver.label];

function verdicts(run, { receivers }, dive) {
  const rows = run.receivers.map((it) => [it, receivers[it.label]]);
  if (run.diver) return table(
    ["Receiver", "95 % within", "RMS error", dive.plane ? "claimed" : "horizontal", ...(dive.plane ? [] : ["claimed"])],
    rows.map(([it, row]) => [named(it), ...(it.broken ? ["failed"] : [metres(row.p95)]), metres(row.rms),
      ...(dive.plane ? [] : [metres(row.horizontal)]), metres(row.claimed)]),
    "Errors. Horizontal and claimed: RMS in the horizontal");
  return table(["Receiver", "estimates", "first after", "claimed"],
    rows.map(([it, row]) => [named(it), it.broken ? "failed" : String(row.n),
      Number.isFinite(row.first) ? `${decimal(row.first, 0)} s` : NONE, metres(row.claimed)]),
    "Estimates. Claimed: RMS in the horizontal");
}

// Offset and standard deviation with as many decimals as give the deviation two digits.
function residual(row) {
  if (!row) return NONE;
  if (Math.abs(row.offset) < 0.0005 && row.std < 0.0005) return "0";
  const digits = decimalsOf(row.std);
  return `${decimal(row.offset, digits)} ± ${decimal(row.std, digits)}`;
}

function residuals(run, { residuals: by }, { names }) {
  return table(["Sample", ...run.receivers.map((it) => named(it))],
    [...names, "depth"].filter((name) => run.receivers.some((it) => by[it.label][name]))
      .map((name) => [name === "depth" ? name : `beacon ${name}`, ...run.receivers.map((it) => residual(by[it.label][name]))]),
    "Residuals [m]: ranges and depths minus those of the estimates, median ± robust deviation. Small ones do not "
    + "mean a small error: raw follows the noise of each ping");
}

function agreement(run, { agreement: pairs }) {
  const rows = pairs.filter((it) => it.n).map((it) => [`${it.receiver}, ${it.other}`, metres(it.horizontal), metres(it.most)]);
  return rows.length ? table(["Receivers", "RMS", "most"], rows, "Distance between receivers; RMS in the horizontal") : null;
}
