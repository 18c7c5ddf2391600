// The controls of what matters most, in groups; every other key is in the list of `settings.js`.

import { $, element } from "./dom.js";
import { Field } from "./field.js";

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
  0: "0, calm", 1: "1, light air", 2: "2, light", 3: "3, gentle", 4: "4, moderate", 5: "5, fresh",
  6: "6, strong",
};

const GROUPS = [
  ["Equipment", [
    ["platform.gps_grade", { label: "GPS", names: GPS }],
    ["platform.gps_horizontal_markov_std_m", { label: "GPS, slow error", stops: decades(-2, 1) }],
    ["platform.imu_grade", { label: "IMU" }],
    ["platform.imu_heading_bias_deg", { label: "Compass error", stops: [0, 0.1, 0.2, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10, 15, 20] }],
    ["acoustics.clock_grade", { label: "Diver's clock", names: CLOCKS }],
    ["acoustics.clock_offset_s", { label: "Clock error at start", stops: decades(-5, -2, [1, 2, 3, 5, 7, 9]) }],
    ["acoustics.range_std_m", { label: "Range noise", stops: decades(-2, 1) }],
    ["platform.arm_length_m", { label: "Platform's arms", stops: [0.2, 0.3, 0.4, 0.5, 0.75, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30] }],
  ]],
  ["Timing", [
    ["time.sampling_time_s", { label: "Time between pings", stops: [0.1, 0.2, 0.25, 0.5, 1, 2, 3, 4, 5, 10] }],
    ["time.ekf_ratio", { label: "Pings per update", stops: [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20] }],
  ]],
  ["Water", [
    ["platform.beaufort", { label: "Sea, Beaufort", names: SEAS }],
    ["acoustics.loss_probability", { label: "Pings lost", stops: shares }],
    ["acoustics.outlier_probability", { label: "Late ranges (echoes)", stops: shares }],
    ["acoustics.sound_speed_m_s", { label: "Sound speed", stops: [1430, 1440, 1450, 1460, 1470, 1480, 1490, 1500, 1510, 1520, 1530, 1540, 1550] }],
  ]],
  ["Diver", [
    ["target.speed_m_s", { label: "Speed", stops: [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1, 1.5, 2] }],
    ["target.depth_start_m", { label: "Depth at the start", stops: [0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40] }],
    ["target.depth_end_m", { label: "Depth at the end", stops: [0.5, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40] }],
  ]],
];

/** The groups of controls, in the element "controls"; all their fields. */
export function makeControls(page) {
  const fields = [];
  for (const [name, rows] of GROUPS) {
    const own = rows.filter(([path]) => page.changes.keys.has(path))
      .map(([path, options]) => new Field(page, path, options));
    fields.push(...own);
    $("controls").append(element("fieldset", {},
      element("legend", {}, name), ...own.map((field) => field.element)));
  }
  return fields;
}

// Whether a key has an effect: at least one condition of each group must hold.
export function hasEffect({ explorer, changes }, key) {
  return (key.needs ?? []).every((group) => group.some(([other, wanted]) => {
    const path = `${key.table}.${other}`, numbers = [explorer.value(path)].flat().map(
      (it) => typeof it === "number" ? it : changes.keys.get(path)?.numbers?.[it]);
    return wanted.length ? wanted.includes(numbers[0]) : numbers.some((it) => it !== 0);
  }));
}
