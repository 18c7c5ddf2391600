// What workers of a page compute besides runs, for `serve` of `orchestrator/wasm/engine.js`.
//
// kit: { module, facts, sources, legs } of the bound and its rules; told: see `conditionsIn`.

import { Plan } from "../../wasm/engine.js";
import { possibleAt } from "./area.js";
import { Bound } from "./bound.js";
import { conditionsOf, possibleOf } from "./possible.js";

export const TASKS = {
  /** What was possible in the dive of a seed: see `possibleOf`. */
  possible: ({ engine, kit }, { plan: { content, ...description }, seed, told }) => {
    const plan = new Plan(description, content), { instants, receivers: labels } = plan;
    return possibleOf(conditionsIn(kit, told), { record: engine.record(plan, seed), instants, labels });
  },
  /** What is possible at places: see `possibleAt`. */
  places: ({ kit }, { told, circle, span, places }) => possibleAt(conditionsIn(kit, told), circle, span, places),
};

// The conditions of `conditionsOf` from what a message can hold: values of keys (a Map), start values of
// parameters by name, keys that have an effect (a Set), and the rest.
function conditionsIn(kit, { values, starts, effects, ...told }) {
  const { module, facts, sources, legs } = kit;
  kit.bound ??= new Bound(module, facts.task);
  return conditionsOf({
    ...told, bound: kit.bound, facts, sources, legs, of: (path) => values.get(path),
    starts: (parameter) => starts[parameter], hasEffect: (path) => effects.has(path),
  });
}
