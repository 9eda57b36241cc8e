import { toPixels } from "./pixels.js";

/** Pieces drawn between two looks at the clock. */
const CHUNK = 800;

/**
 * @typedef {import("./scene.js").Scene} Scene
 * @typedef {import("./scene.js").View} View
 */

/** @param {any} context @param {Scene} scene @param {View} view @param {number} every */
export function* paintLines(context, { state, placement, palette }, view, every) {
  const { ends, groups } = state.lines;
  const dense = new Crowd(view);
  for (const group of groups) {
    const pose = placement.get(group.component);
    if (!pose) continue;
    const { width, alpha } = palette.wall(group.step);
    context.strokeStyle = palette.robot(group.robot);
    context.lineWidth = width;
    context.globalAlpha = alpha;
    const { a, b, tx, ty } = toPixels(pose, view);
    const [right, bottom] = [view.width + 2, view.height + 2];
    for (let start = group.start; start < group.end; start += CHUNK * every) {
      const end = Math.min(start + CHUNK * every, group.end);
      context.beginPath();
      for (let i = start; i < end; i += every) {
        const [x1, y1, x2, y2] = [ends[4 * i], ends[4 * i + 1], ends[4 * i + 2], ends[4 * i + 3]];
        const px = a * x1 - b * y1 + tx;
        const py = -b * x1 - a * y1 + ty;
        const qx = a * x2 - b * y2 + tx;
        const qy = -b * x2 - a * y2 + ty;
        if ((px < -2 && qx < -2) || (py < -2 && qy < -2)) continue;
        if ((px > right && qx > right) || (py > bottom && qy > bottom)) continue;
        if (Math.abs(qx - px) + Math.abs(qy - py) < 1 && dense.taken(px, py)) continue;
        context.moveTo(px, py);
        context.lineTo(qx, qy);
      }
      context.stroke();
      yield;
    }
  }
  context.globalAlpha = 1;
}

/** Lets one line shorter than a pixel through per pixel: more would draw the same. */
class Crowd {
  /** @param {View} view */
  constructor(view) {
    this._width = Math.ceil(view.width) + 4;
    this._height = Math.ceil(view.height) + 4;
    this._pixels = new Uint8Array(this._width * this._height);
  }

  /** @param {number} x @param {number} y */
  taken(x, y) {
    const [column, row] = [Math.floor(x) + 2, Math.floor(y) + 2];
    if (column < 0 || row < 0 || column >= this._width || row >= this._height) return true;
    const at = row * this._width + column;
    const before = this._pixels[at];
    this._pixels[at] = 1;
    return before === 1;
  }
}
