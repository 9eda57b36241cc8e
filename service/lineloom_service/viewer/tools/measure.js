import { apply, inverse } from "../geometry/pose.js";
import { drawLabel } from "../draw/label.js";
import { stroke } from "../draw/highlight_marks.js";

/**
 * @typedef {{x: number, y: number, component: string|null}} Stake a point of the page [m]
 * @typedef {import("../draw/scene.js").Scene} Scene
 */

/** Measures from point to point. Between two components there is no distance to be known. */
export class Measure {
  constructor() {
    /** @type {Stake[]} */
    this.points = [];
    /** @type {Stake|null} */
    this.pointer = null;
    this.active = false;
  }

  toggle() {
    this.active = !this.active;
    this.points = [];
    this.pointer = null;
  }

  /** @param {Scene} scene @param {{x: number, y: number}} point */
  add(scene, point) {
    this.points.push({ ...point, component: componentAt(scene, point) });
  }

  /** Show the way on to the pointer. @param {Scene} scene @param {{x: number, y: number}} point */
  pointAt(scene, point) {
    this.pointer = { ...point, component: componentAt(scene, point) };
  }

  /** Length of the whole way [m], NaN where it leads from one component to another. */
  get length() {
    return this.points.reduce((sum, p, i) => sum + (i === 0 ? 0 : apart(p, this.points[i - 1])), 0);
  }

  /** @param {CanvasRenderingContext2D} context @param {import("../draw/camera.js").Camera} camera @param {import("../draw/palette.js").Palette} palette */
  draw(context, camera, palette) {
    if (!this.active) return;
    const way = this.pointer ? [...this.points, this.pointer] : this.points;
    const { accent, paper } = palette.ink;
    stroke(context, camera, way, accent, 2);
    way.forEach((point, i) => {
      const { x, y } = camera.toScreen(point.x, point.y);
      context.beginPath();
      context.arc(x, y, 4, 0, 2 * Math.PI);
      context.fillStyle = paper;
      context.fill();
      context.strokeStyle = accent;
      context.lineWidth = 2;
      context.stroke();
      if (i === 0) return;
      const middle = { x: (point.x + way[i - 1].x) / 2, y: (point.y + way[i - 1].y) / 2 };
      const at = camera.toScreen(middle.x, middle.y);
      const text = words(apart(point, way[i - 1]));
      drawLabel(context, text, at.x, at.y - 8, accent, paper, { bold: true, align: "center" });
    });
  }
}

/** @param {number} metres */
export function words(metres) {
  return Number.isNaN(metres) ? "not known: two components" : `${metres.toFixed(2)} m`;
}

/** @param {Stake} a @param {Stake} b */
function apart(a, b) {
  const known = a.component === b.component || a.component === null || b.component === null;
  return known ? Math.hypot(a.x - b.x, a.y - b.y) : NaN;
}

/** Return the component in whose box a point lies. @param {Scene} scene @param {{x: number, y: number}} point */
function componentAt({ state, placement }, { x, y }) {
  for (const { id, bounds } of state.components) {
    const pose = placement.get(id);
    if (!pose) continue;
    const at = apply(inverse(pose), x, y);
    const { xMin, yMin, xMax, yMax } = bounds.grown(0.5);
    if (at.x >= xMin && at.x <= xMax && at.y >= yMin && at.y <= yMax) return id;
  }
  return null;
}
