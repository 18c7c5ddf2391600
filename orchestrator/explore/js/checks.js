// Contradictions between keys, in the words of a scenario file: the rules of
// `orchestrator/scenario/` (scenario, arrangement, packets, channel, tracks and wiring).

import { isOnTrack } from "./boat.js";
import {
  finest, isUnknownWater, leastBits, packetOf, profileSpeeds, slotOf, updateInterval,
} from "./filling.js";
import { brief, divides, isWhole, textOf, written } from "./numbers.js";

const TABLES = ["target", "platform", "acoustics", "receiver"];
const PERIODS = ["sampling_time_s", "update_interval_s", "interval_s"];
const SAME = 1e-6, LOSSLESS = 1e-9;

/**
 * Problems of a state: [{ path, message }].
 *
 * values: of all keys by path; given: the given ones; receivers: types, without the raw fix.
 */
export function problemsOf(data, values, given, receivers, beacons) {
  const state = {
    data, given, receivers, beacons,
    of: (path) => values.get(path), has: (path) => given.has(path),
  };
  const all = (...rules) => rules.flatMap((rule) =>
    [...rule(state)].map(([path, message]) => ({ path, message })));
  const found = all(times, prior, arrangement, packets, bursts, profile, bottom, slots, path, place);
  if (found.length) return found;
  const others = all(idle); // known only once a scenario is prepared
  return others.length ? others : all(water);
}

// A message about a key, in the form of a scenario file.
function about(path, text) {
  const [table, key] = path.split(".");
  return [path, `[${table}] ${key}: ${text}`];
}

const repr = (value) => Array.isArray(value) ? `[${value.map(repr).join(", ")}]`
  : typeof value === "number" ? written(value) : `'${value}'`;

function* water({ data, given }) {
  if (!isUnknownWater(data, given)) return;
  const key = given.has("acoustics.temperature_C") ? "temperature_C" : "profile_temperature_C";
  yield about(`acoustics.${key}`, "must be that of the scenario in a page, which has no equation " +
    "for the speed of sound; sound_speed_m_s sets it");
}

function* times({ of, has }) {
  for (const table of ["time", ...TABLES])
    for (const key of PERIODS) {
      const path = `${table}.${key}`;
      if (has(path) && !isWhole(of(path)))
        yield about(path, `must be a whole number of nanoseconds, got ${written(of(path))}`);
    }
  const sampling = of("acoustics.sampling_time_s"), update = updateInterval(of, has);
  for (const table of TABLES) {
    const path = `${table}.interval_s`, whole = table === "receiver" ? update : sampling;
    if (!has(path) || divides(of(path), whole)) continue;
    const tick = table === "receiver" ? "update_interval_s" : "sampling_time_s";
    const where = ["receiver", "acoustics"].includes(table) ? "" : " of [acoustics]";
    yield about(path, `must divide ${tick}${where} (${written(whole)}), got ${written(of(path))}`);
  }
  if (!divides(sampling, update))
    yield about("receiver.update_interval_s", "must be a whole multiple of the sampling time " +
      `(${written(sampling)}), got ${written(update)}`);
}

function* prior({ of, has }) {
  if (of("receiver.prior") !== "true") return;
  for (const key of ["prior_position_m", "prior_velocity_m_s"])
    if (has(`receiver.${key}`))
      yield about(`receiver.${key}`, "must be left out when prior is 'true'");
  const first = of("receiver.initialisation");
  if (first !== undefined && first !== "prior")
    yield about("receiver.initialisation", "must be 'prior' or be left out when prior is 'true', " +
      `got '${first}'`);
}

