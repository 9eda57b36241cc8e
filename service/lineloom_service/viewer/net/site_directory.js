import { ProblemError } from "./api.js";

const POLL_MS = 5000;
/** While there is no site to show. */
const EAGER_POLL_MS = 1000;

/** The list of sites, asked for now and then: a first scan may create one at any time. */
export class SiteDirectory {
  /** @param {import("./api.js").Api} api @param {(sites: string[]) => void} onSites */
  constructor(api, onSites) {
    this._api = api;
    this._onSites = onSites;
    this._timer = 0;
    /** @type {string[]} */
    this.sites = [];
  }

  /** Ask now, and again from time to time. @returns {Promise<"known"|"unauthorised"|"away">} */
  async follow() {
    window.clearTimeout(this._timer);
    const wait = this.sites.length === 0 ? EAGER_POLL_MS : POLL_MS;
    this._timer = window.setTimeout(() => void this.follow(), wait);
    if (document.hidden) return "known";
    try {
      const answer = await this._api.get("v1/sites");
      this.sites = answer.sites.map((/** @type {{site: string}} */ entry) => entry.site).sort();
    } catch (error) {
      // A token for one site may not list them all: the one in the address still opens.
      return error instanceof ProblemError && error.status === 401 ? "unauthorised" : "away";
    }
    this._onSites(this.sites);
    return "known";
  }
}
