// Limits of a page without a page: node explore_limits.mjs FOLDER_OF_MODULES CASES ANSWERS
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [folder, from, to] = process.argv.slice(2);
const { cases, module, task } = JSON.parse(readFileSync(from, "utf8"));
const load = (name) => import(pathToFileURL(`${folder}/${name}.js`));
const { stateOf } = await load("record");
const states = (record, [instants, epochs], interval) => {
  const at = stateOf(record, instants.map(BigInt), BigInt(interval));
  return epochs.flatMap((it) => at(BigInt(it)).flat());
};
const functions = { ...await load("information"), ...await load("lengths"), states }, { Bound } = await load("bound");
const bound = new Bound(await WebAssembly.compile(Buffer.from(module, "base64")), task);
const answers = cases.map(({ name, keys, arguments: given }) => {
  const own = keys ? [(key) => keys[key], ...given] : given;
  const found = name === "covariances" ? bound.covariances(...own) : functions[name](...own);
  return ArrayBuffer.isView(found) ? [...found] : name === "covariances"
    ? Object.values(found).map((it) => [...it]) : found;
});
writeFileSync(to, JSON.stringify(answers, (_, it) => Number.isNaN(it) ? "nan" : it));
