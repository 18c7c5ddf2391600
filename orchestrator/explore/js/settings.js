// Every key in a list that can be searched; rows are made when they are shown.

import { $, element, put } from "./dom.js";
import { Field } from "./field.js";
import { hasEffect, wordsOf } from "./controls.js";

const MOST = 60;

export class SettingsList {
  constructor(page) {
    Object.assign(this, { page, fields: new Map() });
    const search = $("search");
    search.addEventListener("input", () => this.find());
    $("only-changed").addEventListener("change", () => this.find());
    this.find();
  }

  // All words must be in the key, its description or the words of its control, in the singular, too.
  find() {
    const words = $("search").value.toLowerCase().split(/\s+/).filter(Boolean);
    const only = $("only-changed").checked, { explorer, changes } = this.page;
    const found = words.length || only ? explorer.keys.filter((key) => {
      const text = `${key.path} ${key.words} ${wordsOf(key.path)}`.toLowerCase().replaceAll("_", " ");
      const has = (word) => text.includes(word) || /s$/.test(word) && text.includes(word.replace(/e?s$/, ""));
      return words.every((word) => has(word.replaceAll("_", " ")))
        && (!only || changes.has(key.path));
    }) : [];
    const shown = found.slice(0, MOST);
    $("found").replaceChildren(...tables(shown).map(([table, keys]) => element("fieldset", {},
      element("legend", {}, `[${table}]`), ...keys.map((key) => this.field(key).element))));
    put($("found-note"), words.length || only
      ? `${found.length} of ${explorer.keys.length} settings${found.length > MOST ? `; the first ${MOST} are shown` : ""}`
      : `${explorer.keys.length} settings: type a word, such as depth, gps or echo`);
    this.show();
  }

  field(key) {
    if (!this.fields.has(key.path))
      this.fields.set(key.path, new Field(this.page, key.path, { label: key.key, wide: true }));
    return this.fields.get(key.path);
  }

  show() {
    for (const field of this.fields.values()) {
      if (!field.element.isConnected) continue;
      field.show();
      field.element.classList.toggle("idle", !hasEffect(this.page, field.key));
    }
  }
}

function tables(keys) {
  const found = new Map();
  for (const key of keys) found.set(key.table, [...(found.get(key.table) ?? []), key]);
  return [...found];
}
