// The controls of what matters most, in groups; every other key is in the list of `settings.js`.

import { $, element } from "./dom.js";
import { Field } from "./field.js";
import { nameOf } from "./names.js";

// 0 and a decade-wise row of round numbers.
function decades(from, to, steps = [1, 1.5, 2, 3, 5, 7]) {
  const found = [0];
  for (let power = from; power < to; power++)
    found.push(...steps.map((step) => Number(`${step}e${power}`)));
  return [...found, Number(`1e${to}`)];
}

const shares = [0, 0.01, 0.02, 0.05, ...Array.from({ length: 15 }, (_, i) => (2 + i) * 5 / 100)];
const GPS = {
  standalone: "Standalone", sbas: "SBAS", differential: "Differential", rtk_float: "RTK, float",
  rtk_fixed: "RTK, fixed",
};
const CLOCKS = { crystal: "Crystal", tcxo: "TCXO", ocxo: "OCXO", csac: "Atomic (CSAC)" };
const SEAS = {
  0: "Beaufort 0, calm", 1: "Beaufort 1, light air", 2: "Beaufort 2, light", 3: "Beaufort 3, gentle",
  4: "Beaufort 4, moderate", 5: "Beaufort 5, fresh", 6: "Beaufort 6, strong",
};

// Keys that say where the beacons are, if they are not at the ends of the platform's arms.
export const PLACES = ["beacon_m", "beacons", "arrangement", "beacon_scale", "mounting_error_m"].map((it) => `platform.${it}`)
  .concat("acoustics.slot_order", "receiver.beacon_offset_m");

const GROUPS = [
  ["Equipment", [
    ["platform.gps_grade", { names: GPS,
      about: "The kind of GPS at the beacons, from standalone, the least accurate, to RTK. It sets all numbers of the GPS." }],
    ["platform.gps_horizontal_markov_std_m", { stops: decades(-2, 1),
      about: "How far the GPS position drifts, slowly, to the north and to the east (standard deviation)." }],
    ["platform.imu_grade", {
      about: "The sensor of heading, roll and pitch on the platform. A grade sets all its numbers." }],
    ["platform.imu_heading_bias_deg", { stops: [0, 0.1, 0.2, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 15, 20],
      about: "A fixed error of the platform's heading. It turns all reported beacons, so far divers are more off." }],
    ["acoustics.clock_grade", { names: CLOCKS,
      about: "The kind of clock that times the pings. A range is a travel time, so an error of the clock is one of all ranges." }],
    ["acoustics.clock_offset_s", { stops: decades(-5, -2, [1, 2, 3, 5, 7, 9]),
      about: "How far the diver's clock is off at the start. One thousandth of a second is about 1.5 m in each range." }],
    ["acoustics.range_std_m", { stops: decades(-2, 1),
      about: "The random error of each measured distance to a beacon (standard deviation)." }],
    ["platform.arm_length_m", { stops: [0.2, 0.3, 0.4, 0.5, 0.75, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30],
      instead: PLACES,
      about: "How far each beacon is from the middle of the platform, on a cross. If beacons were moved, a length puts them back on the cross." }],
  ]],
  ["Timing", [
    ["time.sampling_time_s", { stops: [0.1, 0.2, 0.25, 0.5, 1, 2, 3, 4, 5, 10],
      about: "The beacons ping one after the other, unless the schedule is another one: this is the time from one ping to the next." }],
    ["time.ekf_ratio", { stops: [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20],
      about: "After how many pings the receiver computes a new position." }],
  ]],
  ["Water", [
    ["platform.beaufort", { names: SEAS,
      about: "The wind force, which sets the waves that move the beacons." }],
    ["acoustics.loss_probability", { stops: shares,
      about: "Share of the pings that do not arrive: 0.25 is one in four." }],
    ["acoustics.outlier_probability", { stops: shares,
      about: "Share of the ranges that are too long, because the sound came by a detour, as echoes do: 0.05 is one in twenty." }],
    ["acoustics.sound_speed_m_s", { stops: [1430, 1440, 1450, 1460, 1470, 1480, 1490, 1500, 1510, 1520, 1530, 1540, 1550],
      about: "The true speed of sound in the water. The receiver computes with one that it assumes." }],
  ]],
  ["Diver", [
    ["target.speed_m_s", { stops: [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1, 1.5, 2],
      about: "How fast the diver swims along the path. A faster dive ends sooner." }],
    ["target.depth_start_m", { stops: [0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40] }],
    ["target.depth_end_m", { stops: [0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40] }],
  ]],
];

/** What a key is called beside its control, and what is said of it. */
export const wordsOf = (path) => {
  const found = GROUPS.flatMap(([, rows]) => rows).find(([it]) => it === path);
  return found ? `${nameOf(path)} ${found[1].about ?? ""}` : "";
};

/** The groups of controls, in the element "controls"; all their fields. */
export function makeControls(page) {
  const fields = [];
  for (const [name, rows] of GROUPS) {
    const own = rows.filter(([path]) => page.changes.keys.has(path))
      .map(([path, options]) => new Field(page, path, { label: nameOf(path), ...options }));
    fields.push(...own);
    $("controls").append(element("fieldset", {},
      element("legend", {}, name), ...own.map((field) => field.element)));
  }
  return fields;
}

/** Whether a control is of use: it has an effect, was changed, or replaces keys that were. */
export function isShown(page, { key, path, instead }) {
  return hasEffect(page, key) || page.changes.has(path)
    || (wasOnCross(page) && instead.some((it) => page.changes.has(it)));
}

const wasOnCross = ({ changes: { first } }) =>
  !first.has("platform.beacon_m") && first.get("platform.arrangement") !== "given";

// Whether a key has an effect: at least one condition of each group must hold.
export function hasEffect({ explorer, changes }, key) {
  return (key.needs ?? []).every((group) => group.some(([other, wanted]) => {
    const path = `${key.table}.${other}`, numbers = [explorer.value(path)].flat().map(
      (it) => typeof it === "number" ? it : changes.keys.get(path)?.numbers?.[it]);
    return wanted.length ? wanted.includes(numbers[0]) : numbers.some((it) => it !== 0);
  }));
}
