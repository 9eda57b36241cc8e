import { h } from "./dom.js";
import { facts } from "./card.js";
import { degrees, metres } from "./format.js";

/** Who would move by how much, and which components would part. @param {import("../net/contract.js").WhatIfAnswer} answer */
export function whatIfResult({ action, splits, robots }) {
  const moved = robots.filter((r) => r.moved_m > 0.005 || Math.abs(r.turned_rad) > 0.001 || r.component_before !== r.component_after);
  const parting = splits.map((ids) => h("p", {}, `Would part: ${ids.join(" | ")}`));
  const nothing = moved.length === 0 && splits.length === 0;
  return h(
    "div",
    { className: "answer" },
    h("p", {}, h("strong", {}, `If ${action === "restore" ? "restored" : "retracted"}`)),
    ...parting,
    nothing
      ? h("p", { className: "muted" }, "Nothing would move: other constraints hold the map together.")
      : facts(moved.map((r) => [r.robot, change(r)])),
  );
}

/** @param {import("../net/contract.js").WhatIfAnswer["robots"][number]} robot */
function change({ moved_m, turned_rad, component_before, component_after }) {
  if (component_before !== component_after) return `${component_before ?? "–"} → ${component_after ?? "–"}`;
  return `${metres(moved_m)}, ${degrees(turned_rad)}`;
}
