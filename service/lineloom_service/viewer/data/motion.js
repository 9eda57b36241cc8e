import { compose, inverse } from "../geometry/pose.js";

/**
 * @typedef {import("./site_state.js").SiteState} SiteState
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {{from: string, to: string, T_to_from: Pose}} Move
 */

/**
 * Return how each old component lies in the new components: one move for every pair of an old and
 * a new component that share keyframes. T_to_from is taken at the shared keyframe in the middle,
 * for the graph also bends a little when components join.
 *
 * @param {SiteState} before @param {SiteState} after @returns {Move[]}
 */
export function componentMoves(before, after) {
  /** @type {Map<string, {from: string, to: string, shared: string[]}>} */
  const pairs = new Map();
  for (const node of before.keyframes.values()) {
    const now = after.keyframes.get(node.id);
    if (!now || now.robot !== node.robot) continue;
    const key = `${node.component} ${now.component}`;
    const pair = pairs.get(key) ?? { from: node.component, to: now.component, shared: [] };
    pair.shared.push(node.id);
    pairs.set(key, pair);
  }
  return [...pairs.values()].map(({ from, to, shared }) => {
    const id = shared[Math.floor(shared.length / 2)];
    const old = /** @type {any} */ (before.keyframes.get(id));
    const now = /** @type {any} */ (after.keyframes.get(id));
    return { from, to, T_to_from: compose(now, inverse(old)) };
  });
}

/** Tell whether components have joined or split between two states. @param {Move[]} moves */
export function hasRegrouped(moves) {
  return moves.some((move) => move.from !== move.to);
}
