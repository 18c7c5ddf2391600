// Values of keys: read from what people type, checked against their declaration, and written as a
// scenario file has them. Messages are those of `orchestrator/scenario/messages.py`.

import { brief, settled, written } from "./numbers.js";

const LONGEST = 80;
const INTEGER = /^[+-]?\d+$/, NUMBER = /^[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$|^[+-]?(?:inf|nan)$/;

/** Why a value is refused, in the words of a scenario file: an Error for people. */
export class Refusal extends Error {}

// A number that is written with a point: 3.0 is no whole number.
class Decimal {
  constructor(value) { this.value = value; }
}

/**
 * The value of a key: a number, a name, true or false, or a flat array.
 *
 * Text is read as in a scenario file; names need no quotes. Throws a Refusal.
 */
export function valueOf(key, given) {
  return checked(key, typeof given === "string" ? read(key, given.trim()) : raw(given));
}

function raw(given) {
  if (Array.isArray(given)) return given.map(raw);
  return typeof given === "number" && !Number.isInteger(given) ? new Decimal(given) : given;
}

function read(key, text) {
  const isArray = key.kind === "vector" || key.kind === "matrix";
  if (text.startsWith("[") || (isArray && text.includes(","))) return readArray(text) ?? text;
  if (text === "true" || text === "false") return text === "true";
  if (INTEGER.test(text) || NUMBER.test(text)) return readNumber(text);
  const quoted = /^"([^"\\]*)"$|^'([^']*)'$/.exec(text);
  return quoted ? quoted[1] ?? quoted[2] : text;
}

// Nested arrays; the outer brackets may be left out. Undefined: there are none.
function readArray(text) {
  const words = (text.startsWith("[") ? text : `[${text}]`)
    .replace(/[^[\],\s]+/g, (word) => JSON.stringify(word)).replace(/,\s*\]/g, "]");
  const each = (it) => Array.isArray(it) ? it.map(each) : it[0] === '"' ? it.slice(1, -1)
    : INTEGER.test(it) || NUMBER.test(it) ? readNumber(it) : it;
  try {
    return each(JSON.parse(words));
  } catch {
    return undefined;
  }
}

function readNumber(text) {
  if (INTEGER.test(text)) return Number(text);
  const word = text.replace(/^[+-]/, "");
  const size = word === "inf" ? Infinity : word === "nan" ? NaN : Number(word);
  return new Decimal(text.startsWith("-") ? -size : size);
}

function checked(key, given) {
  if (key.kind === "vector" || key.kind === "matrix") return elements(key, given);
  if (key.kind === "choice") {
    const name = key.path === "receiver.prior" && given === true ? "true" : given;
    if (key.choices.includes(name)) return name;
    refuse(key, `must be ${either(key.choices)}`, given);
  }
  if (key.kind === "switch") {
    if (typeof given === "boolean") return given;
    refuse(key, "must be true or false", given);
  }
  if (key.names?.includes(given)) return given;
  if (key.names) return orName(key, given);
  return number(key, given, "", key.kind === "integer");
}

function number(key, given, element, whole) {
  const value = given instanceof Decimal ? given.value : given;
  const said = (must) => refuse(key, must, given, element);
  if (typeof value !== "number") said(whole ? "must be a whole number" : "must be a number");
  if (whole && given instanceof Decimal) said("must be a whole number");
  if (!Number.isFinite(value)) said("must be a finite number");
  const shown = whole ? String : written, { least, most, above, below } = key.bounds;
  if (least !== undefined && value < least) said(`must be at least ${shown(least)}`);
  if (most !== undefined && value > most) said(`must be at most ${shown(most)}`);
  if (above !== undefined && value <= above) said(`must be more than ${shown(above)}`);
  if (below !== undefined && value >= below) said(`must be less than ${shown(below)}`);
  return key.time ? settled(value) : value;
}