function* arrangement({ of, has, beacons }) {
  const points = of("platform.beacon_m");
  if (has("platform.beacon_m") && points.length !== 3 * beacons)
    yield about("platform.beacons", "must be the number of rows of beacon_m " +
      `(${Math.floor(points.length / 3)}), got ${beacons}`);
  if (of("platform.motion") === "spectrum" && !has("platform.wave_height_m") && !has("platform.beaufort"))
    yield about("platform.motion", "must come with wave_height_m or beaufort when it is 'spectrum', " +
      "got neither");
  if (of("platform.arrangement") === "given") yield* samePoints(points);
  for (const path of ["platform.mounting_error_m", "acoustics.slot_order", "receiver.beacon_offset_m"]) {
    const value = of(path), isOrder = path === "acoustics.slot_order", width = isOrder ? 1 : 3;
    if (value !== undefined && has(path) && value.length !== width * beacons)
      yield about(path, `must have ${beacons} ${isOrder ? "numbers" : "rows of 3 numbers"}, one per ` +
        `beacon, got ${Math.floor(value.length / width)}`);
    else if (isOrder && [...value].sort((a, b) => a - b).some((it, i) => it !== i + 1))
      yield about(path, `must have each number from 1 to ${beacons} once, got [${value.join(", ")}]`);
  }
}

function* samePoints(flat) {
  const rows = [];
  for (let i = 0; i < flat.length; i += 3) rows.push(flat.slice(i, i + 3));
  for (const [j, there] of rows.entries())
    for (const [i, here] of rows.slice(0, j).entries())
      if (Math.sqrt(here.reduce((sum, it, k) => sum + (it - there[k]) ** 2, 0)) < SAME)
        yield about("platform.beacon_m", "must have each beacon at a different position, got " +
          `beacons ${i + 1} and ${j + 1} at ${repr(here)}`);
}

function* packets({ data, of, has, given, beacons }) {
  const bits = of("acoustics.packet_bits"), { name, content, fixed } = packetOf(data, given);
  if (bits) {
    const needed = leastBits(content, beacons, fixed);
    if (needed > bits) {
      const said = [`packet_content is '${name}'`];
      ["packet_resolution_m", "packet_angle_resolution_deg"].forEach((key, i) => {
        if (fixed[i] !== undefined) said.push(`${key} is ${written(fixed[i])}`);
      });
      const fit = finest(content, bits, beacons, []);
      const advice = !fit ? "" : `; ${brief(fit[0])} m${content.pose ? ` and ${brief(fit[1])}°` : ""} would fit`;
      yield about("acoustics.packet_bits",
        `must be at least ${needed}, as ${said.join(" and ")}, got ${bits}${advice}`);
    }
  }
  if (content.placed && !of("platform.gps_shared"))
    yield about("acoustics.packet_content", "must include positions of beacons, as gps_shared of " +
      `[platform] is false, got '${name}'`);
  if (content.only_own && has("receiver.pose_source") && of("receiver.pose_source") !== "own_beacon")
    yield about("receiver.pose_source", "must be 'own_beacon', as packet_content of [acoustics] is, " +
      `got '${of("receiver.pose_source")}'`);
}

function* bursts({ of }) {
  const length = of("acoustics.loss_burst_length"), loss = of("acoustics.loss_probability");
  if (!length) return;
  if (length < 1)
    yield about("acoustics.loss_burst_length", "must be at least 1 packet, or 0 for losses that are " +
      `independent of each other, got ${brief(length)}`);
  else if (loss < 1 && length * (1 - loss) < loss * (1 - LOSSLESS))
    yield about("acoustics.loss_burst_length", `must be at least ${brief(loss / (1 - loss), 4)}, as ` +
      `${brief(loss, 4)} of all packets are lost and one is received between two bursts, ` +
      `got ${brief(length)}`);
}

