import { h } from "./dom.js";

const SHOWN_MS = 6000;

/** Short news at the bottom of the page, read out by screen readers. */
export class Notices {
  /** @param {HTMLElement} element */
  constructor(element) {
    this._element = element;
  }

  /** @param {string} text @param {"bad"|""} [tone] */
  say(text, tone = "") {
    const notice = h("p", { className: "notice", "data-tone": tone }, text);
    this._element.append(notice);
    while (this._element.children.length > 3) this._element.firstChild?.remove();
    setTimeout(() => notice.remove(), SHOWN_MS);
  }
}
