// Which receiver: the best one in the verdict, and all of them in a table, on the same dives.
//
//   new Comparison(page)     .take(receivers, styles, main), .show()
//
// `receivers` are of `explorer.dives`, by label; `styles` of its legend.

import { $, breakable, element, put, swatch } from "./dom.js";
import { binomialBelow } from "./distributions.js";
import { length, whole } from "./phrases.js";
import { WORDS } from "./receivers.js";
import { claimIn } from "./verdict.js";

const RISK = 0.05;

export class Comparison {
  constructor(page) {
    this.page = page;
    this.rows = new Map(page.explorer.types.map((name) => [name, this.row(name)]));
    $("compared").append(...[...this.rows.values()].flatMap((it) => [it.row, it.doubt]));
    $("words").prepend(...page.explorer.types.flatMap((name) => [
      element("dt", { class: "narrow" }, name), element("dd", { class: "narrow" }, WORDS[name] ?? "")]));
    const { lost, misleading } = page.explorer.words;
    put($("words-lost"), lost);
    put($("words-misleading"), misleading);
  }

  row(name) {
    const cells = Array.from({ length: 6 }, () => element("td"));
    const doubt = element("tr", { class: "doubt", "data-doubt": name, hidden: true }, element("td", { colspan: 8 }));
    const mark = element("span"), box = element("input", {
      type: "checkbox", "data-compare": name, "aria-label": `Compare ${name}`, disabled: name === "raw" });
    box.addEventListener("change", () => this.page.receivers.compare(name, box.checked));
    const use = element("button", { type: "button", class: "use", "aria-label": `Use ${name}` }, "Use");
    use.addEventListener("click", () => this.use(name));
    const row = element("tr", { "data-receiver": name },
      element("th", { scope: "row" }, element("label", {}, box, mark, element("b", {}, ...breakable(name))),
        element("span", { class: "note" }, WORDS[name] ?? "")),
      ...cells, element("td", {}, use));
    return { row, cells, mark, box, use, doubt };
  }

  // The button goes away; where the focus was, people go on.
  use(name) {
    const [before] = this.page.explorer.receivers;
    this.page.receivers.use(name);
    this.show();
    this.rows.get(before).use.focus();
  }

  /** Which are compared, and which is the diver's. */
  show() {
    const [main, ...others] = this.page.explorer.receivers;
    for (const [name, { row, box, use }] of this.rows) {
      box.checked = name === "raw" || name === main || others.includes(name);
      box.disabled = name === "raw" || name === main;
      use.hidden = name === "raw" || name === main;
      row.classList.toggle("own", name === main);
    }
  }

  take(receivers, styles, main) {
    const best = bestOf(receivers), own = receivers[main];
    const left = [...this.rows.keys()].filter((name) => !receivers[name]), { doubts } = this.page.explorer;
    for (const [name, { row, cells, mark, doubt }] of this.rows) {
      put(doubt.firstChild, doubts[name] ?? "");
      doubt.hidden = !doubts[name];
      const found = receivers[name];
      row.classList.toggle("best", name === best.name);
      mark.replaceChildren(...(found && styles[name] ? [swatch(styles[name])] : []));
      const claim = found && claimIn(found);
      const texts = found ? [length(found.p95), length(found.p50), claim.short,
        count(found.lost, found.runs), count(found.misleading, found.misleadingKnown),
        name === main ? "" : count(wins(found, own, 1).won, found.runs)] : ["", "", "", "", "", ""];
      texts.forEach((text, i) => put(cells[i], text));
      cells[2].dataset.verdict = claim?.kind ?? "";
    }
    put($("than"), main);
    put($("best"), best.words);
    put($("best-note"), best.note + (left.length ? ` (not tried: ${left.join(", ")})` : ""));
  }
}

const count = (n, of) => of ? (n ? `${whole(n)} of ${whole(of)}` : "none") : "–";

// In how many dives one is better than another, on the same noise, by their RMS error; and whether
// it surely is: `orchestrator/comparison/common/statistics.py`.
function wins(one, other, pairs) {
  const errors = [one, other].map(({ each }) => each.rms.map((it) => Number.isFinite(it) ? it : Infinity));
  const won = errors[0].filter((it, i) => it < errors[1][i]).length;
  const lost = errors[0].filter((it, i) => it > errors[1][i]).length;
  return { won, sure: won > lost && binomialBelow(lost + 1, won + lost, 0.5) <= RISK / (2 * pairs) };
}

// The receiver that is better than all others; otherwise the two between which nothing is sure.
function bestOf(receivers) {
  const [[name, first], ...others] = Object.entries(receivers).sort(([, a], [, b]) => a.p95 - b.p95);
  if (!others.length) return { name: null, words: name, note: "no other is compared" };
  const pairs = others.length * (others.length + 1) / 2;
  const found = others.map(([label, it]) => ({ label, n: it.runs, ...wins(first, it, pairs) }));
  const rival = found.find(({ sure }) => !sure), [next] = found;
  return rival
    ? { name: null, words: `${name} or ${rival.label}`, note: "no difference that is clear of chance" }
    : { name, words: name, note: `better than ${next.label} in ${whole(next.won)} of ${whole(next.n)} dives` };
}
