import { h } from "./dom.js";
import { facts } from "./card.js";
import { degrees, metres } from "./format.js";
import { brief } from "../data/brief.js";

/**
 * Who would move by how much, and which components would part or join.
 *
 * @param {import("../net/contract.js").WhatIfAnswer} answer
 */
export function whatIfResult({ action, components_before, components_after, robots }) {
  const before = components_before.map(words).join(" | ");
  const after = components_after.map(words).join(" | ");
  const moved = robots.filter(moves);
  const nothing = moved.length === 0 && before === after;
  return h(
    "div",
    { className: "answer" },
    h("p", {}, h("strong", {}, `If ${action === "restore" ? "restored" : "retracted"}`)),
    before !== after && facts([["Now", before], ["Then", after]]),
    moved.length > 0 && facts(moved.map((robot) => [robot.robot, change(robot)])),
    nothing && h("p", { className: "muted" }, "Nothing would move: other constraints hold the map together."),
  );
}

/** @param {import("../net/contract.js").ComponentRobots} component */
function words({ id, robots }) {
  return `${brief(id)} (${robots.join(", ")})`;
}

/** @param {import("../net/contract.js").WhatIfAnswer["robots"][number]} robot */
function moves({ moved_m, turned_rad, component_before, component_after }) {
  if (component_before !== component_after) return true;
  return (moved_m ?? 0) > 0.005 || Math.abs(turned_rad ?? 0) > 0.001;
}

/** @param {import("../net/contract.js").WhatIfAnswer["robots"][number]} robot */
function change({ moved_m, turned_rad, component_before, component_after }) {
  if (component_before !== component_after) return `${brief(component_before ?? "–")} → ${brief(component_after ?? "–")}`;
  return `${metres(moved_m ?? 0)}, ${degrees(turned_rad ?? 0)}`;
}
