// Points of a path from a GPX or CSV file, as `docs/howto/track.md` describes such files; times are
// not used, as the diver keeps their speed.
//
//   readPath(text, name, { origin, depth })     { points: [[north, east, depth], …] in m, words }
//
// `origin` is { latitude, longitude } in degrees or null: then it is the first point. `depth` [m]
// is that of GPX points without an elevation. An Error says what is wrong.

const A = 6378137, FLATTENING = 1 / 298.257223563; // WGS 84
const SQUARE = FLATTENING * (2 - FLATTENING);
const LOCAL = ["north_m", "east_m", "down_m"], GLOBAL = ["latitude_deg", "longitude_deg", "depth_m"];

export function readPath(text, name, { origin = null, depth = 5 } = {}) {
  const found = /\.gpx$/i.test(name) || /^\s*<(\?xml|gpx)\b/.test(text) ? readGpx(text, depth) : readCsv(text);
  if (found.points.length < 2)
    throw new Error(`must have at least 2 points, got ${found.points.length}`);
  if (found.local) return { points: found.points, words: `${found.points.length} points` };
  const [latitude, longitude] = found.points[0];
  return {
    points: projected(found.points, origin ?? { latitude, longitude }),
    words: `${found.points.length} points; ${origin ? "the place is the scenario's" : "the platform is at the first one"}`,
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

// Only points, with their attributes and elevations: that needs no parser of XML.
function readGpx(text, depth) {
  if (!/<\/(\w+:)?gpx\s*>\s*$/.test(text)) throw new Error("must be a whole GPX file, which ends in </gpx>");
  const shown = text.replace(/<!--[^]*?-->/g, "");
  const all = (tag) => [...shown.matchAll(
    new RegExp(`<(?:\\w+:)?${tag}\\b([^>]*?)(?:/>|>([^]*?)</(?:\\w+:)?${tag}\\s*>)`, "g"))];
  const places = ["trkpt", "rtept", "wpt"].map(all).find((it) => it.length) ?? [];
  return {
    points: places.map(([, attributes, inner = ""], i) => {
      const number = (found, what) => finite(found?.[1], `point ${i + 1}: ${what}`);
      const attribute = (name) => number(new RegExp(`\\b${name}\\s*=\\s*["']([^"']*)["']`).exec(attributes), name);
      const height = /<(?:\w+:)?ele\s*>([^<]*)</.exec(inner);
      return [attribute("lat"), attribute("lon"), height ? -number(height, "ele") : depth];
    }),
  };
}

function readCsv(text) {
  const lines = text.split(/\r?\n/).map((line, i) => [line.trim(), i + 1])
    .filter(([line]) => line && !line.startsWith("#"));
  if (!lines.length) throw new Error("must have a line of names, got an empty file");
  const mark = [";", "\t", ","].find((it) => lines[0][0].includes(it)) ?? ",";
  const cells = (line) => line.split(mark).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
  const names = cells(lines[0][0].replace(/^\uFEFF/, ""));
  const wanted = [LOCAL, GLOBAL].find((it) => it.every((column) => names.includes(column)));
  if (!wanted)
    throw new Error(`must have the columns ${LOCAL.join(", ")} or ${GLOBAL.join(", ")}, got ${names.join(", ")}`);
  const at = wanted.map((column) => names.indexOf(column));
  const decimal = (cell) => (mark === "," ? cell : cell?.replace(",", "."));
  return {
    local: wanted === LOCAL,
    points: lines.slice(1).map(([line, number]) => {
      const row = cells(line);
      return at.map((i, k) => finite(decimal(row[i]), `line ${number}: ${wanted[k]}`));
    }),
  };
}

function finite(text, where) {
  const value = text === undefined || text === null || text.trim() === "" ? NaN : Number(text);
  if (!Number.isFinite(value)) throw new Error(`${where} must be a number, got '${text ?? ""}'`);
  return value;
}
