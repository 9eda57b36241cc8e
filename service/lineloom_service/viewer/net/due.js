/** Of the time, what fetching a part again and again may take: a twentieth. */
const PAUSE_PER_FETCH = 19;
const LEAST_PAUSE_MS = 1500;
const MOST_PAUSE_MS = 10000;
/** Events after which only the robots have moved. */
const LIGHT = new Set(["scan", "robot"]);

/**
 * A part of the state that grows with the site and is always fetched whole.
 *
 * @typedef {"graph"|"constraints"} PartName
 */
class Part {
  constructor() {
    /** @type {"no"|"soon"|"now"} */
    this.level = "no";
    this.notBefore = -Infinity;
  }

  soon() {
    if (this.level === "no") this.level = "soon";
  }

  /** Tell whether it is to be fetched; what has to wait stays due. @param {number} at [ms] */
  begin(at) {
    if (this.wait(at) > 0) return false;
    this.level = "no";
    return true;
  }

  /** How long until it may be fetched [ms]; Infinity where it need not. @param {number} at [ms] */
  wait(at) {
    if (this.level === "no") return Infinity;
    return this.level === "now" ? 0 : Math.max(0, this.notBefore - at);
  }
}

/**
 * What of a site has to be asked for again, as its events tell: at once where robots' maps join or
 * part. What only makes them grow, steps and loops, waits, the longer the more it costs to fetch.
 */
export class Due {
  /** @param {() => number} [clock] [ms] */
  constructor(clock = () => performance.now()) {
    this._clock = clock;
    this._robots = false;
    this._map = false;
    /** @type {Record<PartName, Part>} */
    this._parts = { graph: new Part(), constraints: new Part() };
    this.everything();
  }

  everything() {
    this._robots = true;
    this._map = true;
    for (const part of Object.values(this._parts)) part.level = "now";
  }

  robots() {
    this._robots = true;
  }

  /** @param {{type: string, data: any}} event */
  note({ type, data }) {
    const { graph, constraints } = this._parts;
    this._robots = true;
    if (LIGHT.has(type)) return;
    this._map = true;
    if (type === "map" && !data?.settled) {
      graph.soon();
    } else if (type !== "constraint" || !data?.kind) {
      this.everything(); // what has settled moves as a whole
    } else if (data.was === "accepted" && data.kind !== "sequential") {
      this.everything(); // what was believed is not any more: the map may come apart
    } else {
      graph.soon();
      if (data.kind !== "sequential") constraints.soon(); // the page's list has no steps
    }
  }

  /** How long until something is due [ms]. */
  get wait() {
    if (this._robots || this._map) return 0;
    const at = this._clock();
    return Math.min(...Object.values(this._parts).map((part) => part.wait(at)));
  }

  /**
   * Return what is to be fetched now; that is due no longer.
   *
   * @returns {{robots: boolean, state: boolean, graph: boolean, constraints: boolean}}
   * state: the map and with it whatever of the two others is
   */
  begin() {
    const at = this._clock();
    const graph = this._parts.graph.begin(at);
    const constraints = this._parts.constraints.begin(at);
    const found = { robots: this._robots, state: this._map || graph || constraints, graph, constraints };
    this._robots = this._map = false;
    return found;
  }

  /** A part was fetched. @param {PartName} name @param {number} took [ms] */
  fetched(name, took) {
    const pause = Math.min(Math.max(PAUSE_PER_FETCH * took, LEAST_PAUSE_MS), MOST_PAUSE_MS);
    this._parts[name].notBefore = this._clock() + pause;
  }
}
