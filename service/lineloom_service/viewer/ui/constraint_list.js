import { h, refill } from "./dom.js";
import { LayerSwitches } from "./layer_switches.js";
import { CONSTRAINT_NAMES } from "../draw/layers.js";
import { brief } from "../data/brief.js";

const MOST_ROWS = 60;

/**
 * Constraints by state: switches for showing them on the map, and a list of those shown that hold
 * the map together, rendezvous first.
 */
export class ConstraintList {
  /** @param {HTMLElement} element @param {(thing: import("../draw/highlight_marks.js").Thing) => void} onPick @param {(name: string, on: boolean) => void} onSwitch */
  constructor(element, onPick, onSwitch) {
    this._onPick = onPick;
    const switches = h("div");
    this._list = h("div");
    this._switches = new LayerSwitches(switches, CONSTRAINT_NAMES, onSwitch);
    element.append(switches, this._list);
  }

  /** @param {import("../data/site_state.js").SiteState|null} state @param {Record<string, boolean>} layers @param {import("../draw/highlight_marks.js").Thing|null} selected */
  show(state, layers, selected) {
    const all = state ? [...state.constraints.values()] : [];
    /** @type {Record<string, number>} */
    const counts = { accepted: 0, candidate: 0, rejected: 0, retracted: 0 };
    for (const constraint of all) counts[constraint.state] += 1;
    this._switches.show(layers, counts);
    const shown = all.filter((c) => layers[c.state]).sort((a, b) => rank(a) - rank(b));
    const rows = shown.slice(0, MOST_ROWS).map((c) => h("li", {}, this._row(c, selected)));
    const more = shown.length - rows.length;
    refill(
      this._list,
      rows.length > 0 && h("ul", { className: "rows" }, ...rows),
      more > 0 && h("p", { className: "muted" }, `and ${more} more: choose them on the map`),
    );
  }

  /** @param {import("../net/contract.js").ConstraintAnswer} constraint @param {import("../draw/highlight_marks.js").Thing|null} selected */
  _row(constraint, selected) {
    const { id, kind, state, robot_a, robot_b } = constraint;
    const robots = robot_a === robot_b ? robot_a : `${robot_a} – ${robot_b}`;
    return h(
      "button",
      {
        "data-key": `constraint ${id}`,
        "aria-current": String(selected?.kind === "constraint" && selected.id === id),
        onclick: () => this._onPick({ kind: "constraint", id }),
      },
      h("span", { className: "mark", "data-state": state, "aria-hidden": "true" }),
      h("span", { className: "name" }, robots ?? brief(id), h("span", { className: "hidden-text" }, `, ${state}`)),
      h("span", { className: "end" }, kind === "rendezvous" ? brief(id) : kind),
    );
  }
}

/** Rendezvous before loops, the doubtful before the sure. @param {import("../net/contract.js").ConstraintAnswer} constraint */
function rank({ kind, state }) {
  const doubt = ["candidate", "retracted", "accepted", "rejected"].indexOf(state);
  return (kind === "loop" ? 10 : 0) + doubt;
}
