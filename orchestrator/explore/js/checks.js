// Contradictions between keys, in the words of a scenario file.

import { isUnknownWater } from "./filling.js";

/** Problems of a state: [{ path, message }]. */
export function problemsOf(data, values, given) {
  const problems = [];
  if (isUnknownWater(data, given))
    problems.push({
      path: "acoustics.temperature_C",
      message: "[acoustics] temperature_C: must be that of the scenario in a page, which cannot " +
        "compute the speed of sound; sound_speed_m_s sets it",
    });
  return problems;
}

/** Problems of intervals. */
export function problemsOfTimes() {
  return [];
}

