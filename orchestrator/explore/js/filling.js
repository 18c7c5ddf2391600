// Fills in keys that are not given, as `orchestrator/scenario/filling.py` does.

import { settled } from "./numbers.js";

const TABLES = ["target", "platform", "acoustics"];

/**
 * All keys of a scenario with their values, by path; arrays are flat.
 *
 * data: the contents of the page; given: Map of paths and values; seed: of the run.
 */
export function filled(data, given, seed) {
  const own = (table, key) => given.get(`${table}.${key}`);
  const values = new Map(), beacons = beaconsOf(data, given);
  const put = (table, found) => {
    for (const [key, value] of Object.entries(found)) values.set(`${table}.${key}`, value);
  };
  for (const key of data.keys)
    if (key.table === "time" || key.table === "place") values.set(key.path, key.default);
  const defaults = data.systems[beacons]?.defaults ?? {};
  for (const table of TABLES) {
    put(table, defaults[table] ?? {});
    for (const key of data.keys) {
      const chosen = key.table === table && key.sets && given.get(key.path);
      if (chosen !== undefined && chosen !== false) put(table, key.sets[chosen]);
    }
  }
  const points = own("target", "waypoint_m"), times = own("target", "track_time_s");
  if (points?.length) values.set("target.waypoint_count", Math.floor(points.length / 3));
  if (times?.length) values.set("target.track_count", times.length);
  values.set("platform.beacons", beacons);
  if (own("platform", "beacon_m")) values.set("platform.arrangement", "given");
  const passed = own("platform", "track_time_s");
  if (passed?.length) values.set("platform.track_count", passed.length);
  const isOnTrack = (own("platform", "track_count") ?? values.get("platform.track_count")) > 0;
  if (!isOnTrack && own("platform", "boat_speed_m_s") && own("platform", "boat_course_deg"))
    values.set("platform.mean_heading_deg", own("platform", "boat_course_deg"));
  put("acoustics", resolutions(data, given, beacons));
  put("acoustics", waterOf(data, given));
  for (const [path, value] of given)
    if (path.startsWith("time.")) values.set(path, value);
  const slot = slotOf(data, (key) => own("acoustics", key) ?? waterOf(data, given)[key]);
  if (slot && own("time", "sampling_time_s") === undefined)
    values.set("time.sampling_time_s", settled(Math.max(slot.needed, 1e-3)));
  const time = values.get("time.sampling_time_s");
  const common = {
    sampling_time_s: time, seed, interval_s: own("acoustics", "sampling_time_s") ?? time,
  };
  for (const table of TABLES) put(table, common);
  for (const [path, value] of given) values.set(path, value);
  if (!given.has("receiver.type")) values.set("receiver.type", data.rules.receiver);
  return values;
}

// The number of beacons, from the given keys.
export function beaconsOf(data, given) {
  const points = given.get("platform.beacon_m");
  return given.get("platform.beacons")
    ?? (points ? Math.floor(points.length / 3) : data.rules.beacons);
}

// Time between updates of the receiver [s].
export function updateInterval(of, has) {
  if (has("receiver.update_interval_s")) return of("receiver.update_interval_s");
  return Math.floor(of("time.sampling_time_s") * 1e9 + 0.5) * of("time.ekf_ratio") / 1e9;
}

// --- Water and slots -----------------------------------------------------------------------------

const WATER = ["temperature_C", "salinity", "sample_depth_m", "profile_depth_m",
  "profile_temperature_C", "profile_salinity"];

// Whether the speed of sound follows from temperatures that the page's scenario does not have:
// TEOS-10 is not part of a page.
export function isUnknownWater(data, given) {
  const measured = given.has("acoustics.temperature_C") || given.has("acoustics.profile_temperature_C");
  return measured && WATER.some((key) =>
    String(given.get(`acoustics.${key}`)) !== String(data.rules.water.given[`acoustics.${key}`]));
}

// Speeds at the depths of the profile [m/s], or null.
export function profileSpeeds(data, given) {
  const own = (key) => given.get(`acoustics.${key}`);
  if (own("profile_speed_m_s")?.length) return own("profile_speed_m_s");
  const measured = own("profile_temperature_C") && !isUnknownWater(data, given);
  return measured ? data.rules.water.profile : null;
}

