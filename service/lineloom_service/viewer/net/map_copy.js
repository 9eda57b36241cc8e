import { LineSet } from "../data/line_set.js";
import { TableChange } from "../data/table_change.js";

/** Lines from which only changes are asked for: below, the whole map costs as little. */
const LARGE = 2000;

/**
 * @typedef {import("./contract.js").MapAnswer} MapAnswer
 * @typedef {import("./contract.js").LineAnswer} LineAnswer
 * @typedef {{map: MapAnswer, change: TableChange<LineAnswer>|null}} News
 * change: of the lines of before; without one the map is whole.
 */

/** The map as it was received last. Of a large one only what has changed since is fetched. */
export class MapCopy {
  /** @param {import("./api.js").Api} api @param {string} path of the map */
  constructor(api, path) {
    this._api = api;
    this._path = path;
    this._version = -1;
    this._settled = false;
    /** @type {LineSet|null} */
    this._lines = null;
    /** @type {Map<string, LineAnswer>} */
    this._byId = new Map();
  }

  /** Forget the copy: the site may be another one of the same name. */
  forget() {
    this._lines = null;
  }

  /** Return what there is to know of the map as it is now. @returns {Promise<News>} */
  async news() {
    if (!this._lines || this._lines.length < LARGE) {
      return { map: await this._api.get(this._path), change: null };
    }
    const since = `since=${this._version}&since_settled=${this._settled}`;
    const answer = await this._api.open(`${this._path}?${since}`);
    const map = await answer.json();
    return { map, change: map.full === false ? new TableChange(map.lines, map.removed) : null };
  }

  /**
   * Take news in, and return the map with all its lines.
   *
   * @param {News} news @param {string[]} robots the site's robots, in the order of their colours
   * @returns {{map: MapAnswer, lines: LineSet}}
   */
  take({ map, change }, robots) {
    if (change && this._lines) {
      this._lines = this._lines.updated(change, change.apply(this._byId), robots);
    } else {
      this._lines = LineSet.of(map.lines, robots);
      this._byId = new Map(map.lines.map((line) => [line.id, line]));
    }
    this._version = map.version;
    this._settled = map.settled;
    return { map: { ...map, lines: this._lines.answers }, lines: this._lines };
  }
}
