// What has changed since the page was opened: the reader's settings against those of the scenario.
//
//   new Changes(explorer)     before anything is changed
//   .has(path), .all
//   .choose(path, value)     sets a key, or unsets it for ""; null or the sentence of the problem
//   .replace(path, value, others)     sets a key and resets others
//   .reset(...paths)         the scenario's own values again; with a grade, those of its keys

export class Changes {
  constructor(explorer) {
    this.explorer = explorer;
    this.keys = new Map(explorer.keys.map((key) => [key.path, key]));
    this.first = explorer.given;
    this.refresh();
  }

  // After a change: which keys differ.
  refresh() {
    this.all = this.explorer.changed;
    this.set = new Set(this.all);
  }

  has(path) { return this.set.has(path); }

  choose(path, value) {
    if (value === "") return this.keys.get(path).sets ? this.reset(path) : this.explorer.unset(path);
    return this.explorer.set(path, value);
  }

  /** Set a key, and reset others that would leave it without an effect. */
  replace(path, value, others) {
    const given = Object.fromEntries(others.map((it) => [it, this.first.get(it) ?? null]));
    return this.explorer.apply({ given: { ...given, [path]: value } });
  }

  reset(...paths) {
    const all = new Set(paths.flatMap((path) => [path, ...this.setBy(path)]));
    return this.explorer.apply({
      given: Object.fromEntries([...all].map((path) => [path, this.first.get(path) ?? null])),
    });
  }

  // Keys that a grade sets.
  setBy(path) {
    const { table, sets } = this.keys.get(path);
    return sets ? [...new Set(Object.values(sets).flatMap(Object.keys))].map((key) => `${table}.${key}`) : [];
  }
}
