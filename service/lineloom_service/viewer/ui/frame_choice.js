import { h } from "./dom.js";
import { FRAME_NAMES } from "../data/frames.js";

/** Chooses in whose coordinates the map is shown. */
export class FrameChoice {
  /** @param {HTMLElement} element @param {(choice: import("../data/frames.js").FrameChoice) => void} onChoose */
  constructor(element, onChoose) {
    const options = FRAME_NAMES.map(([value, words]) => h("option", { value }, words));
    this._select = h("select", { id: "frame", "data-key": "frame" }, ...options);
    this._select.addEventListener("change", () => onChoose(this._select.value));
    element.append(h("label", { className: "field" }, h("span", {}, "Coordinates"), this._select));
  }

  /** @param {import("../data/frames.js").FrameChoice} choice */
  show(choice) {
    this._select.value = choice;
  }
}
