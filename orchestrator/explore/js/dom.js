// Elements of the page.

export const $ = (id) => document.getElementById(id);

// An element with attributes, properties that start with a point, and children.
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith(".")) made[name.slice(1)] = value;
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

export function shape(tag, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// The mark of a receiver in legends, as in the template `marks.html.jinja`.
export function swatch({ colour, dash, fix }) {
  const marks = fix
    ? [2, 10, 18].map((x) => shape("rect", { x, y: 2.5, width: 3, height: 3, fill: `var(--${colour})` }))
    : [shape("line", {
      x1: 0, y1: 4, x2: 24, y2: 4, stroke: `var(--${colour})`, "stroke-width": 2.4,
      "stroke-dasharray": dash.map((d) => 2.4 * d).join(" "),
    })];
  return shape("svg", {
    class: "swatch", viewBox: "0 0 24 8", width: 24, height: 8, "aria-hidden": "true",
  }, ...marks);
}

// A name that may be broken after its underscores.
export const breakable = (name) =>
  name.split(/(?<=_)/).flatMap((part, i) => i ? [element("wbr"), part] : [part]);

// Text of an element, set only if it differs: screen readers repeat what is set again.
export function put(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

// A file for the reader to keep.
export function download(name, text, type = "text/plain") {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
