import { noFrames } from "../data/frames.js";
import { Bounds } from "../geometry/bounds.js";

const GAP_M = 3;
/** Boxes are rounded up to this, so that a growing map does not push its neighbours all the time. */
const STEP_M = 4;

/**
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {{id: string, extent: (theta: number) => Bounds}} Placeable
 * @typedef {import("../data/frames.js").Frames} Frames
 */

/**
 * Return where each component lies on the page: T_page_component by id. Components are set in rows,
 * in the order given, so that they fill a page of the wanted aspect (width over height). The first
 * keeps its origin: nothing is known of how the others lie to it. Where some have a place of their
 * own, the rows come below them.
 *
 * @param {Placeable[]} components @param {number} aspect @param {Frames} [frames]
 * @returns {Map<string, Pose>}
 */
export function arrange(components, aspect, frames = noFrames()) {
  const fixed = components.filter(({ id }) => frames.fixed.has(id));
  const free = components.filter(({ id }) => !frames.fixed.has(id));
  const rows = inRows(free, aspect, frames.turn);
  if (fixed.length === 0) return anchored(rows, free[0]?.id);
  const above = pageBounds(fixed, frames.fixed);
  const placed = new Map(fixed.map(({ id }) => [id, /** @type {Pose} */ (frames.fixed.get(id))]));
  for (const [id, pose] of rows) {
    placed.set(id, { ...pose, x: pose.x + above.xMin, y: pose.y + above.yMin - GAP_M });
  }
  return placed;
}

/** @param {Placeable[]} components @param {number} aspect @param {Map<string, number>} turn */
function inRows(components, aspect, turn) {
  const boxes = components.map(({ id, extent }) => {
    const theta = turn.get(id) ?? 0;
    return { id, theta, box: rounded(extent(theta)) };
  });
  const area = boxes.reduce((sum, { box }) => sum + (box.width + GAP_M) * (box.height + GAP_M), 0);
  const widest = Math.max(0, ...boxes.map(({ box }) => box.width));
  const room = Math.max(widest, Math.sqrt(area * aspect));
  /** @type {Map<string, Pose>} */
  const placed = new Map();
  let [x, top, rowHeight] = [0, 0, 0];
  for (const { id, theta, box } of boxes) {
    if (x > 0 && x + box.width > room) {
      top -= rowHeight + GAP_M;
      [x, rowHeight] = [0, 0];
    }
    placed.set(id, { x: x - box.xMin, y: top - box.yMax, theta });
    x += box.width + GAP_M;
    rowHeight = Math.max(rowHeight, box.height);
  }
  return placed;
}

/** Return the box around all components as they lie on the page. @param {Placeable[]} components @param {Map<string, Pose>} placement */
export function pageBounds(components, placement) {
  let all = new Bounds();
  for (const { id, extent } of components) {
    const pose = placement.get(id);
    if (!pose) continue;
    const bounds = extent(pose.theta);
    if (!bounds.isEmpty) all = all.union(bounds.moved(pose.x, pose.y));
  }
  return all;
}

/** @param {Bounds} bounds */
function rounded(bounds) {
  if (bounds.isEmpty) return new Bounds(0, 0, STEP_M, STEP_M);
  return new Bounds(
    STEP_M * Math.floor(bounds.xMin / STEP_M),
    STEP_M * Math.floor(bounds.yMin / STEP_M),
    STEP_M * Math.ceil(bounds.xMax / STEP_M),
    STEP_M * Math.ceil(bounds.yMax / STEP_M),
  );
}

/** @param {Map<string, Pose>} placed @param {string|undefined} first */
function anchored(placed, first) {
  const origin = first === undefined ? undefined : placed.get(first);
  if (!origin) return placed;
  return new Map(
    [...placed].map(([id, pose]) => [
      id,
      { ...pose, x: pose.x - origin.x, y: pose.y - origin.y },
    ]),
  );
}
