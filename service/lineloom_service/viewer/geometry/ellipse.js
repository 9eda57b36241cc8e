/**
 * @typedef {{major: number, minor: number, angle: number}} Ellipse
 * Semi-axes in metres, angle of the major axis in radians.
 */

/** Radius, in standard deviations, of the circle that holds 95 % of a plane normal distribution. */
export const SIGMAS_95 = Math.sqrt(-2 * Math.log(0.05));

/**
 * Return the ellipse that holds the position with 95 %, or null where a direction is not known.
 *
 * @param {(number|null)[][]|null|undefined} covariance 3x3 over x, y, theta
 * @returns {Ellipse|null}
 */
export function positionEllipse(covariance) {
  if (!covariance) return null;
  const [xx, xy, yy] = [covariance[0][0], covariance[0][1], covariance[1][1]];
  if (xx === null || xy === null || yy === null) return null;
  const mean = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  return {
    major: SIGMAS_95 * Math.sqrt(Math.max(mean + spread, 0)),
    minor: SIGMAS_95 * Math.sqrt(Math.max(mean - spread, 0)),
    angle: Math.atan2(2 * xy, xx - yy) / 2,
  };
}
