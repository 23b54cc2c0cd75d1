// The few vectors and the one camera that the viewer needs.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = (p, d, t) => [p[0] + d[0] * t, p[1] + d[1] * t, p[2] + d[2] * t];

/** An orthographic camera on a turntable: z stays up. */
class Camera {
  constructor(low, high) {
    this.low = low;
    this.high = high;
    this.diagonal = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    this.azimuth = -60;
    this.elevation = 30;
    this.fit(1);
  }

  /** Shows everything in a pane whose width is `aspect` times its height. */
  fit(aspect) {
    this.center = [0, 1, 2].map((k) => (this.low[k] + this.high[k]) / 2);
    const [right, up] = this.axes();
    const half = (axis) => [0, 1, 2].reduce((sum, k) => sum + (Math.abs(axis[k]) * (this.high[k] - this.low[k])) / 2, 0);
    this.halfHeight = 1.12 * Math.max(half(up), half(right) / aspect);
  }

  /** Right, up and towards the viewer. */
  axes() {
    const [a, e] = [this.azimuth, this.elevation].map((angle) => (angle * Math.PI) / 180);
    const [sa, ca, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
    return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + up));
  }

  /** By parts of the height of the pane. */
  pan(right, up) {
    const [x, y] = this.axes();
    this.center = along(along(this.center, x, -2 * right * this.halfHeight), y, -2 * up * this.halfHeight);
  }

  /** About a point of the pane: from the middle, in halves of its height. */
  zoom(factor, x = 0, y = 0) {
    const before = this.halfHeight;
    this.halfHeight = Math.max(this.diagonal * 1e-4, Math.min(this.diagonal * 20, before / factor));
    const [right, up] = this.axes();
    this.center = along(along(this.center, right, x * (before - this.halfHeight)), up, y * (before - this.halfHeight));
  }

  /** From the middle of the pane in halves of its height; the third grows towards the viewer, mm. */
  project(p) {
    const d = along(p, this.center, -1);
    const [right, up, back] = this.axes();
    return [dot(d, right) / this.halfHeight, dot(d, up) / this.halfHeight, dot(d, back)];
  }
}
