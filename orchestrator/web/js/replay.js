// The page that plays a run: reads its data, and joins drawings, player and controls.

import { KINDS, claimOf, errorOf, pointAt, readRun, standing } from "./data.js";
import { Stage } from "./stage.js";
import { metres } from "./words.js";

const $ = (id) => document.getElementById(id);

class Page {
  constructor(run, title, kind) {
    this.run = run;
    this.stage = new Stage(run, { title, kind, onTime: (t) => this.showNumbers(t) });
    this.bind();
    this.open();
  }

  bind() {
    const { stage } = this;
    $("kind")?.addEventListener("change", () => { stage.state.kind = $("kind").value; stage.remeasure(); });
    document.querySelectorAll("[data-receiver]").forEach((box) => {
      box.addEventListener("change", () => {
        stage.state.shown[box.dataset.receiver] = box.checked;
        stage.remeasure();
      });
    });
    addEventListener("hashchange", () => this.open());
  }

  // A link may name the time and the view: replay.html#t=120&view=space
  open() {
    const { stage } = this, asked = new URLSearchParams(location.hash.slice(1));
    if (asked.has("view")) stage.turnTo(asked.get("view") === "space");
    if (KINDS[asked.get("error")]) {
      $("kind").value = stage.state.kind = asked.get("error");
      stage.remeasure();
    }
    const t = parseFloat(asked.get("t"));
    stage.player.seek(Number.isNaN(t) ? stage.state.time : t);
  }

  showNumbers(time) {
    const { run, stage: { state } } = this;
    const put = (cell, text) => { if (cell && cell.textContent !== text) cell.textContent = text; };
    const at = run.diver ? pointAt(run.diver, run.time, time) : [];
    ["x", "y", "z"].forEach((k, i) => put(document.querySelector(`[data-truth="${k}"]`), metres(at[i] ?? NaN)));
    run.receivers.forEach((it, i) => {
      const now = standing(run, it, time), row = $(`receiver-${i}`);
      row.classList.toggle("off", !state.shown[i]);
      const cell = (name, value) => put(
        row.querySelector(`[data-cell="${name}"]`), now < 0 ? "–" : metres(value()));
      cell("error", () => errorOf(it, now, state.kind));
      cell("claim", () => claimOf(it, now, state.kind));
      ["x", "y", "z"].forEach((k) => cell(k, () => it.position[k][now]));
    });
  }
}

async function start() {
  const content = JSON.parse($("run").textContent);
  const run = await readRun(content);
  window.replay = new Page(run, content.title, content.error).stage;
  document.body.classList.add("ready");
}

start().catch((error) => {
  const problem = $("problem");
  problem.hidden = false;
  problem.textContent = typeof DecompressionStream === "undefined"
    ? "This browser is too old for this page: it lacks DecompressionStream." : `The run cannot be shown: ${error.message}`;
  throw error;
});