function* profile({ data, of, has, given }) {
  const own = (key) => of(`acoustics.${key}`), is = (key) => has(`acoustics.${key}`);
  const depths = own("profile_depth_m");
  for (const key of ["profile_speed_m_s", "profile_temperature_C", "profile_salinity"])
    if (is(key) && own(key).length !== depths.length)
      yield about(`acoustics.${key}`, "must have as many numbers as profile_depth_m, " +
        `${depths.length}, got ${own(key).length}`);
  if (is("profile_count") && own("profile_count") !== depths.length)
    yield about("acoustics.profile_count", "must be the number of points of profile_depth_m, " +
      `${depths.length}, got ${own("profile_count")}`);
  if (is("profile_speed_m_s") && is("profile_temperature_C"))
    yield about("acoustics.profile_temperature_C", "must be left out with profile_speed_m_s");
  if (!depths.length) return;
  if (depths.some((it, i) => i && it <= depths[i - 1]))
    yield about("acoustics.profile_depth_m", `must increase, got ${repr(depths)}`);
  if (!profileSpeeds(data, given) && !is("profile_temperature_C") && !is("profile_speed_m_s"))
    yield about("acoustics.profile_depth_m", "must come with profile_speed_m_s or " +
      "profile_temperature_C, got neither");
  for (const key of ["sound_speed_m_s", "temperature_C"])
    if (is(key))
      yield about(`acoustics.${key}`, `must be left out with a profile, got ${brief(own(key))}`);
}

function* bottom({ of, beacons }) {
  const depth = of("acoustics.water_depth_m");
  if (!depth) return;
  const points = of("platform.arrangement") === "given" ? of("platform.beacon_m") : null;
  const down = Array.from({ length: beacons }, (_, i) =>
    points ? points[3 * i + 2] : of("platform.beacon_depth_m"));
  const shift = of("platform.mean_position_m")[2];
  const low = down.flatMap((z, i) => z + shift > depth ? [i + 1] : []);
  if (low.length) {
    const last = low.pop(), which = low.length ? `${low.join(", ")} and ${last}` : last;
    yield about("acoustics.water_depth_m", "must be at least the depth of the beacons, " +
      `${brief(Math.max(...down) + shift)} m (beacon ${which}), got ${brief(depth)}`);
  }
  const along = (flat) => flat.filter((_, i) => i % 3 === 2);
  const trajectory = of("target.trajectory");
  const depths = trajectory === "waypoints"
    ? along(of("target.waypoint_m").slice(0, 3 * of("target.waypoint_count")))
    : trajectory === "file" ? along(of("target.track_m"))
      : [of("target.depth_start_m"), of("target.depth_end_m")];
  const deepest = depths.length ? Math.max(...depths) : 0;
  if (deepest > depth)
    yield about("acoustics.water_depth_m", `must be at least the depth of the diver, ` +
      `${brief(deepest)} m, got ${brief(depth)}`);
}

function* slots({ data, of }) {
  const own = (key) => of(`acoustics.${key}`), slot = slotOf(data, own);
  const time = own("sampling_time_s"), twoWay = data.rules.legs[own("ranging")] > 1;
  const between = `the time between pings, ${brief(time)} s`;
  if (twoWay && own("turnaround_s") >= time)
    yield about("acoustics.turnaround_s", `must be less than ${between}, ` +
      `got ${brief(own("turnaround_s"))} s`);
  else if (slot && twoWay && time < slot.packet + slot.turnaround)
    yield about("acoustics.packet_duration_s", "request, turn-around and answer must be within " +
      `${between}, got ${brief(slot.packet + slot.turnaround)} s`);
  else if (slot && time < slot.packet)
    yield about("acoustics.packet_duration_s", `must be at most ${between}, got ${brief(slot.packet)} s`);
}

function* path({ data, of, has }) {
  const trajectory = of("target.trajectory"), points = of("target.waypoint_m").length / 3;
  const count = of("target.waypoint_count");
  if (trajectory === "waypoints" && !(count >= 2 && count <= points)) {
    const asMany = has("target.waypoint_count") ? `, and as many as waypoint_count (${count})` : "";
    yield about("target.waypoint_m", `must have at least 2 rows${asMany}, got ${Math.floor(points)}`);
  }
  yield* trackPoints(data, of, "target", trajectory === "file", "trajectory is 'file'", 3);
  yield* trackPoints(data, of, "platform", isOnTrack(of) || of("platform.track_time_s")?.length,
    "there is a track", 2);
}

