import { Bounds } from "../geometry/bounds.js";

const GAP_M = 3;
/** Boxes are rounded up to this, so that a growing map does not push its neighbours all the time. */
const STEP_M = 4;

/**
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {{id: string, bounds: Bounds}} Placeable
 */

/**
 * Return where each component lies on the page: T_page_component by id. Components are set in rows,
 * in the order given, so that they fill a page of the wanted aspect (width over height). Only the
 * first keeps its own frame: nothing is known of how the others lie to it.
 *
 * @param {Placeable[]} components @param {number} aspect @returns {Map<string, Pose>}
 */
export function arrange(components, aspect) {
  const boxes = components.map((component) => ({ id: component.id, box: rounded(component.bounds) }));
  const area = boxes.reduce((sum, { box }) => sum + (box.width + GAP_M) * (box.height + GAP_M), 0);
  const widest = Math.max(0, ...boxes.map(({ box }) => box.width));
  const room = Math.max(widest, Math.sqrt(area * aspect));
  /** @type {Map<string, Pose>} */
  const placed = new Map();
  let [x, top, rowHeight] = [0, 0, 0];
  for (const { id, box } of boxes) {
    if (x > 0 && x + box.width > room) {
      top -= rowHeight + GAP_M;
      [x, rowHeight] = [0, 0];
    }
    placed.set(id, { x: x - box.xMin, y: top - box.yMax, theta: 0 });
    x += box.width + GAP_M;
    rowHeight = Math.max(rowHeight, box.height);
  }
  return anchored(placed, boxes[0]?.id);
}

/** Return the box around all components as they lie on the page. @param {Placeable[]} components @param {Map<string, Pose>} placement */
export function pageBounds(components, placement) {
  let all = new Bounds();
  for (const { id, bounds } of components) {
    const pose = placement.get(id);
    if (pose && !bounds.isEmpty) all = all.union(bounds.moved(pose.x, pose.y));
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
      { x: pose.x - origin.x, y: pose.y - origin.y, theta: 0 },
    ]),
  );
}
