import { rebuilt, rebuildSteps } from "./rebuild.js";

/** Most memory that kept versions may take, about. */
const MOST_BYTES = 96 * 1024 * 1024;
const MOST_VERSIONS = 300;

/**
 * @typedef {import("./site_state.js").SiteState} SiteState
 * @typedef {{kind: "rebuilt", known: number} | {kind: "received", state: SiteState}} Moment
 */

/**
 * What the time slider goes through. The service keeps no past maps, so the past is of two kinds:
 * versions that this page has received, shown as they were; and, for the time before, a rebuilt
 * growth: today's map without what had not been seen yet.
 */
export class History {
  constructor() {
    /** @type {SiteState[]} */
    this._received = [];
    /** @type {Moment[]|null} */
    this._moments = null;
  }

  /** The version received last, or null. @returns {SiteState|null} */
  get latest() {
    return this._received[this._received.length - 1] ?? null;
  }

  /** Keep a state; one of the same version replaces the one before. @param {SiteState} state */
  add(state) {
    if (this.latest?.version === state.version) this._received.pop();
    this._received.push(state);
    this._thin();
    this._moments = null;
  }

  clear() {
    this._received = [];
    this._moments = null;
  }

  /** All moments, oldest first; the last one is now. @returns {Moment[]} */
  get moments() {
    if (this._moments) return this._moments;
    const first = this._received[0];
    /** @type {Moment[]} */
    const before = first ? rebuildSteps(first).map((known) => ({ kind: "rebuilt", known })) : [];
    const received = this._received.map(
      (state) => /** @type {Moment} */ ({ kind: "received", state }),
    );
    this._moments = [...before, ...received];
    return this._moments;
  }

  /** Return what to show for a moment. @param {Moment} moment @returns {SiteState} */
  stateAt(moment) {
    if (moment.kind === "received") return moment.state;
    return rebuilt(/** @type {SiteState} */ (this.latest), moment.known);
  }

  /** Leave out every second version of the older half while there is too much. */
  _thin() {
    let bytes = this._received.reduce((sum, state) => sum + state.lines.bytes, 0);
    while (
      this._received.length > 2 &&
      (this._received.length > MOST_VERSIONS || bytes > MOST_BYTES)
    ) {
      const half = Math.max(2, Math.floor(this._received.length / 2));
      this._received = this._received.filter((_, i) => i === 0 || i >= half || i % 2 === 0);
      bytes = this._received.reduce((sum, state) => sum + state.lines.bytes, 0);
    }
  }
}
