import { between, compose, inverse } from "../geometry/pose.js";
import { componentMoves, hasRegrouped } from "../data/motion.js";

const DURATION_MS = 1100;

/**
 * @typedef {import("../geometry/pose.js").Pose} Pose
 * @typedef {import("../data/site_state.js").SiteState} SiteState
 * @typedef {import("./camera.js").Camera} Camera
 * @typedef {{from: Pose, to: Pose, pivot: {x: number, y: number}}} Glide
 */

/**
 * Components gliding to where they belong now. Where components join, the old map is shown until
 * they lie together; where one splits, its parts set out from where they lay.
 */
export class Transition {
  /** @param {SiteState} shown the map that is drawn meanwhile @param {Map<string, Glide>} glides by its components */
  constructor(shown, glides) {
    this.shown = shown;
    this._glides = glides;
    this._began = performance.now();
    /** @type {{from: Camera, to: Camera}|null} */
    this._cameras = null;
  }

  /**
   * Return the transition from one state to the next, or null where everything stays in its place.
   *
   * @param {SiteState} before @param {Map<string, Pose>} placedBefore
   * @param {SiteState} after @param {Map<string, Pose>} placedAfter
   */
  static of(before, placedBefore, after, placedAfter) {
    const moves = componentMoves(before, after);
    const joins = after.components.length < before.components.length;
    const regrouped = hasRegrouped(moves);
    const shown = regrouped && joins ? before : after;
    /** @type {Map<string, Glide>} */
    const glides = new Map();
    for (const move of moves) {
      const from = placedBefore.get(move.from);
      const to = placedAfter.get(move.to);
      if (!from || !to) continue;
      const [id, glide] =
        shown === before
          ? [move.from, { from, to: compose(to, move.T_to_from) }]
          : [move.to, { from: compose(from, inverse(move.T_to_from)), to }];
      const bounds = shown.component(id)?.bounds;
      glides.set(id, { ...glide, pivot: bounds && !bounds.isEmpty ? bounds.centre : { x: 0, y: 0 } });
    }
    const still = [...glides.values()].every(({ from, to }) => near(from, to));
    return still ? null : new Transition(shown, glides);
  }

  get over() {
    return performance.now() - this._began >= DURATION_MS;
  }

  /** Take the camera along. @param {Camera} from @param {Camera} to */
  carry(from, to) {
    this._cameras = { from: from.copy(), to };
  }

  /** Look where the camera is on its way. @param {Camera} camera */
  steer(camera) {
    if (!this._cameras) return;
    const { from, to } = this._cameras;
    const share = this._share();
    camera.x = from.x + share * (to.x - from.x);
    camera.y = from.y + share * (to.y - from.y);
    camera.scale = from.scale * (to.scale / from.scale) ** share;
  }

  /** Where the components of `shown` lie now. @returns {Map<string, Pose>} */
  placement() {
    const share = this._share();
    return new Map(
      [...this._glides].map(([id, { from, to, pivot }]) => [id, between(from, to, share, pivot)]),
    );
  }

  _share() {
    return eased(Math.min((performance.now() - this._began) / DURATION_MS, 1));
  }
}

/** @param {Pose} a @param {Pose} b */
function near(a, b) {
  return Math.hypot(a.x - b.x, a.y - b.y) < 0.5 && Math.abs(a.theta - b.theta) < 0.03;
}

/** Slow at both ends. @param {number} share */
function eased(share) {
  return share < 0.5 ? 4 * share ** 3 : 1 - (-2 * share + 2) ** 3 / 2;
}
