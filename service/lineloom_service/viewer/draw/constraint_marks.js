import { apply } from "../geometry/pose.js";

/**
 * Return where a constraint's two keyframes lie on the page, or null where one is not shown.
 *
 * @param {import("../net/contract.js").ConstraintAnswer} constraint
 * @param {import("../data/site_state.js").SiteState} state
 * @param {Map<string, import("../geometry/pose.js").Pose>} placement
 */
export function constraintEnds(constraint, state, placement) {
  const a = state.keyframes.get(constraint.keyframe_a);
  const b = state.keyframes.get(constraint.keyframe_b);
  const poseA = a && placement.get(a.component);
  const poseB = b && placement.get(b.component);
  return poseA && poseB ? [apply(poseA, a.x, a.y), apply(poseB, b.x, b.y)] : null;
}