// A number or a name: the duration, and numbers with named values.
function orName(key, given) {
  const value = given instanceof Decimal ? given.value : given, { least, most, above, below } = key.bounds;
  const names = key.names.map((it) => `'${it}'`).join(" or ");
  if (key.path === "time.duration_s") {
    if (typeof value !== "number") refuse(key, `must be a number or ${names}`, given);
    if (!(value > above && value < Infinity)) refuse(key, `must be more than ${above}`, given);
    if (value >= below) refuse(key, `must be less than ${brief(below)}`, given);
    return settled(value);
  }
  const must = typeof value !== "number" ? "a number" : !Number.isFinite(value) ? "a finite number"
    : value < least ? `at least ${brief(least)}` : value > most ? `at most ${brief(most)}` : null;
  if (must) refuse(key, `must be ${must} or ${names}`, given);
  return value;
}

function elements(key, given) {
  if (!Array.isArray(given)) refuse(key, "must be an array", given);
  const rows = given.map((it) => Array.isArray(it) ? it : [it]), flat = rows.flat();
  const { columns, rows: [low, high] } = key, count = flat.length / columns;
  const lengths = [...new Set(rows.map((it) => it.length))];
  const even = !lengths.length || (lengths.length === 1 && [1, columns].includes(lengths[0]));
  if (!Number.isInteger(count) || count < low || count > high || !even) {
    const most = low ? `${low} to ${high}` : `at most ${high}`;
    const wanted = low === high ? `${columns > 1 ? `${low} x ${columns}` : low} numbers`
      : columns > 1 ? `${most} rows of ${columns} numbers` : `${most} numbers`;
    refuse(key, `must be an array of ${wanted}`, given);
  }
  return flat.map((it, i) => {
    const row = Math.floor(i / columns) + 1;
    const element = columns > 1 ? `[${row},${i % columns + 1}]` : `[${row}]`;
    return number(key, it, key.parameter ? element : "", key.whole);
  });
}

function refuse(key, must, got, element = "") {
  const where = key.table ? `[${key.table}] ${key.key}` : key.key;
  throw new Refusal(`${where}${element}: ${must}, got ${short(toml(got))}`);
}

function either(names) {
  const quoted = names.map((it) => `'${it}'`), last = quoted.pop();
  return quoted.length ? `${quoted.join(", ")} or ${last}` : last;
}

export function short(text, most = LONGEST) {
  const end = Math.floor(most / 3);
  return text.length <= most ? text : `${text.slice(0, most - end - 3)}...${text.slice(-end)}`;
}

function toml(value) {
  if (value instanceof Decimal) return written(value.value);
  if (Array.isArray(value)) return `[${value.map(toml).join(", ")}]`;
  return typeof value === "string" ? JSON.stringify(value) : String(value);
}

// --- Writing -------------------------------------------------------------------------------------

/** A value of a key as a scenario file has it. */
export function textOfValue(key, value) {
  const one = (it) => typeof it !== "number" ? toml(it)
    : key.kind === "integer" || key.whole ? String(it) : written(it);
  if (!Array.isArray(value)) return one(value);
  if (key.kind !== "matrix") return `[${value.map(one).join(", ")}]`;
  const rows = [];
  for (let i = 0; i < value.length; i += key.columns)
    rows.push(`[${value.slice(i, i + key.columns).map(one).join(", ")}]`);
  return `[${rows.join(", ")}]`;
}

/** A scenario file with the given keys. */
export function fileOf(data, given, seed) {
  const lines = [`name = ${toml(data.name)}`, `title = ${toml(data.title)}`, `seed = ${seed}`,
    `fmi = ${data.fmi}`];
  let table = "";
  for (const key of data.keys) {
    if (!given.has(key.path)) continue;
    if (key.table !== table) lines.push("", `[${key.table}]`);
    table = key.table;
    lines.push(`${key.key} = ${textOfValue(key, given.get(key.path))}`);
  }
  return `${lines.join("\n")}\n`;
}
