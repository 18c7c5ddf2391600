// How much a range tells despite outliers and echoes, and what a filter should assume of a path: the
// formulas of `orchestrator/limits/` (fisher, echoes, path).

import { even, interpolated } from "./series.js";

const ROOT_2PI = Math.sqrt(2 * Math.PI);
const normal = (z) => Math.exp(-0.5 * z * z) / ROOT_2PI;

/** Logarithm of the probability that a normal error is below x. */
export function logBelow(x) {
  if (x > 3) return Math.log1p(-normal(x) * mills(x));
  if (x < -3) return -0.5 * x * x - Math.log(ROOT_2PI) + Math.log(mills(-x));
  let term = x, sum = x; // Σ x^(2k+1)/(2k+1)!!
  for (let k = 3; Math.abs(term) > 1e-18 * Math.abs(sum); k += 2) sum += term *= x * x / k;
  return Math.log(0.5 + normal(x) * sum);
}

// Probability above x over density, for x of at least 3: 1/(x + 1/(x + 2/(x + …))).
function mills(x) {
  let found = x;
  for (let k = 60; k > 0; k--) found = x + k / found;
  return 1 / found;
}

// --- Outliers ------------------------------------------------------------------------------------

const CORE = 10, STEPS = 4000, TAIL = 40, SMALLEST = 1e-3;

/** Information in a range with outliers, as a share of that with its noise alone: `fisher_factor`. */
export function fisherFactor(std, probability, mean, distribution) {
  if (probability <= 0 || mean <= SMALLEST * std) return 1;
  if (std <= 0 || mean >= 1e6 * std) return 1 - probability;
  const mu = mean / std, last = CORE + TAIL * Math.max(mu, 1);
  const growth = Math.log(last / CORE) / STEPS;
  const part = (at) => {
    let sum = 0, z = at(0), y = integrand(z, probability, mu, distribution);
    for (let i = 1; i <= STEPS; i++) {
      const next = at(i), there = integrand(next, probability, mu, distribution);
      sum += (there + y) * (next - z) / 2;
      [z, y] = [next, there];
    }
    return sum;
  };
  return Math.min(part((i) => -CORE + 2 * CORE * i / STEPS)
    + part((i) => i === STEPS ? last : CORE * Math.exp(growth * i)), 1);
}

// f′²/f in units of the noise.
function integrand(z, probability, mu, distribution) {
  const phi = normal(z);
  let g, slope;
  if (distribution === "half_normal") {
    const s = mu * Math.sqrt(Math.PI / 2), w = Math.sqrt(1 + s * s);
    g = 2 / w * Math.exp(logBelow(s * z / w)) * normal(z / w);
    slope = -z / (w * w) * g + 2 * s / (w * w) * normal(z / w) * normal(s * z / w);
  } else {
    g = Math.exp(0.5 / (mu * mu) - z / mu + logBelow(z - 1 / mu)) / mu;
    slope = (phi - g) / mu;
  }
  const f = (1 - probability) * phi + probability * g;
  return (probability * slope - (1 - probability) * z * phi) ** 2 / Math.max(f, 1e-300);
}

// --- Shadow and echoes ---------------------------------------------------------------------------

const COURSES = 32, APART = 12, STEP = 0.05, REACH = 8, FAR = 12, MOST_EPOCHS = 100;
const radians = (degrees) => degrees / 180 * Math.PI;

// Probability that the shadow takes a packet at an angle from its middle.
function chance(of, angle) {
  const half = radians(of("shadow_half_width_deg"));
  return angle < 2 * half ? of("shadow_loss_probability") * Math.cos(Math.PI / 4 * angle / half) ** 2 : 0;
}

// Probability that the body of a diver with this velocity takes a packet of a beacon.
function shade(of, diver, velocity, beacon) {
  const [n, e, z] = beacon.map((it, i) => it - diver[i]), [north, east] = velocity;
  const scale = Math.sqrt((n * n + e * e + z * z) * (north * north + east * east));
  if (!(scale > 0)) return 0;
  const to = radians(of("shadow_direction_deg"));
  const cosine = ((n * north + e * east) * Math.cos(to) + (e * north - n * east) * Math.sin(to)) / scale;
  return chance(of, Math.acos(Math.min(Math.max(cosine, -1), 1)));
}

/** Probabilities of the echoes from surface and bottom where the direct path is lost. */
export function echoChances(of) {
  if (!of("loss_probability") && !of("shadow_loss_probability")) return [0, 0];
  return [of("surface_echo_probability"), of("water_depth_m") > 0 ? of("bottom_echo_probability") : 0];
}

const lostDirectly = (of, shade) => of("loss_probability") + (1 - of("loss_probability")) * shade;

/** Share of the pings that give no range, if the diver's body takes a share of the packets. */
export function lostIn(of, legs, shade) {
  const [surface, bottom] = echoChances(of), share = lostDirectly(of, shade) * ((1 - surface) * (1 - bottom));
  return legs === 1 ? share : 1 - (1 - share) ** 2;
}

