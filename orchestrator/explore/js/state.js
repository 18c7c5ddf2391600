// What has changed since the page was opened: the reader's settings against those of the scenario.
//
//   new Changes(explorer)
//   .has(path), .all, .reset(path), .resetAll()
//   .choose(path, value)        sets a key; null or the sentence of the problem
//   .chooseGrade(path, value)   sets a key that sets others, and takes those back

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

export class Changes {
  constructor(explorer) {
    this.explorer = explorer;
    this.first = new Map(explorer.given);
    this.keys = new Map(explorer.keys.map((key) => [key.path, key]));
  }

  has(path) {
    return !same(this.explorer.given.get(path), this.first.get(path));
  }

  get all() {
    const paths = new Set([...this.first.keys(), ...this.explorer.given.keys()]);
    return [...paths].filter((path) => this.has(path));
  }

  choose(path, value) {
    const { explorer } = this, key = this.keys.get(path);
    if (key?.sets) return this.chooseGrade(path, value);
    if (value === "") {
      explorer.unset(path);
      return null;
    }
    return explorer.set(path, value);
  }

  chooseGrade(path, value) {
    const { explorer } = this, { table, sets } = this.keys.get(path);
    const own = [...new Set(Object.values(sets).flatMap((it) => Object.keys(it)))]
      .map((key) => `${table}.${key}`);
    if (value === "") { // the scenario's own numbers again
      for (const it of [path, ...own]) this.reset(it);
      return null;
    }
    const problem = explorer.set(path, value);
    if (problem) return problem;
    for (const it of own) explorer.unset(it);
    return null;
  }

  reset(path) {
    if (!this.has(path)) return null;
    if (this.first.has(path)) return this.explorer.set(path, this.first.get(path));
    this.explorer.unset(path);
    return null;
  }

  // Keys of a grade come after it, and some are valid only together: more than one round.
  resetAll() {
    for (let round = 0; round < 3 && this.all.length; round++)
      for (const path of this.all) this.reset(path);
  }
}
