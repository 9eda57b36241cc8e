import { h, refill } from "./dom.js";

/** Switches for what is shown. */
export class LayerSwitches {
  /**
   * @param {HTMLElement} element
   * @param {[string, string][]} names
   * @param {(name: string, on: boolean) => void} onSwitch
   */
  constructor(element, names, onSwitch) {
    this._element = element;
    this._names = names;
    this._onSwitch = onSwitch;
    this._shown = "";
  }

  /** @param {Record<string, boolean>} layers @param {Record<string, number>} [counts] */
  show(layers, counts = {}) {
    const key = JSON.stringify([layers, counts]);
    if (key === this._shown) return;
    this._shown = key;
    refill(this._element, ...this._names.map(([name, words]) => this._switch(name, words, layers[name], counts[name])));
  }

  /** @param {string} name @param {string} words @param {boolean} on @param {number|undefined} number */
  _switch(name, words, on, number) {
    const box = h("input", { type: "checkbox", checked: on, "data-key": `layer ${name}` });
    box.addEventListener("change", () => this._onSwitch(name, box.checked));
    return h(
      "label",
      { className: "switch" },
      box,
      number !== undefined && h("span", { className: "mark", "data-state": name, "aria-hidden": "true" }),
      h("span", {}, words),
      number !== undefined && h("span", { className: "end" }, String(number)),
    );
  }
}