/** Share of the pings that give no range, over all courses of a diver in the beacons' depth. */
export function lost(of, legs) {
  let sum = 0;
  for (let i = 0; i < COURSES; i++) sum += lostIn(of, legs, chance(of, (i + 0.5) / COURSES * Math.PI));
  return sum / COURSES;
}

/**
 * Information in received ranges despite echoes: for each epoch and beacon, as a share.
 *
 * of: values of [acoustics]; legs: of a range; noise: of ranges [m]; positions, velocities, beacons:
 * true ones at the epochs, NED.
 */
export function sharesAlong(of, legs, noise, positions, velocities, beacons) {
  const n = positions.length, count = beacons[0].length, most = Math.min(n, MOST_EPOCHS);
  const step = most > 1 ? (n - 1) / (most - 1) : 0;
  const some = [...new Set(Array.from({ length: most }, (_, i) => even(i === most - 1 ? n - 1 : i * step)))];
  const found = new Float64Array(n * count);
  for (let b = 0; b < count; b++) {
    const known = some.map((i) => shareOf(of, legs, noise, positions[i], velocities[i], beacons[i][b]));
    const along = interpolated(some, known);
    for (let i = 0; i < n; i++) found[i * count + b] = along(i);
  }
  return found;
}

/** The same at one place, for one beacon. */
export function shareOf(of, legs, noise, diver, velocity, beacon) {
  const chances = echoChances(of);
  if (!chances.some((it) => it) || noise <= 0) return 1;
  const square = (diver[0] - beacon[0]) ** 2 + (diver[1] - beacon[1]) ** 2;
  const length = (down) => Math.sqrt(square + down * down), both = diver[2] + beacon[2];
  const direct = length(diver[2] - beacon[2]);
  const echoes = [both, 2 * of("water_depth_m") - both].map((down, i) =>
    [Math.max(length(down) - direct, 0) / noise, chances[i]]);
  const [[early, q1], [late, q2]] = echoes[1][0] < echoes[0][0] ? echoes.reverse() : echoes;
  const p = lostDirectly(of, shade(of, diver, velocity, beacon));
  let parts = [[0, 1 - p], [early, p * q1], [late, p * (1 - q1) * q2]];
  if (legs > 1) parts = ofBothLegs(parts);
  return informationIn(parts);
}

// Shifts and weights of the mean of two arrivals, by shift.
function ofBothLegs(parts) {
  const found = [];
  for (let i = 0; i < 3; i++)
    for (let j = i; j < 3; j++)
      found.push([(parts[i][0] + parts[j][0]) / 2, parts[i][1] * parts[j][1] * (1 + Number(i !== j))]);
  return found.sort((one, other) => one[0] - other[0]);
}

// Information about the location of a mixture of normal errors, each with its shift and weight.
function informationIn(parts) {
  const total = parts.reduce((sum, [, weight]) => sum + weight, 0);
  let at = 0;
  // Arrivals farther apart are as good as this far apart.
  const placed = parts.map(([shift, weight], i) => {
    at += Math.min(i ? shift - parts[i - 1][0] : shift, APART);
    return [at, weight / total];
  });
  const cells = Math.ceil(((parts.length - 1) * APART + 2 * REACH) / STEP);
  let sum = 0;
  for (let i = 0; i < cells; i++) {
    let f = 0, slope = 0;
    for (const [shift, weight] of placed) {
      const z = -REACH + i * STEP - shift;
      if (Math.abs(z) > FAR) continue;
      const part = weight * normal(z);
      f += part;
      slope -= z * part;
    }
    sum += slope * slope / Math.max(f, 1e-300);
  }
  return Math.min(sum * STEP, 1);
}

// --- The path ------------------------------------------------------------------------------------

const PASSES = 30, FIRST_PSD = 0.01;

/**
 * Density of the white acceleration of a path over the memory of its filter [m²/s³]: `path_psd`.
 *
 * time: increasing [s]; velocities: [north, east], each along the path [m/s]; density: variance of a
 * fix times the time between fixes [m² s].
 */
export function pathPsd(time, velocities, density) {
  const last = time.length - 1, longest = (time[last] - time[0]) / 2;
  if (time.length < 3 || !(density > 0)) return 0;
  const t = time.map((it) => it - time[0]);
  const steps = Float64Array.from(t.slice(1), (it, i) => it - t[i]).sort();
  const half = steps.length >> 1;
  const shortest = steps.length % 2 ? steps[half] : (steps[half - 1] + steps[half]) / 2;
  let q = FIRST_PSD;
  for (let pass = 0; pass < PASSES; pass++) {
    const memory = q > 0 ? (density / q) ** 0.25 : longest;
    const tau = Math.min(Math.max(memory, shortest), longest);
    let sum = 0, count = 0, i = 0;
    for (; t[count] <= t[last] - tau; count++) {
      const later = t[count] + tau;
      while (i < last - 1 && t[i + 1] <= later) i++;
      for (const v of velocities) {
        const there = later >= t[last] ? v[last]
          : (v[i + 1] - v[i]) / (t[i + 1] - t[i]) * (later - t[i]) + v[i];
        sum += (there - v[count]) ** 2;
      }
    }
    q = sum / count / (2 * tau);
  }
  return q;
}
