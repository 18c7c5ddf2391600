// Runs the explorer of a page without a page: node explore_host.mjs EXPLORER.js CONTENTS JOBS ANSWERS
// A job has settings (see Explorer.apply), and what is asked: `record`, `dives` (their number), and so on.
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { Worker } from "node:worker_threads";

const [script, contents, jobs, to] = process.argv.slice(2);
const { Explorer } = await import(pathToFileURL(script));
const read = (file) => JSON.parse(readFileSync(file, "utf8"));
const textOf = (array) =>
  Buffer.from(array.buffer, array.byteOffset, array.byteLength).toString("base64");
const served = ["../../wasm/engine.js", "worker.js"].map((it) => `import("${new URL(it, pathToFileURL(script))}")`);
const worker = () => new Worker(
  `Promise.all([${served}]).then(([{ serve }, { TASKS }]) =>
    serve(require("node:worker_threads").parentPort, TASKS))`,
  { eval: true });
const explorers = {
  here: await Explorer.open(read(contents)),
  workers: await Explorer.open(read(contents), worker, 2),
};
for (const it of Object.values(explorers)) await it.loaded;
const { tablesOf } = await import(new URL("misfits.js", pathToFileURL(script)));
const { adopt, commandOf, readDive } = await import(new URL("recorded.js", pathToFileURL(script)));

// A recorded dive with its own settings, then with changed ones: { file, given, receivers }.
async function replayed(explorer, { file, given, receivers }) {
  let dive;
  try {
    dive = await readDive(readFileSync(file, "utf8"));
  } catch (error) {
    return { wrong: error.message };
  }
  const refused = adopt(explorer, dive) ?? explorer.apply({ given, receivers });
  if (refused !== null) return { refused };
  try {
    const { run } = explorer.replay(dive);
    return {
      run, tables: tablesOf(dive, run), command: commandOf(explorer, dive), said: dive.said,
      toml: explorer.toml(),
    };
  } catch (error) {
    return { wrong: error.message };
  }
}

async function answered({ settings, link, ask = [], steps = [], dives = 0, causes = 0, possible = 0, water, what, replay, by = "here" }) {
  const explorer = explorers[by];
  explorer.reset();
  const refused = explorer.apply(link ? Explorer.settingsOf(link) : settings ?? {});
  const found = { refused, steps: steps.map(([name, ...rest]) => explorer[name](...rest)) };
  if (refused !== null) return found;
  for (const name of ask) {
    if (name === "record") {
      const { values } = explorer.record();
      found.record = Object.fromEntries(
        Object.entries(values).map(([key, it]) => [key, textOf(it)]));
    } else found[name] = typeof explorer[name] === "function" ? explorer[name]() : explorer[name];
  }
  if (dives) {
    found.shown = [];
    found.dives = await explorer.dives(dives, (part) => found.shown.push(part));
  }
  if (causes) found.causes = await explorer.causes(() => {}, causes);
  if (replay) found.replay = await replayed(explorer, replay);
  if (possible) found.possible = await explorer.possible(possible);
  if (water) found.water = await explorer.water(water, () => {}, undefined, what);
  return found;
}

const answers = [];
for (const job of read(jobs)) answers.push(await answered(job));
writeFileSync(to, JSON.stringify(answers, (_, it) =>
  it instanceof Map ? Object.fromEntries(it) : it instanceof Float64Array ? [...it]
    : it === Infinity ? "inf" : it));
process.exit(0); // workers wait for more
