/**
 * Where the page looks: the point (x, y) [m] lies in the middle of the view, `scale` pixels are a
 * metre. World y points up, screen y down; pixels are CSS pixels.
 */
export class Camera {
  /** @param {number} [x] @param {number} [y] @param {number} [scale] */
  constructor(x = 0, y = 0, scale = 40) {
    this.x = x;
    this.y = y;
    this.scale = scale;
    this.width = 1;
    this.height = 1;
  }

  copy() {
    const copy = new Camera(this.x, this.y, this.scale);
    copy.width = this.width;
    copy.height = this.height;
    return copy;
  }

  /** @param {number} x @param {number} y */
  toScreen(x, y) {
    return {
      x: this.width / 2 + (x - this.x) * this.scale,
      y: this.height / 2 - (y - this.y) * this.scale,
    };
  }

  /** @param {number} x @param {number} y */
  toWorld(x, y) {
    return {
      x: this.x + (x - this.width / 2) / this.scale,
      y: this.y - (y - this.height / 2) / this.scale,
    };
  }

  /** Move the picture by pixels. @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  /** Zoom; what is at the screen point (x, y) stays there. @param {number} factor @param {number} x @param {number} y */
  zoom(factor, x, y) {
    const fixed = this.toWorld(x, y);
    this.scale = Math.min(Math.max(this.scale * factor, LEAST_SCALE), MOST_SCALE);
    const now = this.toWorld(x, y);
    this.x += fixed.x - now.x;
    this.y += fixed.y - now.y;
  }

  /**
   * Show a box whole, clear of what lies over the edges of the view.
   *
   * @param {import("../geometry/bounds.js").Bounds} bounds
   * @param {{top: number, right: number, bottom: number, left: number}} insets pixels
   */
  fit(bounds, { top, right, bottom, left }) {
    if (bounds.isEmpty) return;
    const room = {
      width: Math.max(this.width - left - right, this.width / 3),
      height: Math.max(this.height - top - bottom, this.height / 3),
    };
    const scale = Math.min(room.width / Math.max(bounds.width, 1), room.height / Math.max(bounds.height, 1));
    this.scale = Math.min(Math.max(scale, LEAST_SCALE), MOST_FITTED);
    this.x = bounds.centre.x + (right - left) / 2 / this.scale;
    this.y = bounds.centre.y + (top - bottom) / 2 / this.scale;
  }
}

const LEAST_SCALE = 0.05;
const MOST_SCALE = 2000;
const MOST_FITTED = 120;