function waterOf(data, given) {
  const own = (key) => given.get(`acoustics.${key}`);
  const depths = own("profile_depth_m"), speeds = profileSpeeds(data, given);
  if (depths?.length && speeds?.length === depths.length)
    return {
      profile_count: depths.length, profile_depth_m: depths, profile_speed_m_s: speeds,
      sound_speed_m_s: meanSpeed(depths, speeds),
    };
  if (own("temperature_C") === undefined || isUnknownWater(data, given)) return {};
  return { sound_speed_m_s: data.rules.water.speed };
}

// Harmonic mean of a speed over depths, 1/c linear between them [m/s].
function meanSpeed(depths, speeds) {
  const last = depths.length - 1, whole = depths[last] - depths[0];
  if (whole <= 0) return speeds[0];
  let time = 0;
  for (let i = 0; i < last; i++)
    time += (depths[i + 1] - depths[i]) * (1 / speeds[i] + 1 / speeds[i + 1]) / 2;
  return whole / time;
}

// The parts of the slot that packets need [s], as in `orchestrator/scenario/timing.py`, or null.
export function slotOf(data, acoustics) {
  const duration = acoustics("packet_duration_s");
  if (duration === undefined || duration === null) return null;
  const reach = acoustics("reach_m") || 0, depth = acoustics("water_depth_m") || 0;
  const speed = Math.min(acoustics("sound_speed_m_s") || 1500, ...(acoustics("profile_speed_m_s") ?? []));
  const both = data.rules.legs[acoustics("ranging") ?? "one_way"], travel = reach / speed;
  const slot = {
    packet: both * duration, travel: both * travel,
    echo: Math.hypot(reach, 2 * depth) / speed - travel,
    guard: acoustics("guard_interval_s") || 0,
    turnaround: both > 1 ? acoustics("turnaround_s") || 0 : 0,
  };
  const total = slot.packet + slot.travel + slot.echo + slot.guard + slot.turnaround;
  return { ...slot, needed: Math.ceil(total * 1000 - 1e-6) / 1000 };
}

// --- Packets -------------------------------------------------------------------------------------

const CONTENT = "everything", HORIZONTAL = 81.92, VERTICAL = 1.28, TURN = 360, TILT = 32;
const FIXED = 6 + 3 + 8, NUMBER = 64, FINER = 3, COARSER = 7;
const RESOLUTIONS = ["packet_resolution_m", "packet_angle_resolution_deg"];

function bitsOf(span, resolution) {
  return resolution > 0 ? Math.max(Math.ceil(Math.log2(span / resolution) - 1e-9), 0) : NUMBER;
}

function packetBits(content, [place, angle], beacons) {
  const n = content.places[beacons], angles = content.pose ? 1 : 0;
  return FIXED + Math.ceil(Math.log2(beacons)) + 2 * n * bitsOf(HORIZONTAL, place)
    + n * bitsOf(VERTICAL, place) + angles * (bitsOf(TURN, angle) + 2 * bitsOf(TILT, angle));
}

function* steps(content, [first, second]) {
  for (let step = -2 * FINER; step <= 2 * COARSER; step++)
    yield [first ?? 0.01 * 2 ** -Math.floor(-step / 2),
      second ?? (content.pose ? 0.125 * 2 ** Math.floor(step / 2) : 0)];
}

// Content of packets, and the given resolutions that have an effect.
export function packetOf(data, given) {
  const name = given.get("acoustics.packet_content") ?? CONTENT, content = data.rules.contents[name];
  const [first, second] = RESOLUTIONS.map((key) => given.get(`acoustics.${key}`));
  return { name, content, fixed: [first, content.pose ? second : undefined] };
}

// The finest resolutions that fit into the bits; undefined: none.
export function finest(content, bits, beacons, fixed) {
  for (const it of steps(content, fixed)) if (packetBits(content, it, beacons) <= bits) return it;
  return undefined;
}

// Fewest bits for which there is a resolution.
export const leastBits = (content, beacons, fixed) =>
  packetBits(content, [...steps(content, fixed)].at(-1), beacons);

function resolutions(data, given, beacons) {
  const bits = given.get("acoustics.packet_bits");
  if (!bits || !data.systems[beacons]) return {};
  const { content, fixed } = packetOf(data, given), found = finest(content, bits, beacons, fixed);
  return found ? { [RESOLUTIONS[0]]: found[0], [RESOLUTIONS[1]]: found[1] } : {};
}

