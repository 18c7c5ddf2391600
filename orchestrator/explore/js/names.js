// What errors and devices are called in this page: one name for a control, for the cause that it is
// part of, and for what is bought against that cause.
//
//   nameOf(path)                  of a key with a control; undefined for others
//   causeOf(source)               of a source of error, by its name in `sblcosim budget`
//   inside(name)                  within a sentence
//   deviceOf(source, levels)      better equipment: { device, detail }; levels: [{ word, from, to }], as
//                                 in `orchestrator/scenario/error_sources.py`, with sizes of errors
//
// A test compares the names with all controls and sources.

const NAMES = {
  "platform.gps_grade": "GPS",
  "platform.gps_horizontal_markov_std_m": "GPS, slow error",
  "platform.imu_grade": "IMU",
  "platform.imu_heading_bias_deg": "Compass error",
  "acoustics.clock_grade": "Diver's clock",
  "acoustics.clock_offset_s": "Diver's clock, start error",
  "acoustics.range_std_m": "Range noise",
  "platform.arm_length_m": "Platform's arms",
  "time.sampling_time_s": "Time between pings",
  "time.ekf_ratio": "Pings per update",
  "platform.beaufort": "Sea",
  "acoustics.loss_probability": "Pings lost",
  "acoustics.outlier_probability": "Late ranges",
  "acoustics.sound_speed_m_s": "Sound speed",
  "target.speed_m_s": "Diver's speed",
  "target.depth_start_m": "Depth at the start",
  "target.depth_end_m": "Depth at the end",
};

// Sources of error: the control whose name they have, or a name of their own.
const CAUSES = {
  GPS: "platform.gps_grade", heading: "platform.imu_heading_bias_deg", clock: "acoustics.clock_grade",
  "range noise": "acoustics.range_std_m", "packet loss": "acoustics.loss_probability",
  outliers: "acoustics.outlier_probability", "sound speed": "acoustics.sound_speed_m_s",
  "platform motion": "platform.beaufort",
  tilt: "IMU tilt", mounting: "Beacon mounting", misalignment: "Alignment of the beacons' frame",
  timing: "Steps of arrival times", ping: "Noise shared by a ping", shadow: "Diver's shadow",
  echoes: "Echoes of surface and bottom", rounding: "Rounding in packets",
};

export const nameOf = (path) => NAMES[path];

export function causeOf(source) {
  const found = CAUSES[source] ?? source;
  return NAMES[found] ?? found[0].toUpperCase() + found.slice(1);
}

export const inside = (name) => /^[A-Z][a-z]/.test(name) ? name[0].toLowerCase() + name.slice(1) : name;

// What one can buy: { device, quantity, of }, for the words of the levels; `of` is a value of the
// quantity in words.
const rounded = (x) => Number(x.toPrecision(2)), metres = (x) => `${rounded(x)} m`;
const SOUND = 1500; // m/s
const DEVICES = {
  GPS: (words) => ({ device: words.map((it) => `${it} GPS`).join(", ") }),
  tilt: (words) => ({ device: words.map((it) => `${it} IMU`).join(", ") }),
  heading: () => ({ device: "a compass with two GPS antennas", quantity: "error", of: (x) => `${rounded(x)}°` }),
  clock: (words) => {
    const isSet = words.some(sets), grade = words.filter((it) => !sets(it)).join(", ");
    return {
      device: `${grade ? `${grade} clock` : "a clock"}${isSet ? " set before the dive" : ""}`,
      quantity: "error at the start", of: (x) => metres(SOUND * x),
    };
  },
  "range noise": () => ({ device: "a better range measurement", quantity: "noise", of: metres }),
  "sound speed": () => ({ device: "a thermometer", quantity: "error of the sound speed", of: (x) => `${rounded(100 * x)} %` }),
  "depth sensor": () => ({ device: "a better depth sensor", quantity: "error", of: metres }),
};
const sets = (word) => word.startsWith("set");

export function deviceOf(source, levels) {
  const make = DEVICES[source] ?? (() => ({ device: `less error: ${inside(causeOf(source))}` }));
  const { device, quantity, of } = make([...new Set(levels.map(({ word }) => word))]);
  const level = levels.find(({ word, to }) => to > 0 && (source !== "clock" || sets(word)));
  return { device, detail: quantity && level ? `${quantity} ${of(level.to)} instead of ${of(level.from)}` : "" };
}
