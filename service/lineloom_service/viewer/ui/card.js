import { h } from "./dom.js";
import { icon } from "./icon.js";

/** Return a card of the inspector. @param {string} title @param {Node|null} tag @param {() => void} onClose @param {...(Node|string|null|undefined|false)} children */
export function card(title, tag, onClose, ...children) {
  return h(
    "div",
    { className: "card" },
    h(
      "div",
      { className: "card-head" },
      h("div", {}, h("h2", { tabIndex: -1, "data-key": "title" }, title), tag),
      h(
        "button",
        { className: "icon-button", "aria-label": "Close details", title: "Close (Esc)", onclick: onClose, "data-key": "close" },
        icon("close"),
      ),
    ),
    ...children,
  );
}

/** Return facts by name. @param {[string, string|Node|null|undefined][]} entries */
export function facts(entries) {
  const shown = entries.filter(([, value]) => value !== null && value !== undefined && value !== "");
  return h("dl", { className: "facts" }, ...shown.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}

/** Return a part of a card under a heading. @param {string} title @param {...(Node|string|null|undefined|false)} children */
export function part(title, ...children) {
  return h("section", {}, h("h3", {}, title), ...children);
}

/** @param {string} state */
export function tag(state) {
  return h("span", { className: "tag", "data-state": state }, state);
}

/** Return a coloured square. @param {string} colour */
export function swatch(colour) {
  const square = h("span", { className: "swatch", "aria-hidden": "true" });
  square.style.background = colour;
  return square;
}
