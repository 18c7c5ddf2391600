// Points of a path from a GPX or CSV file, as `docs/howto/track.md` describes such files.
//
//   readPath(text, name, { origin, depth, isBoat })     { points: [[north, east, depth], …] in m, words };
//        of a boat also `times` [s], from the first one, and `headings` [°], null if there are none
//
// `origin` is { latitude, longitude } in degrees or null: then it is the first point. `depth` [m]
// is that of GPX points without an elevation. Times of a diver are not used, as they keep their speed;
// depths of a boat are not. An Error says what is wrong.

const A = 6378137, FLATTENING = 1 / 298.257223563; // WGS 84
const SQUARE = FLATTENING * (2 - FLATTENING);
const LOCAL = ["north_m", "east_m", "down_m"], GLOBAL = ["latitude_deg", "longitude_deg", "depth_m"];
const TIMES = ["time_s", "time"], HEADING = "heading_deg";

export function readPath(text, name, { origin = null, depth = 5, isBoat = false } = {}) {
  const found = /\.gpx$/i.test(name) || /^\s*<(\?xml|gpx)\b/.test(text) ? readGpx(text, depth, isBoat) : readCsv(text, isBoat);
  if (found.points.length < 2)
    throw new Error(`must have at least 2 points, got ${found.points.length}`);
  const [[latitude, longitude]] = found.points;
  const place = found.local ? "" : `; ${origin ? "the place is the scenario's" : "the platform is at the first one"}`;
  return {
    points: found.local ? found.points : projected(found.points, origin ?? { latitude, longitude }),
    words: `${found.points.length} points${place}`,
    times: found.times?.map((it) => Math.round(1e9 * (it - found.times[0])) / 1e9), headings: found.headings,
  };
}

// Latitude, longitude [°] and depth on the plane that touches the ellipsoid at the origin.
function projected(points, { latitude, longitude }) {
  const radians = Math.PI / 180, s = Math.sin(latitude * radians), root = Math.sqrt(1 - SQUARE * s * s);
  const along = A * (1 - SQUARE) / root ** 3, across = A / root * Math.cos(latitude * radians);
  const turn = (angle) => ((angle + 540) % 360) - 180; // across the date line
  return points.map(([north, east, depth]) =>
    [along * radians * (north - latitude), across * radians * turn(east - longitude), depth]);
}

// Only points, with their attributes, elevations and times: that needs no parser of XML.
function readGpx(text, depth, isBoat) {
  if (!/<\/(\w+:)?gpx\s*>\s*$/.test(text)) throw new Error("must be a whole GPX file, which ends in </gpx>");
  const shown = text.replace(/<!--[^]*?-->/g, "");
  const all = (tag) => [...shown.matchAll(
    new RegExp(`<(?:\\w+:)?${tag}\\b([^>]*?)(?:/>|>([^]*?)</(?:\\w+:)?${tag}\\s*>)`, "g"))];
  const places = ["trkpt", "rtept", "wpt"].map(all).find((it) => it.length) ?? [];
  return {
    headings: null,
    times: isBoat ? places.map(([, , inner = ""], i) =>
      dated(/<(?:\w+:)?time\s*>([^<]*)</.exec(inner)?.[1], `point ${i + 1}: time`)) : undefined,
    points: places.map(([, attributes, inner = ""], i) => {
      const number = (found, what) => finite(found?.[1], `point ${i + 1}: ${what}`);
      const attribute = (name) => number(new RegExp(`\\b${name}\\s*=\\s*["']([^"']*)["']`).exec(attributes), name);
      const height = /<(?:\w+:)?ele\s*>([^<]*)</.exec(inner);
      return [attribute("lat"), attribute("lon"), height ? -number(height, "ele") : depth];
    }),
  };
}

function readCsv(text, isBoat) {
  const lines = text.split(/\r?\n/).map((line, i) => [line.trim(), i + 1])
    .filter(([line]) => line && !line.startsWith("#"));
  if (!lines.length) throw new Error("must have a line of names, got an empty file");
  const mark = [";", "\t", ","].find((it) => lines[0][0].includes(it)) ?? ",";
  const cells = (line) => line.split(mark).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
  const names = cells(lines[0][0].replace(/^\uFEFF/, ""));
  const needed = (columns) => isBoat ? columns.slice(0, 2) : columns, has = (column) => names.includes(column);
  const wanted = [LOCAL, GLOBAL].find((it) => needed(it).every(has));
  if (!wanted)
    throw new Error(`must have the columns ${needed(LOCAL).join(", ")} or ${needed(GLOBAL).join(", ")}, got ${names.join(", ")}`);
  const time = TIMES.find(has);
  if (isBoat && !time) throw new Error(`must have the column ${TIMES.join(" or ")}, got ${names.join(", ")}`);
  const decimal = (cell) => (mark === "," ? cell : cell?.replace(",", "."));
  const rows = lines.slice(1).map(([line, number]) => [cells(line), number]);
  const column = (name, read = (it, where) => finite(decimal(it), where)) =>
    rows.map(([row, number]) => read(row[names.indexOf(name)], `line ${number}: ${name}`));
  const columns = needed(wanted).map((name) => column(name));
  return {
    local: wanted === LOCAL,
    points: rows.map((_, i) => columns.map((it) => it[i])),
    times: isBoat ? column(time, time === "time" ? dated : undefined) : undefined,
    headings: isBoat && has(HEADING) ? column(HEADING) : null,
  };
}

// A date such as 2024-05-01T10:00:00Z, in s.
function dated(text, where) {
  const isZoned = /(z|[+-]\d\d:?\d\d)$/i.test(text?.trim() ?? "");
  const found = Date.parse(`${text?.trim() ?? ""}${isZoned ? "" : "Z"}`);
  if (Number.isNaN(found)) throw new Error(`${where} must be a time such as 2024-05-01T10:00:00Z, got '${text ?? ""}'`);
  return found / 1000;
}

function finite(text, where) {
  const value = text === undefined || text === null || text.trim() === "" ? NaN : Number(text);
  if (!Number.isFinite(value)) throw new Error(`${where} must be a number, got '${text ?? ""}'`);
  return value;
}
