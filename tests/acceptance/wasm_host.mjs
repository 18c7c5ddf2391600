// What a host of `engine.js` answers to a job of test_wasm_lanes.py, in node and in a browser.
// node wasm_host.mjs ENGINE.mjs WORKER.mjs JOB.json ANSWER.json
export const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const wait = globalThis.setTimeout;
const textOf = (array) => {
  let text = "";
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  for (let i = 0; i < bytes.length; i += 8192)
    text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
};
const packed = (found) => Object.fromEntries(
  Object.entries(found).map(([name, it]) => [name, ArrayBuffer.isView(it) ? textOf(it) : name === "waits" || typeof it !== "object" ? it : packed(it)]));

/**
 * worker: makes a worker. Optional in a job: `changes` of parameters, the milliseconds by which the
 * first worker answers `late`, how many runs' parts each of the first workers survives (`dying`) or
 * does before it loops for ever (`hanging`), the `patience` of the pool, and whether it is told how
 * long that waits (`waits`): then it waits much longer.
 */
export async function answer(script, job, worker) {
  try {
    return JSON.stringify(packed(await found(script, job, worker)));
  } catch (error) {
    return JSON.stringify({ error: error.message });
  }
}

async function found({ Engine, Plan, Pool }, job, worker) {
  const engine = await Engine.load(bytesOf(job.module).buffer);
  const plan = new Plan(job.description, bytesOf(job.content).buffer);
  for (const [name, values] of Object.entries(job.changes ?? {})) plan.set(name, values);
  const found = { record: engine.record(plan, job.recorded) };
  if (job.waits) {
    found.waits = [];
    globalThis.setTimeout = (act, ms) => {
      found.waits.push(ms);
      return wait(act, 1e5 * ms);
    };
  }
  found["0"] = engine.run(plan, job.seeds, job.percentages);
  for (const count of job.workers) {
    const workers = [];
    const make = () => {
      workers.push(worker());
      return strange(workers.at(-1), workers.length - 1, job);
    };
    const pool = new Pool(engine, make, count, job.patience);
    pool.add("plan", plan);
    try {
      found[count] = await pool.run("plan", job.seeds, job.percentages, job.part);
    } finally {
      for (const it of workers) it.terminate();
    }
    found.started = workers.length;
  }
  return found;
}

/** A worker of node that answers late, dies or hangs. */
function strange(worker, number, { late = 0, dying = [], hanging = [] }) {
  if (!late && !dying.length && !hanging.length) return worker;
  let left = dying[number] ?? Infinity, useful = hanging[number] ?? Infinity;
  return {
    postMessage(message) {
      if (message.seeds && left-- <= 0) worker.terminate();
      else worker.postMessage({ ...message, hang: Boolean(message.seeds) && useful-- <= 0 });
    },
    on: (name, act) => worker.on(
      name, (data) => number || name !== "message" ? act(data) : wait(act, late, data)),
    terminate: () => worker.terminate(),
  };
}

if (globalThis.process?.argv?.[1]?.endsWith("wasm_host.mjs")) {
  const [{ readFileSync, writeFileSync }, { Worker }, { pathToFileURL }] = await Promise.all(
    ["node:fs", "node:worker_threads", "node:url"].map((name) => import(name)));
  const [engine, script, job, to] = process.argv.slice(2);
  const worker = () => new Worker(pathToFileURL(script));
  const made = await import(pathToFileURL(engine));
  writeFileSync(to, await answer(made, JSON.parse(readFileSync(job, "utf8")), worker));
}
