// Quantiles and intervals from the incomplete beta and gamma functions.
//
// W. H. Press and others, *Numerical Recipes*, third edition, 2007, sections 6.1, 6.2 and 6.4.

const LANCZOS = [57.1562356658629235, -59.5979603554754912, 14.1360979747417471,
  -0.491913816097620199, 0.339946499848118887e-4, 0.465236289270485756e-4,
  -0.983744753048795646e-4, 0.158088703224912494e-3, -0.210264441724104883e-3,
  0.217439618115212643e-3, -0.164318106536763890e-3, 0.844182239838527433e-4,
  -0.261908384015814087e-4, 0.368991826595316234e-5];
const TINY = 1e-300, PRECISE = 1e-15, MOST = 10_000;

function logGamma(x) {
  const near = x + 671 / 128, sum = LANCZOS.reduce((s, c, i) => s + c / (x + 1 + i), 0.999999999999997092);
  return (x + 0.5) * Math.log(near) - near + Math.log(2.5066282746310005 * sum / x);
}

// Value of a continued fraction a1/(b1 + a2/(b2 + …)), by Lentz's method.
function fraction(term) {
  let found = TINY, c = TINY, d = 0;
  for (let i = 1; i < MOST; i++) {
    const [a, b] = term(i);
    d = 1 / ((b + a * d) || TINY);
    c = (b + a / c) || TINY;
    found *= c * d;
    if (i > 1 && Math.abs(c * d - 1) < PRECISE) break;
  }
  return found;
}

/** Regularised incomplete beta function I_x(a, b). */
export function beta(a, b, x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  if (x > (a + 1) / (a + b + 2)) return 1 - beta(b, a, 1 - x);
  const front = Math.exp(logGamma(a + b) - logGamma(a) - logGamma(b)
    + a * Math.log(x) + b * Math.log1p(-x)) / a;
  return front * fraction((i) => {
    if (i === 1) return [1, 1];
    const m = Math.floor((i - 1) / 2);
    return [(i - 1) % 2 === 0 ? m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
      : -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)), 1];
  });
}

/** Probability that a normal error is longer than x standard deviations, on either side. */
function beyond(x) {
  const a = 0.5, z = x * x / 2;
  if (z < 1.5) {
    let term = 1 / a, sum = term;
    for (let n = 1; n < MOST && term > sum * PRECISE; n++) sum += term *= z / (a + n);
    return 1 - sum * Math.exp(-z + a * Math.log(z) - logGamma(a));
  }
  return Math.exp(-z + a * Math.log(z) - logGamma(a)) * fraction((i) =>
    i === 1 ? [1, z + 1 - a] : [-(i - 1) * (i - 1 - a), z + 2 * i - 1 - a]);
}

// Where an increasing function of a number from low to high reaches a value.
function inverse(of, value, low, high) {
  for (let i = 0; i < 200 && high - low > 1e-15 * Math.max(1, Math.abs(low)); i++) {
    const middle = (low + high) / 2;
    if (of(middle) < value) low = middle; else high = middle;
  }
  return (low + high) / 2;
}

/** Value of chi-square with one degree of freedom that is exceeded with a probability. */
export const chiSquareBeyond = (p) => inverse((x) => -beyond(x), -p, 1e-12, 40) ** 2;

/** Quantile of Student's t, for a probability of at least one half. */
export const studentQuantile = (degrees, p) => p <= 0.5 ? 0 : Math.sqrt(degrees * (
  1 / inverse((x) => beta(degrees / 2, 0.5, x), 2 * (1 - p), 0, 1) - 1));

/** Probability of fewer than k successes of n, each with probability p. */
export const binomialBelow = (k, n, p) => k <= 0 ? 0 : k > n ? 1 : 1 - beta(k, n - k + 1, p);

/** Clopper and Pearson's interval of a share: count of n, at 95 %. */
export function shareInterval(count, n) {
  const tail = 0.025;
  return [
    count === 0 ? 0 : inverse((p) => beta(count, n - count + 1, p), tail, 0, 1),
    count === n ? 1 : inverse((p) => beta(count + 1, n - count, p), 1 - tail, 0, 1),
  ];
}
