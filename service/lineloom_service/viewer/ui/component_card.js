import { apart } from "./apart.js";
import { h } from "./dom.js";
import { card, facts, part, swatch } from "./card.js";
import { count, metres } from "./format.js";
import { brief } from "../data/brief.js";

/**
 * A part of the map whose inner geometry is known.
 *
 * @param {import("../data/site_state.js").Component} component
 * @param {import("./inspector.js").CardContext} context
 */
export function componentCard(component, context) {
  const { state, palette, onClose, onPick, onGoTo } = context;
  const lines = state.lines.answers.filter((line) => line.component === component.id);
  const wall = lines.reduce((sum, l) => sum + Math.hypot(l.x2 - l.x1, l.y2 - l.y1), 0);
  const absorbed = Object.keys(state.site.merged_into).filter((id) => state.survivorOf(id) === component.id);
  const robots = component.robots.map((name) =>
    h(
      "li",
      {},
      h(
        "button",
        { onclick: () => onPick({ kind: "robot", id: name }), "data-key": `member ${name}` },
        swatch(palette.robot(state.robotNames.indexOf(name))),
        h("span", { className: "name" }, name),
      ),
    ),
  );
  return card(
    `Component ${brief(component.id)}`,
    null,
    onClose,
    facts([
      ["Id", component.id],
      ["Walls", `${count(lines.length)}, ${metres(wall)} in all`],
      ["Keyframes", count(component.keyframes)],
      ["Extent", `${component.bounds.width.toFixed(1)} × ${component.bounds.height.toFixed(1)} m`],
      ["Has absorbed", absorbed.map(brief).join(", ") || null],
    ]),
    apart(component, context),
    part("Robots", h("ul", { className: "rows" }, ...robots)),
    h(
      "div",
      { className: "buttons" },
      h("button", { onclick: () => onGoTo({ kind: "component", id: component.id }), "data-key": "go" }, "Show"),
    ),
  );
}
