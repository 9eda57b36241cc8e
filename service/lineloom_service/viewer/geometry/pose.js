/**
 * Rigid motions of the plane. A pose is {x, y, theta}: metres, radians, counter-clockwise.
 * T_a_b maps coordinates of frame b to frame a.
 *
 * @typedef {{x: number, y: number, theta: number}} Pose
 * @typedef {{x: number, y: number}} Point
 */

/** @type {Readonly<Pose>} */
export const IDENTITY = Object.freeze({ x: 0, y: 0, theta: 0 });

/** Return T_a_c from T_a_b and T_b_c. @param {Pose} ab @param {Pose} bc @returns {Pose} */
export function compose(ab, bc) {
  const moved = apply(ab, bc.x, bc.y);
  return { x: moved.x, y: moved.y, theta: wrap(ab.theta + bc.theta) };
}

/** Return T_b_a from T_a_b. @param {Pose} ab @returns {Pose} */
export function inverse(ab) {
  const c = Math.cos(ab.theta);
  const s = Math.sin(ab.theta);
  return { x: -c * ab.x - s * ab.y, y: s * ab.x - c * ab.y, theta: wrap(-ab.theta) };
}

/** Return a point of frame b in frame a. @param {Pose} ab @param {number} x @param {number} y @returns {Point} */
export function apply(ab, x, y) {
  const c = Math.cos(ab.theta);
  const s = Math.sin(ab.theta);
  return { x: ab.x + c * x - s * y, y: ab.y + s * x + c * y };
}

/** Return the angle in (-pi, pi]. @param {number} angle */
export function wrap(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

/**
 * Return the pose a share of the way from one to another, turning the shorter way round and moving
 * `pivot`, a point of the moved frame, on a straight line.
 *
 * @param {Pose} from @param {Pose} to @param {number} share 0 to 1
 * @param {Point} [pivot]
 * @returns {Pose}
 */
export function between(from, to, share, pivot = { x: 0, y: 0 }) {
  const theta = from.theta + share * wrap(to.theta - from.theta);
  const start = apply(from, pivot.x, pivot.y);
  const end = apply(to, pivot.x, pivot.y);
  const turned = apply({ x: 0, y: 0, theta }, pivot.x, pivot.y);
  return {
    x: start.x + share * (end.x - start.x) - turned.x,
    y: start.y + share * (end.y - start.y) - turned.y,
    theta: wrap(theta),
  };
}
