import { h } from "./dom.js";
import { icon } from "./icon.js";

/**
 * @typedef {{name: string, icon: string, words: string, run: () => void, toggles?: boolean}} Tool
 */

/** The buttons over the map. */
export class Toolbar {
  /** @param {HTMLElement} element @param {Tool[]} tools */
  constructor(element, tools) {
    /** @type {Map<string, HTMLElement>} */
    this._buttons = new Map(tools.map((tool) => [tool.name, button(tool)]));
    element.append(...this._buttons.values());
  }

  /** @param {string} name @param {boolean} on */
  press(name, on) {
    this._buttons.get(name)?.setAttribute("aria-pressed", String(on));
  }
}

/** @param {Tool} tool */
function button(tool) {
  return h(
    "button",
    {
      className: "icon-button",
      title: tool.words,
      "aria-label": tool.words,
      "aria-pressed": tool.toggles ? "false" : null,
      onclick: tool.run,
    },
    icon(tool.icon),
  );
}
