// A canvas with sharp pixels, which draws once it has a size, and again when that changes.
//
//   surface(canvas, changed)     changed(width, height); returns { pen, fit }

export function surface(canvas, changed) {
  const pen = canvas.getContext("2d");
  const fit = () => {
    const { clientWidth: width, clientHeight: height } = canvas, dense = devicePixelRatio || 1;
    if (!width || !height) return;
    Object.assign(canvas, { width: Math.round(width * dense), height: Math.round(height * dense) });
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    changed(width, height);
  };
  new ResizeObserver(fit).observe(canvas);
  return { pen, fit };
}
