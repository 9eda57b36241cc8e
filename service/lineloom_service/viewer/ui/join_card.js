import { card, facts, part } from "./card.js";
import { checkTable } from "./check_table.js";
import { h } from "./dom.js";
import { evidenceDrawing } from "./evidence_drawing.js";
import { degrees, metres } from "./format.js";
import { brief } from "../data/brief.js";

/**
 * What laying one component on another would come to, and whether to believe it.
 *
 * @param {import("../tools/joiner.js").Joiner} joiner @param {() => void} onClose @param {() => void} onConfirm
 */
export function joinCard(joiner, onClose, onConfirm) {
  const { component, said, trial, busy, problem } = joiner;
  const title = said ? `${brief(said.component_b)} on ${brief(said.component_a)}` : "The same place";
  return card(
    title,
    null,
    onClose,
    h("p", { className: "muted" }, "Drag one part of the map onto the other, roughly as it lies: the scans find the rest."),
    busy && h("p", { className: "busy", role: "status" }, `${busy} …`, h("button", { onclick: () => joiner.cancel(), "data-key": "cancel" }, "Cancel")),
    problem && h("p", { className: "health", role: "alert" }, problem),
    trial && verdict(trial),
    component &&
      h(
        "div",
        { className: "buttons" },
        trial && h("button", { className: "primary", onclick: onConfirm, disabled: busy !== "", "data-key": "confirm" }, "Confirm"),
        h("button", { onclick: () => joiner.turn(1), "data-key": "left", "aria-label": "Turn left by 15 degrees" }, "↺ 15°"),
        h("button", { onclick: () => joiner.turn(-1), "data-key": "right", "aria-label": "Turn right by 15 degrees" }, "↻ 15°"),
        h("button", { onclick: () => void joiner.drop(true), "data-key": "find" }, "Find it"),
      ),
    trial && evidenceDrawing(trial.matched, trial.conflicts),
    trial && part("Checks", checkTable(trial.checks, trial.limits)),
    trial && part("Between", facts([["b seen from a", `${metres(trial.T_a_b.x)}, ${metres(trial.T_a_b.y)}, ${degrees(trial.T_a_b.theta)}`]])),
  );
}

/** @param {import("../net/contract.js").JoinTrialAnswer} trial */
function verdict({ objections, fits }) {
  const against = fits ? objections : ["The scans have too little in common there to measure it", ...objections];
  if (against.length === 0) return h("p", { className: "reason", "data-state": "accepted" }, "The scans agree.");
  const rows = against.map((text) => h("li", {}, text[0].toUpperCase() + text.slice(1)));
  return h("div", { className: "reason", "data-state": "rejected" }, h("p", {}, "What speaks against it:"), h("ul", {}, ...rows));
}
