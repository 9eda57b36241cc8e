import { apply, inverse } from "../geometry/pose.js";
import { constraintEnds } from "../draw/constraint_marks.js";

/**
 * @typedef {import("../draw/highlight_marks.js").Thing} Thing
 * @typedef {import("../draw/scene.js").Scene} Scene
 */

/**
 * Return what lies at a point of the page: a robot before a constraint, a constraint before a wall.
 *
 * @param {Scene} scene @param {{x: number, y: number}} point page [m]
 * @param {number} reach how far beside a thing still counts [m] @returns {Thing|null}
 */
export function pick(scene, point, reach) {
  return robotAt(scene, point, reach) ?? constraintAt(scene, point, reach) ?? lineAt(scene, point, reach);
}

/** @param {Scene} scene @param {{x: number, y: number}} point @param {number} reach @returns {Thing|null} */
function robotAt({ state, placement, layers }, point, reach) {
  if (!layers.robots) return null;
  for (const robot of state.robots) {
    const pose = placement.get(robot.component ?? "");
    if (!pose || !robot.pose) continue;
    const at = apply(pose, robot.pose.x, robot.pose.y);
    if (Math.hypot(at.x - point.x, at.y - point.y) < 1.6 * reach) return { kind: "robot", id: robot.robot };
  }
  return null;
}

/** @param {Scene} scene @param {{x: number, y: number}} point @param {number} reach @returns {Thing|null} */
function constraintAt({ state, placement, layers }, point, reach) {
  let [best, found] = [reach, /** @type {Thing|null} */ (null)];
  for (const constraint of state.constraints.values()) {
    if (!layers[constraint.state]) continue;
    const ends = constraintEnds(constraint, state, placement);
    if (!ends) continue;
    const distance = distanceTo(point, ends[0].x, ends[0].y, ends[1].x, ends[1].y);
    if (distance < best) [best, found] = [distance, { kind: "constraint", id: constraint.id }];
  }
  return found;
}

/** @param {Scene} scene @param {{x: number, y: number}} point @param {number} reach @returns {Thing|null} */
function lineAt({ state, placement, layers }, point, reach) {
  if (!layers.lines) return null;
  const { ends, groups, answers } = state.lines;
  let [best, found] = [reach, -1];
  for (const group of groups) {
    const pose = placement.get(group.component);
    if (!pose) continue;
    const { x, y } = apply(inverse(pose), point.x, point.y);
    for (let i = group.start; i < group.end; i++) {
      const at = 4 * i;
      const distance = distanceTo({ x, y }, ends[at], ends[at + 1], ends[at + 2], ends[at + 3]);
      if (distance < best) [best, found] = [distance, i];
    }
  }
  return found < 0 ? null : { kind: "line", id: answers[found].id };
}

/** Return the distance of a point from a line segment. @param {{x: number, y: number}} point @param {number} x1 @param {number} y1 @param {number} x2 @param {number} y2 */
export function distanceTo({ x, y }, x1, y1, x2, y2) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const squared = dx * dx + dy * dy;
  const share = squared > 0 ? Math.min(Math.max(((x - x1) * dx + (y - y1) * dy) / squared, 0), 1) : 0;
  return Math.hypot(x - x1 - share * dx, y - y1 - share * dy);
}
