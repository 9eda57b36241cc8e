/** An axis-aligned box. Empty until something is put into it. */
export class Bounds {
  constructor(xMin = Infinity, yMin = Infinity, xMax = -Infinity, yMax = -Infinity) {
    this.xMin = xMin;
    this.yMin = yMin;
    this.xMax = xMax;
    this.yMax = yMax;
  }

  get isEmpty() {
    return this.xMin > this.xMax;
  }

  get width() {
    return this.isEmpty ? 0 : this.xMax - this.xMin;
  }

  get height() {
    return this.isEmpty ? 0 : this.yMax - this.yMin;
  }

  get centre() {
    return { x: (this.xMin + this.xMax) / 2, y: (this.yMin + this.yMax) / 2 };
  }

  /** Take in a point. @param {number} x @param {number} y */
  add(x, y) {
    if (x < this.xMin) this.xMin = x;
    if (y < this.yMin) this.yMin = y;
    if (x > this.xMax) this.xMax = x;
    if (y > this.yMax) this.yMax = y;
  }

  /** Return the box grown by a margin on every side. @param {number} margin */
  grown(margin) {
    return new Bounds(
      this.xMin - margin,
      this.yMin - margin,
      this.xMax + margin,
      this.yMax + margin,
    );
  }

  /** Return the box moved. @param {number} x @param {number} y */
  moved(x, y) {
    return new Bounds(this.xMin + x, this.yMin + y, this.xMax + x, this.yMax + y);
  }

  /** Return the box around both. @param {Bounds} other */
  union(other) {
    return new Bounds(
      Math.min(this.xMin, other.xMin),
      Math.min(this.yMin, other.yMin),
      Math.max(this.xMax, other.xMax),
      Math.max(this.yMax, other.yMax),
    );
  }
}
