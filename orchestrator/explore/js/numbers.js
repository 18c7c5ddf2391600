// Numbers as scenario files and messages write them, and times in whole nanoseconds (BigInt).

const SECOND = 1_000_000_000n;
const ROUNDING = 4; // units in the last place by which a time may miss a nanosecond

// Digits of the shortest decimal of a number and its exponent: 12.5 is ["125", 2], 0.125 is ["125", 0].
function decimal(value) {
  const [, whole, part = "", power = "0"] =
    /^(\d+)(?:\.(\d+))?(?:e([+-]\d+))?$/.exec(String(Math.abs(value)));
  const all = whole + part, digits = all.replace(/^0+/, "") || "0";
  return [digits.replace(/0+$/, "") || "0", whole.length - (all.length - digits.length) + Number(power)];
}

// A number as Python and scenario files write it: 1.0, 1e-05.
export function written(value) {
  if (!Number.isFinite(value)) return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  const sign = value < 0 || Object.is(value, -0) ? "-" : "";
  if (value === 0) return `${sign}0.0`;
  const [digits, point] = decimal(value);
  if (point > 16 || point < -3) {
    const rest = digits.length > 1 ? `.${digits.slice(1)}` : "", power = Math.abs(point - 1);
    return `${sign}${digits[0]}${rest}e${point > 0 ? "+" : "-"}${String(power).padStart(2, "0")}`;
  }
  if (point <= 0) return `${sign}0.${"0".repeat(-point)}${digits}`;
  return `${sign}${digits.slice(0, point).padEnd(point, "0")}.${digits.slice(point) || "0"}`;
}

// A number with few digits, as messages have it (the format "g").
export function brief(value, digits = 6) {
  if (!Number.isFinite(value)) return written(value);
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  const trimmed = (text) => text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  if (power < -4 || power >= digits) {
    const size = String(Math.abs(power)).padStart(2, "0");
    return `${trimmed(mantissa)}e${power < 0 ? "-" : "+"}${size}`;
  }
  return trimmed(value.toFixed(Math.max(digits - 1 - power, 0)));
}

// The whole nanoseconds nearest to a time in s, given as a decimal number.
export function nanoseconds(seconds) {
  const [digits, point] = decimal(seconds), places = point + 9 - digits.length;
  let found;
  if (places >= 0) found = BigInt(digits) * 10n ** BigInt(places);
  else {
    const unit = 10n ** BigInt(-places), whole = BigInt(digits) / unit;
    const twice = 2n * (BigInt(digits) % unit);
    found = whole + (twice > unit || (twice === unit && whole % 2n === 1n) ? 1n : 0n);
  }
  return seconds < 0 ? -found : found;
}

// The number of seconds that is nearest to a whole number of nanoseconds.
export function seconds(time) {
  const size = time < 0n ? -time : time;
  const found = Number(`${size / SECOND}.${String(size % SECOND).padStart(9, "0")}`);
  return time < 0n ? -found : found;
}

// Distance from a number to the next larger one.
function step(value) {
  const size = Math.abs(value);
  if (size < 2 ** -1022) return 2 ** -1074;
  let power = Math.floor(Math.log2(size));
  if (2 ** power > size) power--;
  else if (2 ** (power + 1) <= size) power++;
  return 2 ** (power - 52);
}

export function isWhole(time) {
  return Math.abs(time - seconds(nanoseconds(time))) <= ROUNDING * step(time);
}

// A time without its rounding errors.
export const settled = (time) => isWhole(time) ? seconds(nanoseconds(time)) : time;

// A time for people, in s and without rounding.
export function textOf(time) {
  const size = time < 0n ? -time : time;
  const digits = `${size / SECOND}.${String(size % SECOND).padStart(9, "0")}`;
  return `${time < 0n ? "-" : ""}${digits.replace(/0+$/, "").replace(/\.$/, "")} s`;
}

export function leastMultiple(times) {
  const greatest = (a, b) => (b ? greatest(b, a % b) : a);
  return times.reduce((found, it) => found / greatest(found, it) * it, 1n);
}

export const divides = (part, whole) =>
  nanoseconds(part) > 0n && nanoseconds(whole) % nanoseconds(part) === 0n;
