// The verdict before the last change: its 95 % error beside the new one, what was different then, and
// the way back to it.
//
//   new Before(page)
//   .leave()                the settings are others now
//   .show()                 there is a verdict on them
//   .keep(within, main)     all their dives are done
//   .sentence               what it was; empty if there is nothing to say

import { $, put } from "./dom.js";
import { PLACES } from "./controls.js";
import { inside } from "./names.js";
import { length, typed } from "./phrases.js";

const NAMED = 2; // differences that are named
const PATH = /^target\.(trajectory|waypoint_|track_|center_|radius_|side_|heading_|turns|path_length)/;

export class Before {
  constructor(page) {
    Object.assign(this, { page, kept: null, last: null, sentence: "" });
    $("undo-change").addEventListener("click", () => this.undo());
  }

  keep(within, main) {
    const { explorer } = this.page;
    this.kept = {
      within, main, seed: explorer.seed, given: explorer.given, link: explorer.link(),
      said: new Map(this.page.fields.map((it) => [it.path, it.said])),
    };
  }

  leave() {
    this.last = this.kept ?? this.last; // settings that were passed by have no verdict
    this.kept = null;
    this.put("");
  }

  undo() {
    this.page.adopt(this.last.link);
    $("verdict").focus(); // the button goes away until there is a verdict
  }

  // What was different then, in words.
  get differences() {
    const { page: { explorer, fields }, last } = this, now = explorer.given, others = new Set();
    const paths = new Set([...last.given.keys(), ...now.keys()].filter(
      (it) => JSON.stringify(last.given.get(it)) !== JSON.stringify(now.get(it))));
    for (const { key } of fields) // a grade stands for all keys that it sets
      if (key.sets && paths.has(key.path)) for (const it of this.page.changes.setBy(key.path)) paths.delete(it);
    const controls = fields.filter(({ path }) => paths.delete(path))
      .map(({ path, name }) => `${inside(name)} ${last.said.get(path)}`);
    for (const path of paths)
      others.add(PLACES.includes(path) ? "other beacons" : PATH.test(path) ? "another path"
        : `${path.split(".")[1]} ${said(last.given.get(path))}`);
    const [main] = explorer.receivers;
    return [...main === last.main ? [] : [last.main], ...controls, ...others,
      ...explorer.seed === last.seed ? [] : [`seed ${last.seed}`]];
  }

  show() {
    const all = this.last ? this.differences : [], more = all.length - NAMED;
    const words = [...all.slice(0, NAMED), ...more > 0 ? [`${more} other setting${more > 1 ? "s" : ""}`] : []];
    const with_ = words.length > 1 ? `${words.slice(0, -1).join(", ")} and ${words.at(-1)}` : words[0];
    this.put(all.length ? `was ${length(this.last.within)} with ${with_}` : "");
  }

  // Its line keeps its place, once there is one.
  put(sentence) {
    this.sentence = sentence;
    for (const id of ["was", "glance-was"]) put($(id), sentence);
    $("before").hidden = !this.last;
    $("before").classList.toggle("unseen", !sentence);
  }
}

const said = (value) => value === undefined ? "not given" : Array.isArray(value) ? "of other numbers" : typed(value);
