// How a map is seen: from above, or from a side, in parallel projection.
//
// The plan is the view from straight above, with north up. `azimuth` turns the view about the
// vertical, `elevation` is its angle above the horizon, both in radians.

const PLAN = Math.PI / 2;
const LEAST_ZOOM = 0.1, MOST_ZOOM = 60;

export class View {
  constructor() {
    this.width = this.height = 1;
    this.box = { low: [0, 0, 0], high: [1, 1, 1] };
    this.plan();
  }

  plan() { this.look(0, PLAN); }
  space() { this.look(0.6, 0.45); }

  look(azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.reset();
  }

  get isPlan() { return this.elevation === PLAN; }
  get isMoved() { return this.zoom !== 1 || this.pan[0] !== 0 || this.pan[1] !== 0; }

  // Show the whole box again.
  reset() {
    this.zoom = 1;
    this.pan = [0, 0];
    this.front = this.azimuth; // the size of what is seen changes little while it turns
    this.update();
  }

  // Fit a box {low, high}, corners [x, y, z], into a picture of this size, with margins
  // {left, right, top, bottom}.
  fit(box, width, height, margins) {
    Object.assign(this, { box, width, height, margins });
    this.update();
  }

  // The radians by which the view turns; it stays above the horizon, and off the plan.
  turn(right, up) {
    this.azimuth += right;
    this.elevation = Math.min(Math.max(this.elevation + up, 0.02), PLAN - 0.02);
    this.update();
  }

  move(right, down) {
    this.pan = [this.pan[0] + right, this.pan[1] + down];
    this.update();
  }

  // About a point of the picture, its middle by default.
  magnify(factor, x = this.width / 2, y = this.height / 2) {
    const zoom = Math.min(Math.max(this.zoom * factor, LEAST_ZOOM), MOST_ZOOM);
    const [across, down] = this.middle;
    const scale = zoom / this.zoom;
    this.pan = [
      (this.pan[0] + across - x) * scale + x - across, (this.pan[1] + down - y) * scale + y - down,
    ];
    this.zoom = zoom;
    this.update();
  }

  get middle() {
    const { left, right, top, bottom } = this.margins ?? { left: 0, right: 0, top: 0, bottom: 0 };
    return [(this.width + left - right) / 2, (this.height + top - bottom) / 2];
  }

  update() {
    const { low, high } = this.box;
    const { left, right, top, bottom } = this.margins ?? { left: 0, right: 0, top: 0, bottom: 0 };
    const s = Math.sin(this.azimuth), c = Math.cos(this.azimuth);
    const up = Math.sin(this.elevation), level = this.isPlan ? 0 : Math.cos(this.elevation);
    // Rows of the projection: to the right and up the picture.
    this.rows = [[-s, c, 0], [up * c, up * s, -level]];
    const [north, east, deep] = high.map((x, i) => x - low[i]);
    const [fs, fc] = [Math.abs(Math.sin(this.front)), Math.abs(Math.cos(this.front))];
    const across = fs * north + fc * east;
    const tall = up * (fc * north + fs * east) + level * deep;
    this.scale = this.zoom * Math.min(
      (this.width - left - right) / across, (this.height - top - bottom) / tall);
    const [x, y] = this.middle, middle = high.map((h, i) => (h + low[i]) / 2);
    const at = (row) => row[0] * middle[0] + row[1] * middle[1] + row[2] * middle[2];
    this.origin = [x + this.pan[0] - this.scale * at(this.rows[0]),
      y + this.pan[1] + this.scale * at(this.rows[1])];
  }

  // Place in the picture [px] of a point [m].
  project(x, y, z) {
    const [r, u] = this.rows;
    return [
      this.origin[0] + this.scale * (r[0] * x + r[1] * y + r[2] * z),
      this.origin[1] - this.scale * (u[0] * x + u[1] * y + u[2] * z),
    ];
  }

  // Horizontal point [x, y] of the plan at a place in the picture.
  under(px, py) {
    return [(this.origin[1] - py) / this.scale, (px - this.origin[0]) / this.scale];
  }

  // Outline of a covariance L Lᵀ about a point, at `reach` standard deviations: places [px].
  outline([x, y, z], L, reach) {
    const a = this.rows.map((row) => [0, 1, 2].map(
      (k) => row[0] * L[0][k] + row[1] * L[1][k] + row[2] * L[2][k]));
    const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    // Again a lower triangle, of the covariance in the picture.
    const first = Math.sqrt(dot(a[0], a[0]));
    const mixed = first ? dot(a[0], a[1]) / first : 0;
    const second = Math.sqrt(Math.max(dot(a[1], a[1]) - mixed * mixed, 0));
    const [px, py] = this.project(x, y, z), size = reach * this.scale;
    return Array.from({ length: 49 }, (_, i) => {
      const angle = 2 * Math.PI * i / 48, c = Math.cos(angle), s = Math.sin(angle);
      return [px + size * first * c, py - size * (mixed * c + second * s)];
    });
  }
}
