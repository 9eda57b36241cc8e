import { h, refill } from "./dom.js";

/** What stands in the map's place while there is none. */
export class BlankPage {
  /** @param {HTMLElement} element */
  constructor(element) {
    this._element = element;
    this._shown = "";
  }

  hide() {
    this._element.hidden = true;
    this._shown = "";
  }

  /** No site, or one without scans: tell how to send the first. @param {string} site */
  firstScan(site) {
    const name = site || "floor-2";
    const url = new URL(`v1/sites/${name}/robots/r1/scans`, document.baseURI);
    const command = [
      `curl ${url} \\`,
      "  -H 'Content-Type: application/json' -d '{",
      '  "seq": 0, "stamp": 0.0,',
      '  "angle_min": -0.6, "angle_increment": 0.1,',
      '  "range_min": 0.1, "range_max": 30.0,',
      '  "ranges": [2.42, 2.29, 2.17, 2.10, 2.05, 2.01, 2.0,',
      '             2.01, 2.05, 2.10, null, "inf", 2.42]',
      "}'",
    ].join("\n");
    this._show(`first ${site}`, [
      h("h2", {}, site ? `Nothing in ${site} yet` : "No site yet"),
      h("p", {}, "A site, one floor of one building, comes into being with its first scan. Send one, and it is drawn here:"),
      h("pre", { tabIndex: 0, role: "region", "aria-label": "Command" }, command),
      h("p", { className: "muted" }, "Or let simulated robots drive: ", h("code", {}, "lineloom demo --stay"), ". Every call is described in ", h("a", { href: "docs" }, "the API's documentation"), "."),
    ]);
  }

  /** @param {string} title @param {string} text */
  message(title, text) {
    this._show(`${title} ${text}`, [h("h2", {}, title), h("p", { className: "muted" }, text)]);
  }

  /** @param {string} key @param {Node[]} content */
  _show(key, content) {
    this._element.hidden = false;
    if (key === this._shown) return;
    this._shown = key;
    refill(this._element, h("div", { className: "blank-box" }, ...content));
  }
}
