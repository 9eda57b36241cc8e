/** Lines from which only changes are asked for: below, the whole map costs as little. */
const LARGE = 2000;

/**
 * The map as it was received last. Of a large one only what has changed since is fetched.
 *
 * @typedef {import("./contract.js").MapAnswer} MapAnswer
 */
export class MapCopy {
  /** @param {import("./api.js").Api} api @param {string} path of the map */
  constructor(api, path) {
    this._api = api;
    this._path = path;
    /** @type {MapAnswer|null} */
    this._map = null;
  }

  /** Forget the copy: the site may be another one of the same name. */
  forget() {
    this._map = null;
  }

  /** Return the map as it is now. @returns {Promise<MapAnswer>} */
  async current() {
    const before = this._map;
    if (!before || before.lines.length < LARGE) {
      this._map = await this._api.get(this._path);
    } else {
      const answer = await this._api.open(`${this._path}?since=${before.version}`);
      const now = await answer.json();
      this._map = now.full === false ? changed(before, now) : now;
    }
    return /** @type {MapAnswer} */ (this._map);
  }
}

/** @param {MapAnswer} before @param {MapAnswer & {removed: string[]}} now @returns {MapAnswer} */
function changed(before, now) {
  const lines = new Map(before.lines.map((line) => [line.id, line]));
  for (const id of now.removed) lines.delete(id);
  for (const line of now.lines) lines.set(line.id, line);
  return { ...now, lines: [...lines.values()] };
}
