// The numbers of a page: reads them, and says what holds at a time.
//
// A Run is all that the drawings take. Lengths are in m, times in s, axes north, east, down.
//   start, stop   first and last instant
//   axes          names of the two horizontal axes
//   arms          whether the beacons are on arms of one platform
//   time          instants of the motion, a Float64Array
//   diver         true Track of the diver, or null
//   beacons       true Track of each beacon; reported: as they report themselves; empty if unknown
//   receivers     label, fix (drawn as dots), colour (number of its CSS variable), dash (in widths
//                 of the line), epoch, since, until, position (Track), truth (Track or null) and
//                 factor: six arrays, the rows of the lower triangle L of the covariance L Lᵀ, or null
// A Track has three arrays x, y, z. Unknown numbers are NaN.

export const KINDS = {
  total: "Total error", horizontal: "Horizontal error", x: "Error in x", y: "Error in y",
  z: "Error in z",
};
const NORMAL_95 = 1.959964, MISSING = -(2 ** 31);

// Columns by name, from their text and the number of rows of each.
async function unpack(text, sizes) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const all = bytes.length / 4, columns = {};
  let at = 0;
  for (const [name, rows] of sizes) {
    const values = new Float64Array(rows);
    for (let i = 0, last = 0; i < rows; i++, at++) {
      const zigzag = bytes[at] | bytes[all + at] << 8 | bytes[2 * all + at] << 16
        | bytes[3 * all + at] << 24;
      last = (last + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
      values[i] = last === MISSING ? NaN : last / 1000;
    }
    columns[name] = values;
  }
  return columns;
}

// The Run of the content of a page.
export async function readRun(content) {
  const columns = await unpack(content.data, content.columns);
  const track = (name) => columns[`${name}.x`]
    ? { x: columns[`${name}.x`], y: columns[`${name}.y`], z: columns[`${name}.z`] } : null;
  const tracks = (name) => Array.from({ length: content.beacons }, (_, i) => track(`${name}.${i}`))
    .filter(Boolean);
  const later = (times) => times.map((t) => t + content.start);
  return {
    start: content.start, stop: content.stop, axes: content.axes, arms: content.arms,
    time: later(columns.time), diver: track("diver"), beacons: tracks("beacon"),
    reported: tracks("reported"),
    receivers: content.receivers.map((it, i) => ({
      ...it,
      epoch: later(columns[`${i}.epoch`]), since: later(columns[`${i}.since`]),
      until: later(columns[`${i}.until`]), position: track(`${i}`), truth: track(`${i}.true`),
      factor: columns[`${i}.L0`] ? [0, 1, 2, 3, 4, 5].map((k) => columns[`${i}.L${k}`]) : null,
    })),
  };
}

// Index of the last time at or before t; −1 if there is none.
export function indexAt(times, t) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// Point [x, y, z] of a track at t: of the last instant, or on a straight line to the next one.
export function pointAt(track, time, t, held = false) {
  const i = Math.max(indexAt(time, t), 0), j = Math.min(i + 1, time.length - 1);
  const u = held || j === i ? 0 : Math.min(Math.max((t - time[i]) / (time[j] - time[i]), 0), 1);
  return ["x", "y", "z"].map((k) => u === 0 ? track[k][i] : track[k][i] + u * (track[k][j] - track[k][i]));
}

// Point of a track in waves at t: on a cubic through the instants (Catmull–Rom).
export function wavePointAt(track, time, t) {
  const i = Math.max(indexAt(time, t), 0), last = time.length - 1, j = Math.min(i + 1, last);
  if (i === j) return [track.x[i], track.y[i], track.z[i]];
  const h = time[j] - time[i], u = Math.max((t - time[i]) / h, 0);
  const before = Math.max(i - 1, 0), after = Math.min(j + 1, last);
  return [track.x, track.y, track.z].map((v) => {
    const a = h * (v[j] - v[before]) / (time[j] - time[before]);
    const b = h * (v[after] - v[i]) / (time[after] - time[i]);
    const rise = v[j] - v[i];
    return v[i] + u * (a + u * (3 * rise - 2 * a - b + u * (a + b - 2 * rise)));
  });
}

// Index of the estimate that stands at t; −1 if there is none.
export function standing(run, receiver, t) {
  const i = indexAt(receiver.since, t);
  return i >= 0 && (t < receiver.until[i] || t >= run.stop) ? i : -1;
}

// Error of an estimate [m]; NaN if it is unknown.
export function errorOf(receiver, i, kind) {
  const { position: p, truth: q } = receiver;
  if (!q) return NaN;
  const x = p.x[i] - q.x[i], y = p.y[i] - q.y[i], z = p.z[i] - q.z[i];
  return { total: Math.hypot(x, y, z), horizontal: Math.hypot(x, y), x, y, z }[kind];
}

// Rows of L of an estimate; null where nothing is claimed.
export function factorOf(receiver, i) {
  const L = receiver.factor && receiver.factor.map((column) => column[i]);
  return L && !L.some(Number.isNaN) ? [[L[0], 0, 0], [L[1], L[2], 0], [L[3], L[4], L[5]]] : null;
}

// What 95 % of the errors are within, if the covariance is right [m]; NaN without one.
//
// A length is the root of a sum of squares of normal errors. Satterthwaite's approximation gives the
// sum the mean and variance of a scaled chi-square, and Wilson and Hilferty's its percentile: within
// 3 % of the exact radius.
export function claimOf(receiver, i, kind) {
  const L = factorOf(receiver, i);
  if (!L) return NaN;
  const axis = ["x", "y", "z"].indexOf(kind);
  if (axis >= 0) return NORMAL_95 * Math.hypot(...L[axis]);
  const rows = kind === "horizontal" ? L.slice(0, 2) : L;
  let trace = 0, squares = 0; // of the covariance: its trace, and that of its square
  rows.forEach((a, j) => rows.forEach((b, k) => {
    const element = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    squares += element * element;
    if (j === k) trace += element;
  }));
  if (trace === 0) return 0;
  const degrees = trace * trace / squares, spread = 2 / (9 * degrees);
  return Math.sqrt(trace) * (1 - spread + 1.644854 * Math.sqrt(spread)) ** 1.5;
}
