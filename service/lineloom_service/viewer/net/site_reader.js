import { robotNamesOf, SiteState } from "../data/site_state.js";
import { MapCopy } from "./map_copy.js";

const PAGE = 1000;

/**
 * Fetches what a SiteState is made of.
 *
 * @typedef {{graph: boolean, constraints: boolean}} Wanted which of the parts that are always
 * fetched whole are wanted anew
 */
export class SiteReader {
  /**
   * @param {import("./api.js").Api} api @param {string} site
   * @param {(part: import("./due.js").PartName, took: number) => void} onFetched told how long it took [ms]
   */
  constructor(api, site, onFetched) {
    this._api = api;
    this._onFetched = onFetched;
    /** @type {import("./contract.js").GraphAnswer|null} */
    this._graph = null;
    /** @type {import("./contract.js").ConstraintAnswer[]|null} */
    this._constraints = null;
    this._path = `v1/sites/${encodeURIComponent(site)}`;
    this._map = new MapCopy(api, `${this._path}/map`);
  }

  /** Forget what was received: what comes next is another history. */
  forget() {
    this._map.forget();
    this._graph = null;
    this._constraints = null;
  }

  /** Return how the site is doing. @returns {Promise<import("./contract.js").SiteAnswer>} */
  site() {
    return this._api.get(this._path);
  }

  /** Return the robots alone: cheap, for what moves all the time. @returns {Promise<import("./contract.js").RobotAnswer[]>} */
  async robots() {
    return (await this._api.get(`${this._path}/robots`)).robots;
  }

  /**
   * Return the whole state: what is not wanted anew is what it was. The answers are fetched side by
   * side while the service goes on, so they may differ by a version: then they are fetched once more.
   *
   * @param {Wanted} wanted
   */
  async state(wanted) {
    let answers = await this._answers(wanted);
    if (!agree(answers)) answers = await this._answers({ graph: true, constraints: true });
    return new SiteState(answers, answers.lines);
  }

  /** @param {Wanted} wanted */
  async _answers(wanted) {
    const [site, news, robots, graph, constraints] = await Promise.all([
      this.site(),
      this._map.news(),
      this.robots(),
      wanted.graph || !this._graph
        ? this._timed("graph", () => this._api.get(`${this._path}/graph`))
        : this._graph,
      wanted.constraints || !this._constraints
        ? this._timed("constraints", () => this._fetchConstraints())
        : this._constraints,
    ]);
    this._graph = graph;
    this._constraints = constraints;
    const { map, lines } = this._map.take(news, robotNamesOf(site, robots));
    return { site, map, lines, robots, graph, constraints };
  }

  /** @template T @param {import("./due.js").PartName} part @param {() => Promise<T>} fetched */
  async _timed(part, fetched) {
    const began = performance.now();
    const answer = await fetched();
    this._onFetched(part, performance.now() - began);
    return answer;
  }

  /** Return loops, rendezvous and what operators said; tracked steps are drawn as trajectories. @returns {Promise<import("./contract.js").ConstraintAnswer[]>} */
  async _fetchConstraints() {
    const kinds = await Promise.all(["loop", "rendezvous", "operator"].map((kind) => this._ofKind(kind)));
    return kinds.flat();
  }

  /** @param {string} kind */
  async _ofKind(kind) {
    const found = [];
    let cursor = "";
    for (;;) {
      const query = `kind=${kind}&limit=${PAGE}${cursor}`;
      const page = await this._api.get(`${this._path}/constraints?${query}`);
      found.push(...page.constraints);
      if (!page.next_cursor) return found;
      cursor = `&cursor=${encodeURIComponent(page.next_cursor)}`;
    }
  }
}

/** Tell whether map and graph know the same components. @param {any} answers */
function agree({ map, graph }) {
  if (map.version === graph.graph.version) return true;
  const mapped = new Set(map.components.map((/** @type {any} */ c) => c.id));
  const known = new Set(graph.nodes.map((/** @type {any} */ node) => node.component));
  return mapped.size === known.size && [...mapped].every((id) => known.has(id));
}
