// Numbers between others: the nearest whole one, and values between the points of a series.

/** The nearest whole number; of two, the even one. */
export function even(value) {
  const below = Math.floor(value), rest = value - below;
  return rest > 0.5 || (rest === 0.5 && below % 2 !== 0) ? below + 1 : below;
}

/** Index of the last element of an increasing array at or before a value; -1 if there is none. */
export function lastAt(sorted, value) {
  let low = -1, high = sorted.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (sorted[middle] <= value) low = middle; else high = middle - 1;
  }
  return low;
}

/** A function that is linear between points (x, y), and constant beyond them. */
export function interpolated(x, y) {
  const last = x.length - 1;
  return (at) => {
    const i = lastAt(x, at);
    if (i < 0) return y[0];
    if (i >= last) return y[last];
    return (y[i + 1] - y[i]) / (x[i + 1] - x[i]) * (at - x[i]) + y[i];
  };
}
