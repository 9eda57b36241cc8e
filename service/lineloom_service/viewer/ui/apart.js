import { h } from "./dom.js";
import { part } from "./card.js";
import { brief } from "../data/brief.js";

const MOST_OTHERS = 6;

/**
 * Why a component is not joined with the others yet, and what would help.
 *
 * @param {import("../data/site_state.js").Component} component
 * @param {import("./inspector.js").CardContext} context
 */
export function apart(component, { state, onPick, onGoTo, onJoin }) {
  const others = state.components.filter(({ id }) => id !== component.id);
  if (others.length === 0) return null;
  const rows = others.slice(0, MOST_OTHERS).map(({ id, robots }) => {
    const open = between(state, component.id, id);
    const who = `${brief(id)} (${robots.join(", ")})`;
    if (open.length === 0) {
      return h("li", {}, h("p", {}, `${who}: nothing of the one was recognised in the other. Drive a robot of either where one of the other has been, the same way round.`));
    }
    const [best] = open;
    return h(
      "li",
      {},
      h("p", {}, `${who}: ${open.length === 1 ? "one candidate" : `${open.length} candidates`}. ${sentence(best.reason)}. Drive on around there.`),
      h("button", {
        "data-key": `where ${id}`,
        onclick: () => {
          onPick({ kind: "constraint", id: best.id });
          onGoTo({ kind: "constraint", id: best.id });
        },
      }, "Show where"),
    );
  });
  return part(
    "Not joined",
    h("p", { className: "reason" }, "How this part of the map lies to the others is not known yet; they are drawn side by side."),
    h("ul", { className: "apart" }, ...rows),
    others.length > MOST_OTHERS && h("p", { className: "muted" }, `and ${others.length - MOST_OTHERS} more`),
    h("div", { className: "buttons" }, h("button", { onclick: () => onJoin(component.id), "data-key": "join" }, "It is the same place as …")),
  );
}

/** Open candidates between two components, those with most evidence first. @param {import("../data/site_state.js").SiteState} state @param {string} a @param {string} b */
function between(state, a, b) {
  const wanted = [a, b].sort().join();
  return [...state.constraints.values()]
    .filter((c) => {
      const ends = [c.keyframe_a, c.keyframe_b].map((k) => state.keyframes.get(k)?.component ?? "");
      return c.state === "candidate" && ends.sort().join() === wanted;
    })
    .sort((c, d) => (d.checks.evidence ?? 0) - (c.checks.evidence ?? 0));
}

/** @param {string} text */
function sentence(text) {
  return text ? text[0].toUpperCase() + text.slice(1) : "No reason given";
}
