import { h, refill } from "./dom.js";
import { count } from "./format.js";

/** @type {Record<string, [string, string]>} connection -> [tone, words] */
const WORDS = {
  connecting: ["", "Connecting"],
  live: ["good", "Live"],
  polling: ["good", "Live (polling)"],
  away: ["bad", "Service away"],
  unauthorised: ["bad", "Token needed"],
  forbidden: ["bad", "Not allowed"],
  empty: ["", "No such site"],
  failed: ["bad", "Failed"],
};

/** Says in one glance whether what the page shows is current. */
export class StatusBadge {
  /** @param {HTMLElement} element @param {HTMLElement} trouble says why a site is not mapped */
  constructor(element, trouble) {
    this._element = element;
    this._trouble = trouble;
    this._connection = "connecting";
    /** @type {import("../net/contract.js").SiteAnswer|null} */
    this._site = null;
  }

  /** @param {string} connection @param {string} detail */
  connection(connection, detail) {
    this._connection = connection;
    this._draw(detail);
  }

  /** @param {import("../net/contract.js").SiteAnswer|null} site */
  site(site) {
    this._site = site;
    const trouble = site?.trouble ?? "";
    this._trouble.hidden = !trouble;
    if (this._trouble.textContent !== trouble) this._trouble.textContent = trouble;
    this._draw("");
  }

  /** @param {string} detail */
  _draw(detail) {
    let [tone, words] = WORDS[this._connection];
    const pending = this._site?.scans.pending ?? 0;
    const current = this._connection === "live" || this._connection === "polling";
    if (current && this._site?.trouble) [tone, words] = ["bad", "Not mapped"];
    else if (current && pending > 0) [tone, words] = ["busy", `Mapping, ${count(pending)} scans to go`];
    const version = this._site ? `version ${count(this._site.version)}` : "";
    this._element.dataset.tone = tone;
    this._element.dataset.connection = this._connection;
    this._element.title = detail;
    refill(
      this._element,
      h("span", { className: "dot", "aria-hidden": "true" }),
      h("strong", {}, words),
      h("span", { className: "detail" }, current ? version : detail),
      current ? remakingBadge(this._site?.remaking) : null,
    );
  }
}

/** Say how far the map is that will be shown instead. @param {import("../net/contract.js").RemakingAnswer|null} [made] */
function remakingBadge(made) {
  if (!made) return null;
  const share = Math.floor((100 * made.position) / Math.max(made.of, 1));
  const title = `The map is made anew, beside this one: ${count(made.position)} of ${count(made.of)} entries. Why: ${made.why}`;
  return h("span", { className: "remaking", title }, `New map ${share} %`);
}