// The points of a recorded track, of the diver or of the boat.
function* trackPoints({ rules }, of, table, follows, when, width) {
  if (!follows) return;
  const own = (key) => of(`${table}.${key}`), most = rules.track_points[table];
  const times = own("track_time_s"), rows = Math.floor(own("track_m").length / width);
  const kept = own("track_count"), headings = own("track_heading_deg")?.length ?? 0;
  const late = times.findIndex((it, i) => i && !(it > times[i - 1]));
  if (times.length < 2)
    yield about(`${table}.track_file`, "must be the file of a track (or track_time_s and track_m its " +
      `points) when ${when}, got ${times.length ? "one point" : "none"}`);
  else if (rows !== times.length)
    yield about(`${table}.track_m`, `must have a row for each of ${times.length} times, got ${rows}`);
  else if (headings && headings !== rows)
    yield about(`${table}.track_heading_deg`, `must have one for each of ${rows} times, got ${headings}`);
  else if (!(kept >= 2 && kept <= rows))
    yield about(`${table}.track_count`, `must be from 2 to ${rows}, got ${kept}`);
  else if (late > 0)
    yield [`${table}.track_time_s`, `[${table}] track_time_s[${late + 1}]: must be later than the ` +
      `previous point (${written(times[late - 1])}), got ${written(times[late])}`];
  else if (!most)
    yield about(`${table}.track_time_s`, "must be left out in this page, as its scenario has no boat on a track");
  else if (times.length > most)
    yield about(`${table}.track_time_s`, `must have at most ${most} points in this page, got ${times.length}`);
}

function* place({ of }) {
  const missing = ["latitude_deg", "longitude_deg"].filter((key) => (of(`place.${key}`) ?? null) === null);
  if (missing.length === 1)
    yield about(`place.${missing[0]}`, "must be given with the other of the two, got none");
}

// Keys that no receiver of the run has.
function* idle({ data, of, given, receivers }) {
  const keys = data.rules.receiver_keys, fix = "multilateration";
  const names = [...new Set([of("receiver.type"), ...receivers, fix])].sort();
  const known = new Set(names.flatMap((name) => keys[name]));
  for (const { table, key, path, parameter } of data.keys)
    if (table === "receiver" && parameter && given.has(path) && !known.has(key)) {
      const have = Object.keys(keys).filter((name) => keys[name].includes(key));
      yield about(path, `must be a key of a receiver of this run (${names.join(", ")}), got one of ` +
        have.join(", "));
      return;
    }
}

/**
 * Problems of the intervals of components: [{ path, message }], at most one.
 *
 * parts: { label, type, inputs, tick, … } of the components; interval, ticks: of each label [ns].
 */
export function problemsOfTimes(parts, interval, ticks) {
  for (const rule of [dividesTick, isFresh, followsPings])
    for (const found of rule(parts, interval, ticks)) return [{ path: "time.sampling_time_s", message: found }];
  return [];
}

function* dividesTick(parts, interval, ticks) {
  for (const { label, tick, inputs } of parts)
    if (inputs.length && ticks[label] % interval[label])
      yield `${label}: the communication interval must divide ${tick}, ${textOf(ticks[label])}, got ` +
        textOf(interval[label]);
}

function* isFresh(parts, interval, ticks) {
  for (const { label, tick, inputs } of parts)
    for (const [source, name] of inputs)
      if (ticks[label] % interval[source])
        yield `${source}: the communication interval must divide ${label}.${tick}, ` +
          `${textOf(ticks[label])}, as ${label} uses its ${name}, got ${textOf(interval[source])}`;
}

function* followsPings(parts, interval, ticks) {
  const { tick: ping } = parts.find(({ label }) => label === "acoustics");
  for (const { label, tick, inputs, judged } of parts)
    if (judged && inputs.some(([source]) => source === "acoustics") && ticks[label] % ticks.acoustics)
      yield `${label}.${tick}: must be a whole multiple of acoustics.${ping}, ` +
        `${textOf(ticks.acoustics)}, got ${textOf(ticks[label])}`;
}

