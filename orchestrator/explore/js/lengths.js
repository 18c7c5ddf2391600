// Percentiles of the length of a Gaussian error: `orchestrator/limits/lengths.py`.

const NODES = [16, 8]; // over the cosine of the angle to the largest axis, and about it
const PASSES = 60, ENOUGH = 1e-6, LEAST = 1e-12;
const MOST = 7.814727903251178; // of 95 % of the squares of three normal errors
const SHARE = 0.95, FAR = 80;

/**
 * Length that holds 95 % of the errors of a mixture of covariances, each 9 numbers with the same weight;
 * NaN if one of them is not finite.
 */
export function within(covariances) {
  const variances = covariances.map(eigenvalues), largest = Math.max(...variances.flat());
  if (!covariances.every((it) => it.every(Number.isFinite))) return NaN;
  if (!(largest > 0)) return 0;
  const along = variances.flatMap((it) => DIRECTIONS.map(({ square }) =>
    Math.max(it.reduce((sum, v, k) => sum + v / largest * square[k], 0), LEAST)));
  const weights = variances.flatMap(() => DIRECTIONS.map(({ weight }) => weight / variances.length));
  let low = 0, high = 2 * MOST, x = MOST;
  for (let pass = 0; pass < PASSES; pass++) {
    let reached = 0, slope = 0;
    for (let i = 0; i < along.length; i++) {
      const y = x / along[i], wave = Math.sqrt(2 * y / Math.PI) * Math.exp(-y / 2);
      reached += below(y, wave) * weights[i];
      slope += wave / 2 / along[i] * weights[i];
    }
    if (reached < SHARE) low = x; else high = x;
    const step = x + (SHARE - reached) / Math.max(slope, 1e-300), isDone = Math.abs(step - x) <= ENOUGH * x;
    x = isDone || (step > low && step < high) ? step : (low + high) / 2;
    if (isDone) break;
  }
  return Math.sqrt(x * largest);
}

// Probability that the sum of the squares of three normal errors is below y; wave: √(2y/π) e^(−y/2).
function below(y, wave) {
  if (y > FAR) return 1;
  let term = y / 3, sum = term;
  for (let k = 5; term > 1e-17 * sum; k += 2) sum += term *= y / k;
  return wave * sum;
}

// Eigenvalues of a symmetric matrix, increasing and at least 0: Jacobi's rotations.
function eigenvalues(P) {
  const a = [0, 1, 2].map((i) => [0, 1, 2].map((j) => (P[3 * i + j] + P[3 * j + i]) / 2));
  for (let sweep = 0; sweep < 30; sweep++) {
    let off = 0;
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      off += Math.abs(a[p][q]);
      if (!a[p][q]) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
      const c = 1 / Math.sqrt(t * t + 1), s = t * c, r = 3 - p - q, [one, two] = [a[r][p], a[r][q]];
      a[p][p] -= t * a[p][q];
      a[q][q] += t * a[p][q];
      a[p][q] = a[q][p] = 0;
      a[r][p] = a[p][r] = c * one - s * two;
      a[r][q] = a[q][r] = s * one + c * two;
    }
    if (!(off > 1e-300)) break;
  }
  return [0, 1, 2].map((i) => Math.max(a[i][i], 0)).sort((one, other) => one - other);
}

// Squares of unit vectors in an octant, and their weights, whose sum is 1.
const DIRECTIONS = rule(NODES[0]).flatMap(([z, wz]) => rule(NODES[1]).map(([t, wt]) => {
  const angle = Math.PI / 2 * t, across = 1 - z * z;
  return { square: [across * Math.sin(angle) ** 2, across * Math.cos(angle) ** 2, z * z], weight: wz * wt };
}));

// Nodes and weights of Gauss and Legendre from 0 to 1.
function rule(count) {
  return Array.from({ length: count }, (_, i) => {
    let x = Math.cos(Math.PI * (count - i - 0.25) / (count + 0.5)), slope = 0;
    for (let pass = 0; pass < 9; pass++) {
      let [before, value] = [1, x];
      for (let k = 2; k <= count; k++) [before, value] = [value, ((2 * k - 1) * x * value - (k - 1) * before) / k];
      slope = count * (before - x * value) / (1 - x * x);
      x -= value / slope;
    }
    return [(x + 1) / 2, 1 / ((1 - x * x) * slope * slope)];
  });
}
