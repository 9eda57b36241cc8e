import { apply } from "../geometry/pose.js";
import { constraintEnds } from "./constraint_marks.js";

/** Pieces drawn between two looks at the clock. */
const CHUNK = 800;

/**
 * @typedef {import("../data/site_state.js").SiteState} SiteState
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {{state: SiteState, placement: Map<string, Pose>, palette: import("./palette.js").Palette,
 *   layers: import("./layers.js").LayerChoice}} Scene
 * @typedef {{x: number, y: number, scale: number, width: number, height: number}} View
 * Middle of the view [m], pixels per metre, size in pixels.
 */

/**
 * Draw what moves only when the map does, in steps: the generator yields after every few
 * milliseconds' worth of strokes, so that a large map is drawn over several frames.
 *
 * @param {CanvasRenderingContext2D|OffscreenCanvasRenderingContext2D} context
 * @param {Scene} scene @param {View} view
 * @param {number} [every] draw only every n-th line: for frames that must come now
 */
export function* paint(context, scene, view, every = 1) {
  context.lineCap = "round";
  context.lineJoin = "round";
  if (scene.layers.submaps) yield* paintSubmaps(context, scene, view);
  if (scene.layers.trajectories) yield* paintPaths(context, scene, view);
  if (scene.layers.lines) yield* paintLines(context, scene, view, every);
  if (scene.layers.keyframes) yield* paintKeyframes(context, scene, view);
  yield* paintConstraints(context, scene, view);
  context.globalAlpha = 1;
  context.setLineDash([]);
}

/** @param {any} context @param {Scene} scene @param {View} view @param {number} every */
function* paintLines(context, { state, placement, palette }, view, every) {
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

/** Return the map x' = a x - b y + tx, y' = -b x - a y + ty from a component's metres to pixels. @param {Pose} pose @param {View} view */
function toPixels(pose, view) {
  return {
    a: Math.cos(pose.theta) * view.scale,
    b: Math.sin(pose.theta) * view.scale,
    tx: view.width / 2 + (pose.x - view.x) * view.scale,
    ty: view.height / 2 - (pose.y - view.y) * view.scale,
  };
}

/** @param {any} context @param {Scene} scene @param {View} view */
function* paintPaths(context, { state, placement, palette }, view) {
  context.lineWidth = 1.5;
  context.globalAlpha = 0.55;
  for (const path of state.paths) {
    const pose = placement.get(path.component);
    if (!pose) continue;
    context.strokeStyle = palette.robot(state.robotNames.indexOf(path.robot));
    context.beginPath();
    polyline(context, path.points, toPixels(pose, view));
    context.stroke();
    yield;
  }
  context.globalAlpha = 1;
}

/** Points within a pixel of the last one are left out. @param {any} context @param {Float32Array} points @param {{a: number, b: number, tx: number, ty: number}} T */
function polyline(context, points, { a, b, tx, ty }) {
  let [lastX, lastY] = [Infinity, Infinity];
  for (let i = 0; i < points.length; i += 2) {
    const x = a * points[i] - b * points[i + 1] + tx;
    const y = -b * points[i] - a * points[i + 1] + ty;
    if (i === 0) context.moveTo(x, y);
    else if (i + 2 >= points.length || Math.abs(x - lastX) + Math.abs(y - lastY) >= 1) {
      context.lineTo(x, y);
    } else continue;
    [lastX, lastY] = [x, y];
  }
}

/** @param {any} context @param {Scene} scene @param {View} view */
function* paintKeyframes(context, { state, placement, palette }, view) {
  const radius = Math.min(Math.max(0.05 * view.scale, 1.2), 4);
  const tick = Math.max(0.18 * view.scale, 2 * radius);
  const heading = view.scale > 25;
  let count = 0;
  for (const node of state.keyframes.values()) {
    const pose = placement.get(node.component);
    if (!pose) continue;
    const { a, b, tx, ty } = toPixels(pose, view);
    const x = a * node.x - b * node.y + tx;
    const y = -b * node.x - a * node.y + ty;
    if (x < -9 || y < -9 || x > view.width + 9 || y > view.height + 9) continue;
    context.fillStyle = palette.robot(state.robotNames.indexOf(node.robot));
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
    if (heading) {
      const angle = pose.theta + node.theta;
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(x, y);
      context.lineTo(x + tick * Math.cos(angle), y - tick * Math.sin(angle));
      context.stroke();
    }
    count += 1;
    if (count % 300 === 0) yield;
  }
}

/** A submap is a band along its keyframes. @param {any} context @param {Scene} scene @param {View} view */
function* paintSubmaps(context, { state, placement, palette }, view) {
  context.globalAlpha = 0.13;
  context.lineWidth = Math.max(0.9 * view.scale, 5);
  for (const submap of state.submaps) {
    const nodes = submap.keyframes.map((id) => state.keyframes.get(id)).filter((n) => n);
    const pose = placement.get(nodes[0]?.component ?? "");
    if (!pose) continue;
    context.strokeStyle = palette.robot(state.robotNames.indexOf(submap.robot));
    context.beginPath();
    const points = nodes.flatMap((node) => [node?.x ?? 0, node?.y ?? 0]);
    polyline(context, Float32Array.from(points), toPixels(pose, view));
    context.stroke();
    yield;
  }
  context.globalAlpha = 1;
}

/** @param {any} context @param {Scene} scene @param {View} view */
function* paintConstraints(context, scene, view) {
  const { state, placement, palette, layers } = scene;
  let count = 0;
  for (const constraint of state.constraints.values()) {
    if (!layers[constraint.state]) continue;
    const ends = constraintEnds(constraint, state, placement);
    if (!ends) continue;
    styleConstraint(context, palette, constraint.state, constraint.kind);
    context.beginPath();
    for (const [i, { x, y }] of ends.entries()) {
      const px = view.width / 2 + (x - view.x) * view.scale;
      const py = view.height / 2 - (y - view.y) * view.scale;
      if (i === 0) context.moveTo(px, py);
      else context.lineTo(px, py);
    }
    context.stroke();
    count += 1;
    if (count % 300 === 0) yield;
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

/** @param {any} context @param {import("./palette.js").Palette} palette @param {string} state @param {string} kind */
function styleConstraint(context, palette, state, kind) {
  context.strokeStyle = palette.constraint(state);
  context.lineWidth = kind === "rendezvous" ? 1.8 : 1.1;
  context.globalAlpha = state === "accepted" ? 0.8 : 0.7;
  context.setLineDash(DASHES[state] ?? []);
}

/** @type {Record<string, number[]>} */
const DASHES = { candidate: [6, 4], rejected: [2, 4], retracted: [8, 3, 2, 3] };

/** Return a point of a component on the page. @param {Map<string, Pose>} placement @param {string} component @param {number} x @param {number} y */
export function onPage(placement, component, x, y) {
  const pose = placement.get(component);
  return pose ? apply(pose, x, y) : null;
}
