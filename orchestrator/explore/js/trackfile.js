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

function readGpx(text, depth) {
  const page = new DOMParser().parseFromString(text, "application/xml");
  if (page.querySelector("parsererror")) throw new Error("must be XML, as GPX files are");
  const all = (tag) => [...page.getElementsByTagName(tag)];
  const places = [all("trkpt"), all("rtept"), all("wpt")].find((it) => it.length) ?? [];
  const number = (value, what, i) => finite(value, `point ${i + 1}: ${what}`);
  return {
    points: places.map((it, i) => {
      const height = it.getElementsByTagName("ele")[0]?.textContent;
      return [number(it.getAttribute("lat"), "lat", i), number(it.getAttribute("lon"), "lon", i),
        height === undefined ? depth : -number(height, "ele", i)];
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
