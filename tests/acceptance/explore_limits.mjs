// Limits of a page without a page: node explore_limits.mjs FOLDER_OF_MODULES CASES ANSWERS
import { readFileSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [folder, from, to] = process.argv.slice(2);
const { cases, module, task } = JSON.parse(readFileSync(from, "utf8"));
const load = (name) => import(pathToFileURL(`${folder}/${name}.js`));
const information = await load("information"), { Bound } = await load("bound");
const bound = await Bound.load(Buffer.from(module, "base64"), task);
const answers = cases.map(({ name, keys, arguments: given }) => {
  const own = keys ? [(key) => keys[key], ...given] : given;
  const found = name === "covariances" ? bound.covariances(...own) : information[name](...own);
  return ArrayBuffer.isView(found) ? [...found] : name === "covariances"
    ? Object.values(found).map((it) => [...it]) : found;
});
writeFileSync(to, JSON.stringify(answers));
