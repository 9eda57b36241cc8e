import { LineSet } from "../data/line_set.js";

/** Lines from which only changes are asked for: below, the whole map costs as little. */
const LARGE = 2000;

/**
 * @typedef {import("./contract.js").MapAnswer} MapAnswer
 * @typedef {import("./contract.js").LineAnswer} LineAnswer
 * @typedef {{map: MapAnswer, changed: LineAnswer[], removed: string[]}|{map: MapAnswer}} News
 * changed, removed: beside the map of before; without them the map is whole.
 */

/** The map as it was received last. Of a large one only what has changed since is fetched. */
export class MapCopy {
  /** @param {import("./api.js").Api} api @param {string} path of the map */
  constructor(api, path) {
    this._api = api;
    this._path = path;
    this._version = -1;
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
    if (!this._lines || this._lines.length < LARGE) return { map: await this._api.get(this._path) };
    const answer = await this._api.open(`${this._path}?since=${this._version}`);
    const now = await answer.json();
    return now.full === false ? { map: now, changed: now.lines, removed: now.removed } : { map: now };
  }

  /**
   * Take news in, and return the map with all its lines.
   *
   * @param {News} news @param {string[]} robots the site's robots, in the order of their colours
   * @returns {{map: MapAnswer, lines: LineSet}}
   */
  take(news, robots) {
    if ("changed" in news && this._lines) {
      this._lines = this._lines.updated(news.changed, this._note(news.changed, news.removed), robots);
    } else {
      this._lines = LineSet.of(news.map.lines, robots);
      this._byId = new Map(news.map.lines.map((line) => [line.id, line]));
    }
    this._version = news.map.version;
    return { map: { ...news.map, lines: this._lines.answers }, lines: this._lines };
  }

  /** Keep `_byId` current; return what was there of these lines. @param {LineAnswer[]} changed @param {string[]} removed */
  _note(changed, removed) {
    /** @type {Map<string, LineAnswer>} */
    const out = new Map();
    for (const id of [...removed, ...changed.map((line) => line.id)]) {
      const line = this._byId.get(id);
      if (line) out.set(id, line);
    }
    for (const id of removed) this._byId.delete(id);
    for (const line of changed) this._byId.set(line.id, line);
    return out;
  }
}
