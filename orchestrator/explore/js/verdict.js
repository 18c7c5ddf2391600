// What is said first: how far off, what to buy first, whether the claim holds, and other receivers.

import { $, element, put, swatch } from "./dom.js";
import { length, share } from "./phrases.js";

/** From `explorer.dives`: while the runs are done, and when they are. */
export function showVerdict({ done, n, receivers }, styles, main) {
  const own = receivers[main];
  put($("within"), length(own.p95));
  put($("half"), length(own.p50));
  put($("so-far"), done < n ? `${whole(done)} of ${whole(n)} dives` : `${whole(n)} dives`);
  $("progress").hidden = done >= n;
  Object.assign($("progress"), { value: done, max: n });
  put($("lost"), own.lost > 0 ? `lost in ${share(own.lost, own.lost < 0.095 ? 1 : 0)} of them` : "");
  showClaim(own);
  showOthers(receivers, styles, main);
}

const whole = (n) => n.toLocaleString("en").replaceAll(",", " ");

function showClaim(own) {
  put($("holds"), own.holds.short);
  $("holds").dataset.verdict = own.holds.kind;
  put($("claim"), own.holds.words);
}

function showOthers(receivers, styles, main) {
  const others = Object.keys(receivers).filter((name) => name !== main);
  $("others").replaceChildren(...others.flatMap((name) => [element("div", {},
    element("dt", {}, swatch(styles[name]), `95 %, ${name}`),
    element("dd", {}, length(receivers[name].p95)))]));
}

/** From `explorer.causes`; null while they are not known. */
export function showBuy(causes, own) {
  const best = causes?.find((it) => it.better?.clear);
  if (!causes) {
    put($("buy"), "…");
    put($("then"), "while the dives without each cause run");
  } else if (!best) {
    put($("buy"), "nothing");
    put($("then"), "better equipment gains nothing that is clear of chance");
  } else {
    put($("buy"), best.better.words);
    put($("then"), `then about ${length(own * (1 - best.better.gain))} (−${share(best.better.gain)}), clear of chance`);
  }
}

/** What screen readers are told when all is known. */
export function tell(within, main) {
  put($("told"), `95 % of the time you are within ${length(within)}, with ${main}. `
    + `Buy first: ${$("buy").textContent}, ${$("then").textContent}. ${$("claim").textContent}`);
}
