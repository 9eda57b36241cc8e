import { h } from "./dom.js";
import { card, facts, part, swatch } from "./card.js";
import { metres, plural, stamp } from "./format.js";
import { brief } from "../data/brief.js";

/**
 * Who saw a wall, and when.
 *
 * @param {import("../net/contract.js").LineAnswer} line
 * @param {import("./inspector.js").CardContext} context
 */
export function lineCard(line, { state, palette, onClose, onPick }) {
  const length = Math.hypot(line.x2 - line.x1, line.y2 - line.y1);
  const robots = line.robots.map((name) =>
    h(
      "li",
      {},
      h(
        "button",
        { onclick: () => onPick({ kind: "robot", id: name }), "data-key": `seen by ${name}` },
        swatch(palette.robot(state.robotNames.indexOf(name))),
        h("span", { className: "name" }, name),
      ),
    ),
  );
  const clocks = line.robots.length > 1 ? "Each time is on the clock of the robot that saw it." : null;
  return card(
    `Wall ${line.id}`,
    null,
    onClose,
    facts([
      ["Length", metres(length)],
      ["Shape known to", `± ${metres(line.sigma)}`],
      ["Component", brief(line.component)],
      ["From", `${line.x1.toFixed(2)}, ${line.y1.toFixed(2)}`],
      ["To", `${line.x2.toFixed(2)}, ${line.y2.toFixed(2)}`],
    ]),
    part(
      "Seen by",
      h("ul", { className: "rows" }, ...robots),
      h("p", { className: "muted" }, `in ${plural(line.support, "keyframe")}`),
    ),
    part(
      "When",
      facts([
        ["First", stamp(line.first_seen)],
        ["Last", stamp(line.last_seen)],
      ]),
      clocks && h("p", { className: "muted" }, clocks),
    ),
  );
}
