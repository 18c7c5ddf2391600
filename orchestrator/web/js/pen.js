// A picture as SVG, drawn with the calls of a canvas that the drawings make.
//
// Drawings take a pen: a CanvasRenderingContext2D or an SvgPen. Both give the same picture.

const measuring = document.createElement("canvas").getContext("2d");
const escaped = (text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
const short = (x) => String(Math.round(x * 100) / 100);

export class SvgPen {
  // Size in pixels.
  constructor(width, height) {
    Object.assign(this, {
      width, height, fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1,
      font: "12px sans-serif", textAlign: "left", textBaseline: "alphabetic", lineCap: "butt",
      lineJoin: "miter",
    });
    this.parts = [];
    this.path = [];
    this.dash = [];
    this.clips = 0;
    this.stack = [];
  }

  beginPath() { this.path = []; }
  moveTo(x, y) { this.path.push(`M${short(x)} ${short(y)}`); }
  lineTo(x, y) { this.path.push(`L${short(x)} ${short(y)}`); }
  closePath() { this.path.push("Z"); }
  rect(x, y, w, h) {
    this.path.push(`M${short(x)} ${short(y)}h${short(w)}v${short(h)}h${short(-w)}Z`);
  }

  // Only whole circles.
  arc(x, y, r) {
    const d = short(2 * r);
    this.path.push(`M${short(x - r)} ${short(y)}a${short(r)} ${short(r)} 0 1 0 ${d} 0`
      + `a${short(r)} ${short(r)} 0 1 0 -${d} 0`);
  }

  setLineDash(dash) { this.dash = dash; }

  stroke() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.map(short).join(" ")}"` : "";
    this.add(`<path d="${this.path.join("")}" fill="none" stroke="${this.strokeStyle}" `
      + `stroke-width="${short(this.lineWidth)}" stroke-linecap="${this.lineCap}" `
      + `stroke-linejoin="${this.lineJoin}"${dash}${this.alpha("stroke")}/>`);
  }

  fill() {
    this.add(`<path d="${this.path.join("")}" fill="${this.fillStyle}"${this.alpha("fill")}/>`);
  }

  fillRect(x, y, w, h) {
    this.beginPath();
    this.rect(x, y, w, h);
    this.fill();
  }

  fillText(text, x, y) { this.text(text, x, y, `fill="${this.fillStyle}"`); }

  strokeText(text, x, y) {
    this.text(text, x, y, `fill="none" stroke="${this.strokeStyle}" `
      + `stroke-width="${short(this.lineWidth)}" stroke-linejoin="round"`);
  }

  measureText(text) {
    measuring.font = this.font;
    return measuring.measureText(text);
  }

  save() { this.stack.push([{ ...this }, this.clips]); }

  restore() {
    const [state, clips] = this.stack.pop();
    for (; this.clips > clips; this.clips--) this.parts.push("</g>");
    const { parts, stack, ...rest } = state;
    Object.assign(this, rest);
  }

  // To the path so far, until the state is restored.
  clip() {
    const id = `clip${this.parts.length}`;
    this.parts.push(`<clipPath id="${id}"><path d="${this.path.join("")}"/></clipPath>`
      + `<g clip-path="url(#${id})">`);
    this.clips++;
  }

  text(text, x, y, how) {
    const anchor = { left: "start", center: "middle", right: "end" }[this.textAlign];
    const [, size, family] = /([\d.]+)px (.*)/.exec(this.font);
    const bold = this.font.startsWith("600") ? ' font-weight="600"' : "";
    const down = { alphabetic: 0, middle: 0.35, top: 0.8, bottom: -0.2 }[this.textBaseline] * size;
    this.add(`<text x="${short(x)}" y="${short(y + down)}" font-size="${size}"${bold} `
      + `font-family="${escaped(family)}" text-anchor="${anchor}" ${how}`
      + `${this.alpha("fill")}>${escaped(text)}</text>`);
  }

  alpha(of) { return this.globalAlpha < 1 ? ` ${of}-opacity="${short(this.globalAlpha)}"` : ""; }
  add(part) { this.parts.push(part); }

  toString() {
    return `<svg xmlns="http://www.w3.org/2000/svg" width="${this.width}" height="${this.height}" `
      + `viewBox="0 0 ${this.width} ${this.height}">\n${this.parts.join("\n")}\n</svg>\n`;
  }
}

// Text with a rim of paper, which keeps it readable on lines.
export function write(pen, text, x, y, colour, paper) {
  pen.save();
  pen.lineJoin = "round";
  pen.lineWidth = 3;
  pen.strokeStyle = paper;
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
  pen.restore();
}

// A line through screen points [x, y]; points nearer than `least` pixels to the last are left out.
// `null` is a gap.
export function line(pen, points, least = 0.7) {
  pen.beginPath();
  let last = null, skipped = null;
  for (const point of points) {
    if (!point || Number.isNaN(point[0] + point[1])) {
      if (skipped) pen.lineTo(...skipped);
      last = skipped = null;
    } else if (!last) {
      pen.moveTo(...point);
      last = point;
    } else if (Math.abs(point[0] - last[0]) + Math.abs(point[1] - last[1]) >= least) {
      pen.lineTo(...point);
      last = point;
      skipped = null;
    } else {
      skipped = point;
    }
  }
  if (skipped) pen.lineTo(...skipped);
  pen.stroke();
}

// A round number near x: 1, 2 or 5 times a power of ten, not smaller.
export function roundStep(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return [1, 2, 5, 10].find((m) => m * power >= x * 0.999) * power;
}

// Whole multiples of a step within limits.
export function ticks(low, high, step) {
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

// A number for people: `digits` decimals, and a true minus.
export function decimal(x, digits) {
  const text = Math.abs(x).toFixed(digits);
  return x < 0 && Number(text) !== 0 ? `−${text}` : text;
}
