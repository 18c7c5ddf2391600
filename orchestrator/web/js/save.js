// A picture as a file, PNG or SVG, with its title and legend.
//
//   savePicture(kind, name, { width, height, title, legend, look, draw })
//
// `draw(pen)` draws into a pen of that size; `legend` has { label, colour, dash, mark },
// and the `alpha` of an area.

import { SvgPen, line } from "./pen.js";

const PIXELS = 2, LINE = 20, LONGEST = 60;

export async function savePicture(kind, name, picture) {
  const { width, height, head } = measured(picture);
  let blob;
  if (kind === "svg") {
    const pen = new SvgPen(width, height);
    compose(pen, picture, head);
    blob = new Blob([pen.toString()], { type: "image/svg+xml" });
  } else {
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: PIXELS * width, height: PIXELS * height });
    const pen = canvas.getContext("2d");
    pen.scale(PIXELS, PIXELS);
    compose(pen, picture, head);
    blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
  }
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${name}.${kind}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// Rows of the legend that fit the width, and the height of title and legend.
function measured({ width, height, legend, look }) {
  const pen = new SvgPen(1, 1), rows = [];
  pen.font = look.font(12);
  let room = 0;
  for (const entry of legend) {
    const label = entry.label.length > LONGEST ? `${entry.label.slice(0, LONGEST)}…` : entry.label;
    const size = pen.measureText(label).width + 46;
    if (!rows.length || size > room) {
      rows.push([]);
      room = width - 16;
    }
    rows.at(-1).push({ ...entry, label, size });
    room -= size;
  }
  const top = 32 + LINE * rows.length + 6;
  return { width: Math.round(width), height: Math.round(height + top), head: { rows, top } };
}

function compose(pen, { width, height, title, look, draw }, { rows, top }) {
  pen.fillStyle = look.paper;
  pen.fillRect(0, 0, width, height + top);
  pen.fillStyle = look.ink;
  pen.font = look.font(14, true);
  pen.fillText(title, 8, 21);
  pen.font = look.font(12);
  rows.forEach((row, i) => {
    let x = 8;
    const y = 40 + LINE * i;
    for (const entry of row) {
      drawMark(pen, x, y - 4, entry, look);
      pen.fillStyle = look.ink;
      pen.fillText(entry.label, x + 30, y);
      x += entry.size;
    }
  });
  pen.save();
  if (pen instanceof SvgPen) pen.parts.push(`<g transform="translate(0 ${top})">`);
  else pen.translate(0, top);
  draw(pen);
  if (pen instanceof SvgPen) pen.parts.push("</g>");
  pen.restore();
}

function drawMark(pen, x, y, { colour, dash, mark, alpha = 0.75 }, look) {
  pen.save();
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 2;
  if (mark === "dots") {
    for (const dx of [3, 11, 19]) pen.fillRect(x + dx, y - 1.5, 3, 3);
  } else if (mark === "area") {
    pen.globalAlpha = alpha;
    pen.fillRect(x, y - 5, 24, 10);
  } else {
    pen.setLineDash(dash.map((d) => d * 2));
    line(pen, [[x, y], [x + 24, y]], 0);
    pen.setLineDash([]);
  }
  if (mark === "beacon") {
    pen.beginPath();
    pen.moveTo(x + 12, y - 5);
    pen.lineTo(x + 16.5, y + 3.5);
    pen.lineTo(x + 7.5, y + 3.5);
    pen.closePath();
    pen.fillStyle = dash.length ? look.paper : colour;
    pen.fill();
    pen.stroke();
  }
  pen.restore();
}
