import { apply } from "../geometry/pose.js";

/**
 * Return the end of a wall within reach of a point, or the point itself.
 *
 * @param {import("../draw/scene.js").Scene} scene @param {{x: number, y: number}} point page [m]
 * @param {number} reach [m]
 */
export function snapped({ state, placement }, point, reach) {
  let [best, found] = [reach, point];
  for (const group of state.lines.groups) {
    const pose = placement.get(group.component);
    if (!pose) continue;
    for (let i = 2 * group.start; i < 2 * group.end; i++) {
      const end = apply(pose, state.lines.ends[2 * i], state.lines.ends[2 * i + 1]);
      const distance = Math.hypot(end.x - point.x, end.y - point.y);
      if (distance < best) [best, found] = [distance, end];
    }
  }
  return found;
}
