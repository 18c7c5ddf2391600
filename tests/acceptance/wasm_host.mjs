// What a host of `engine.js` answers to a job of test_wasm_lanes.py, in node and in a browser.
// node wasm_host.mjs ENGINE.mjs WORKER.mjs JOB.json ANSWER.json
export const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const textOf = (array) => {
  let text = "";
  const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  for (let i = 0; i < bytes.length; i += 8192)
    text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
};
const packed = (found) => Object.fromEntries(
  Object.entries(found).map(([name, it]) => [name, ArrayBuffer.isView(it) ? textOf(it) : packed(it)]));

/** worker: makes a worker; stop: ends it. */
export async function answer({ Engine, Plan, Pool }, job, worker) {
  const engine = await Engine.load(bytesOf(job.module).buffer);
  const plan = new Plan(job.description, bytesOf(job.content).buffer);
  const found = { record: engine.record(plan, job.recorded) };
  found["0"] = engine.run(plan, job.seeds, job.percentages);
  for (const count of job.workers) {
    const workers = Array.from({ length: count }, worker);
    const pool = new Pool(engine, workers);
    pool.add("plan", plan);
    found[count] = await pool.run("plan", job.seeds, job.percentages, job.part);
    for (const it of workers) it.terminate();
  }
  return JSON.stringify(packed(found));
}

if (globalThis.process?.argv?.[1]?.endsWith("wasm_host.mjs")) {
  const [{ readFileSync, writeFileSync }, { Worker }, { pathToFileURL }] = await Promise.all(
    ["node:fs", "node:worker_threads", "node:url"].map((name) => import(name)));
  const [engine, script, job, to] = process.argv.slice(2);
  const worker = () => new Worker(pathToFileURL(script));
  const made = await import(pathToFileURL(engine));
  writeFileSync(to, await answer(made, JSON.parse(readFileSync(job, "utf8")), worker));
}
