// What is said first: how far off, what to buy first, and whether the claim holds.

import { $, put, swatch } from "./dom.js";
import { decimal } from "../../web/js/pen.js";
import { length, share, whole } from "./phrases.js";

/** From `explorer.dives`: while the runs are done, and when they are. */
export function showVerdict({ done, n, receivers }, styles, main) {
  const own = receivers[main];
  for (const id of ["within", "glance-within"]) put($(id), length(own.p95));
  put($("glance-whose"), main);
  put($("half"), length(own.p50));
  $("whose").replaceChildren(swatch(styles[main]), main);
  put($("so-far"), done < n ? `${whole(done)} of ${whole(n)} dives` : `${whole(n)} dives`);
  $("progress").hidden = done >= n;
  Object.assign($("progress"), { value: done, max: n });
  put($("lost"), own.lost ? `, lost in ${whole(own.lost)}` : "");
  showClaim(own, main);
}

// The verdicts of `orchestrator/judge/consistency.py`, in short and in a sentence.
const CLAIMS = {
  "in band": ["holds", "holds", () => "as large as the true one"],
  pessimistic: ["holds", "holds", (times) => `on the safe side, ${times} times as large as the true one`],
  optimistic: ["fails", "too small", (times) => `too small: the true one is ${times} times as large`],
};

/** What is said of a claim: { kind, short, words }. */
export function claimIn({ claim: { verdict, factor } }) {
  const [kind, short, words] = CLAIMS[verdict] ?? ["unknown", "not known yet", null];
  const times = decimal(verdict === "pessimistic" ? 1 / factor : factor, 2);
  return { kind, short, words: words ? words(times) : null };
}

function showClaim(own, main) {
  const { kind, short, words } = claimIn(own);
  put($("holds"), short);
  $("holds").dataset.verdict = kind;
  put($("claim"), words ? `The error that ${main} claims is ${words}.` : "");
}

/** From `explorer.causes`; null while they are not known. */
export function showBuy(found, own) {
  const best = found?.causes.find((it) => it.name === found.first)?.better;
  if (!found) {
    put($("buy"), "…");
    put($("then"), "while dives without each cause run");
  } else if (!best) {
    put($("buy"), "nothing");
    put($("then"), "no better equipment has a gain that is clear of chance");
  } else {
    put($("buy"), best.device);
    put($("then"), `${best.detail ? `${best.detail}; ` : ""}then about ${length(own * (1 - best.gain))} (−${share(best.gain)}), clear of chance`);
  }
}

/** What screen readers are told when all is known. */
export function tell(within, main, before) {
  put($("told"), `95 % of the time you are within ${length(within)}, with ${main}${before && `; it ${before}`}. `
    + `Buy first: ${$("buy").textContent}, ${$("then").textContent}. Best receiver: ${$("best").textContent}, `
    + `${$("best-note").textContent}. ${$("claim").textContent} ${$("reach").textContent}`);
}
