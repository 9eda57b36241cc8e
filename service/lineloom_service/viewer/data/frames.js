/**
 * In whose coordinates the map is shown: each component's own, turned so that most walls run along
 * the page's edges, or the building's floor plan's.
 *
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {import("./site_state.js").SiteState} SiteState
 * @typedef {import("../net/contract.js").FloorPlanAnswer} FloorPlanAnswer
 * @typedef {"map"|"walls"|"plan"} FrameChoice
 * @typedef {{turn: Map<string, number>, fixed: Map<string, Pose>}} Frames
 * turn: by how much components are turned on the page [rad]. fixed: T_page_component of those whose
 * place is known.
 */

/** Names for people. @type {[FrameChoice, string][]} */
export const FRAME_NAMES = [
  ["map", "As mapped"],
  ["walls", "Along the walls"],
  ["plan", "In the floor plan"],
];

/** A map that grows turns its walls a little all the time: nothing follows that [rad]. */
const LEAST_TURN = 0.01;

/** @returns {Frames} */
export function noFrames() {
  return { turn: new Map(), fixed: new Map() };
}

/**
 * Return the frames for a state.
 *
 * @param {FrameChoice} choice @param {SiteState} state
 * @param {FloorPlanAnswer|null} plan @param {Frames} before
 * @returns {Frames}
 */
export function framesOf(choice, state, plan, before) {
  if (choice === "map") return noFrames();
  const turn = new Map(
    state.components.map(({ id }) => {
      const [last, now] = [before.turn.get(id), -wallDirection(state, id)];
      return [id, last !== undefined && Math.abs(now - last) < LEAST_TURN ? last : now];
    }),
  );
  /** @type {Map<string, Pose>} */
  const fixed = new Map();
  for (const { component, T_plan_map } of choice === "plan" && plan ? plan.components : []) {
    if (T_plan_map) fixed.set(component, T_plan_map);
  }
  return { turn, fixed };
}

/** Walls that run askew by more than this (cosine of four times the angle) do not count. */
const LEAST_ALIKE = Math.cos(4 * 0.15);

/**
 * Return in which direction most metres of a component's walls run, in (-pi/4, pi/4]: the mean of
 * the directions, a quarter turn of which makes no difference, and then of those near that mean.
 *
 * @param {SiteState} state @param {string} id
 */
export function wallDirection(state, id) {
  let mean = meanOf(state, id, () => true);
  for (let round = 0; round < 3; round++) {
    const { x, y } = mean;
    const length = Math.hypot(x, y);
    mean = meanOf(state, id, (c, s) => c * x + s * y >= LEAST_ALIKE * length);
  }
  return Math.atan2(mean.y, mean.x) / 4;
}

/**
 * Return the sum over a component's walls of (cos 4a, sin 4a), a being the direction, by length.
 *
 * @param {SiteState} state @param {string} id
 * @param {(c: number, s: number) => boolean} counts
 */
function meanOf(state, id, counts) {
  const { ends, groups } = state.lines;
  let [x, y] = [0, 0];
  for (const { component, start, end } of groups) {
    if (component !== id) continue;
    for (let i = 4 * start; i < 4 * end; i += 4) {
      const [dx, dy] = [ends[i + 2] - ends[i], ends[i + 3] - ends[i + 1]];
      const length = Math.hypot(dx, dy);
      if (length === 0) continue;
      const [c, s] = [dx / length, dy / length];
      const [c2, s2] = [c * c - s * s, 2 * c * s];
      const [c4, s4] = [c2 * c2 - s2 * s2, 2 * c2 * s2];
      if (!counts(c4, s4)) continue;
      x += length * c4;
      y += length * s4;
    }
  }
  return { x, y };
}
