// How good the estimates of a recorded dive are: errors and claims where there is a truth, residuals
// by beacon and agreement between receivers; `orchestrator/processing/quality.py`.
//
//   tablesOf(dive, run)     { receivers: { label: { n, first, judged, rms, p95, horizontal, claimed } },
//                           residuals: { label: { name: { n, offset, std } } },
//                           agreement: [{ receiver, other, n, horizontal, most }] }, lengths in m

const TO_STD = 1.4826;
const AXES = ["x", "y", "z"];

export function tablesOf(dive, run) {
  const labelled = (of) => Object.fromEntries(run.receivers.map((it) => [it.label, of(it)]));
  return {
    receivers: labelled((it) => rowOf(it, dive.plane)),
    residuals: labelled((it) => residualsOf(dive, it)),
    agreement: run.receivers.flatMap((one, i) => run.receivers.slice(i + 1).map((other) => agreementOf(one, other))),
  };
}

export function median(values) {
  const sorted = Float64Array.from(values).sort(), n = sorted.length;
  return n ? (sorted[(n - 1) >> 1] + sorted[n >> 1]) / 2 : NaN;
}
const rms = (squares) => Math.sqrt(squares.reduce((sum, it) => sum + it, 0) / squares.length);

function rowOf({ epoch, position: p, truth: q, factor }, plane) {
  const all = Array.from(epoch, (_, i) => i), known = all.filter((i) => !Number.isNaN(q.x[i] + q.y[i] + q.z[i]));
  const square = (i, axes) => axes.reduce((sum, k) => sum + (p[k][i] - q[k][i]) ** 2, 0);
  const squares = (axes) => known.map((i) => square(i, axes)), kind = plane ? AXES.slice(0, 2) : AXES;
  const lengths = squares(kind).map(Math.sqrt).sort((a, b) => a - b);
  const claims = factor && (known.length ? known : all).map(
    (i) => factor[0][i] ** 2 + factor[1][i] ** 2 + factor[2][i] ** 2);
  return {
    n: all.length, first: epoch.length ? epoch.reduce((a, b) => Math.min(a, b)) : NaN, judged: known.length,
    rms: rms(squares(kind)), p95: lengths[Math.ceil(0.95 * lengths.length) - 1] ?? NaN,
    horizontal: rms(squares(AXES.slice(0, 2))), claimed: claims ? rms(claims) : NaN,
  };
}

// A function from a time to the point on straight lines between estimates; null before and after.
function between({ epoch, position }) {
  const order = Array.from(epoch, (_, i) => i).sort((a, b) => epoch[a] - epoch[b]);
  const times = order.map((i) => epoch[i]), last = times.length - 1;
  return (t) => {
    if (last < 0 || t < times[0] || t > times[last]) return null;
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    if (t >= times[high]) low = high;
    const [i, j] = [order[low], order[Math.min(low + 1, last)]], step = times[Math.min(low + 1, last)] - times[low];
    const u = step ? (t - times[low]) / step : 0;
    return AXES.map((k) => position[k][i] + u * (position[k][j] - position[k][i]));
  };
}

function residualsOf({ names, tables }, receiver) {
  const at = between(receiver), [epoch] = tables["heard.epoch"], [beacon] = tables["heard.beacon"];
  const [range] = tables["heard.range"], place = tables["heard.place"], middle = tables["heard.middle"];
  const off = names.map(() => []), deep = [];
  const distance = (point, to, i) => Math.hypot(...point.map((x, k) => x - to[k][i]));
  epoch.forEach((t, i) => {
    const point = at(t / 1e9);
    if (point) off[beacon[i]].push(
      range[i] - distance(point, place, i) + (middle ? distance(point, middle, i) : 0));
  });
  const [times] = tables["depth.epoch"], [depth] = tables["depth.depth"];
  times.forEach((t, i) => {
    const point = at(t / 1e9);
    if (point) deep.push(depth[i] - point[2]);
  });
  const rows = [...names.map((name, i) => [name, off[i]]), ["depth", deep]];
  return Object.fromEntries(rows.filter(([, it]) => it.length).map(([name, it]) => [name, described(it)]));
}

function described(off) {
  const offset = median(off);
  return { n: off.length, offset, std: TO_STD * median(off.map((it) => Math.abs(it - offset))) };
}

function agreementOf(one, other) {
  const at = between(other), squares = [], level = [];
  one.epoch.forEach((t, i) => {
    const point = at(t);
    if (!point) return;
    const [x, y, z] = AXES.map((k, n) => (one.position[k][i] - point[n]) ** 2);
    level.push(x + y);
    squares.push(x + y + z);
  });
  return {
    receiver: one.label, other: other.label, n: level.length, horizontal: rms(level),
    most: Math.sqrt(squares.reduce((a, b) => Math.max(a, b), level.length ? 0 : NaN)),
  };
}
