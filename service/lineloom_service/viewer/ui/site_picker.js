import { h, refill } from "./dom.js";

/** Chooses the site. */
export class SitePicker {
  /** @param {HTMLElement} element @param {(site: string) => void} onPick */
  constructor(element, onPick) {
    this._element = element;
    this._onPick = onPick;
    this._shown = "";
  }

  /** @param {string[]} sites @param {string} current */
  show(sites, current) {
    const names = current && !sites.includes(current) ? [...sites, current] : sites;
    const key = JSON.stringify([names, current]);
    if (key === this._shown) return;
    this._shown = key;
    if (names.length === 0) {
      refill(this._element);
      return;
    }
    const options = names.map((name) => h("option", { value: name, selected: name === current }, name));
    const select = h("select", { "aria-label": "Site", "data-key": "site" }, ...options);
    select.addEventListener("change", () => this._onPick(select.value));
    refill(this._element, select);
  }
}
