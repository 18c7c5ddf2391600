// Turning, moving and magnifying a view by mouse, touch and keys.
//
//   attach(canvas, view, redraw)
//
// In space, dragging turns, and with two fingers or Shift it moves; in the plan, dragging moves what
// has been magnified. Two fingers magnify, as does the wheel with Ctrl. A page still scrolls over a
// plan that shows everything. Keys on the focused map: + − 0, and Shift with arrows.

const TURN = 0.01, STEP = 30;

export function attach(canvas, view, redraw) {
  const fingers = new Map();
  const free = () => { canvas.style.touchAction = view.isPlan && !view.isMoved ? "pan-y" : "none"; };
  const done = () => { free(); redraw(); };
  const drag = (dx, dy, moves) => {
    if (view.isPlan || moves) view.move(dx, dy); else view.turn(-TURN * dx, TURN * dy);
  };
  canvas.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    canvas.setPointerCapture?.(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", (event) => {
    const last = fingers.get(event.pointerId);
    if (!last) return;
    const now = [event.offsetX, event.offsetY];
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    fingers.set(event.pointerId, now);
    const [dx, dy] = [now[0] - last[0], now[1] - last[1]];
    if (other) {
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      view.move(dx / 2, dy / 2);
      view.magnify(apart(now) / apart(last), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    } else if (!view.isPlan || view.isMoved) {
      drag(dx, dy, event.shiftKey);
    }
    done();
  });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    view.magnify(Math.exp(-event.deltaY / 200), event.offsetX, event.offsetY);
    done();
  }, { passive: false });
  const arrows = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", (event) => {
    if (event.key === "+" || event.key === "=") view.magnify(1.25);
    else if (event.key === "-") view.magnify(0.8);
    else if (event.key === "0") view.reset();
    else if (event.shiftKey && arrows[event.key]) drag(...arrows[event.key].map((d) => d * STEP), false);
    else return;
    event.preventDefault();
    event.stopPropagation();
    done();
  });
  free();
  return done;
}
