import { h, refill } from "./dom.js";
import { count, plural } from "./format.js";
import { swatch } from "./card.js";
import { brief } from "../data/brief.js";

/**
 * Components and the robots in them.
 *
 * @typedef {import("../draw/highlight_marks.js").Thing} Thing
 */
export class FleetList {
  /** @param {HTMLElement} element @param {(thing: Thing) => void} onPick */
  constructor(element, onPick) {
    this._element = element;
    this._onPick = onPick;
  }

  /** @param {import("../data/site_state.js").SiteState|null} state @param {import("../draw/palette.js").Palette} palette @param {Thing|null} selected */
  show(state, palette, selected) {
    if (!state || (state.components.length === 0 && state.robots.length === 0)) {
      refill(this._element, h("p", { className: "muted" }, "No robot yet."));
      return;
    }
    const groups = state.components.map((component) => {
      const robots = state.robots.filter((robot) => robot.component === component.id);
      const away = component.robots.filter((name) => !robots.some((r) => r.robot === name));
      return h(
        "div",
        { className: "group" },
        this._row({ kind: "component", id: component.id }, selected, [
          h("span", { className: "group-title", title: component.id }, brief(component.id)),
          h("span", { className: "end" }, plural(component.keyframes, "keyframe")),
        ]),
        h(
          "ul",
          { className: "rows" },
          ...robots.map((robot) => h("li", {}, this._robot(robot, state, palette, selected))),
          ...(away.length > 0 && robots.length === 0 ? [h("li", { className: "muted" }, `earlier: ${away.join(", ")}`)] : []),
        ),
      );
    });
    const unplaced = state.robots.filter((robot) => !state.component(robot.component ?? ""));
    const rest = unplaced.length > 0 && h("ul", { className: "rows" }, ...unplaced.map((robot) => h("li", {}, this._robot(robot, state, palette, selected))));
    refill(this._element, h("div", { className: "rows-of-components" }, ...groups), rest);
  }

  /** @param {import("../net/contract.js").RobotAnswer} robot @param {import("../data/site_state.js").SiteState} state @param {import("../draw/palette.js").Palette} palette @param {Thing|null} selected */
  _robot(robot, state, palette, selected) {
    const words = robot.state === "tracking" ? count(robot.scans.processed) : robot.state;
    return this._row({ kind: "robot", id: robot.robot }, selected, [
      swatch(palette.robot(state.robotNames.indexOf(robot.robot))),
      h("span", { className: "name" }, robot.robot),
      ...(robot.health.length > 0 ? [findings(robot.health)] : []),
      h("span", { className: "end", title: robot.state === "tracking" ? "scans in the map" : "" }, words),
    ]);
  }

  /** @param {Thing} thing @param {Thing|null} selected @param {Node[]} content */
  _row(thing, selected, content) {
    const current = selected?.kind === thing.kind && selected.id === thing.id;
    return h(
      "button",
      {
        className: "row-button",
        "data-key": `${thing.kind} ${thing.id}`,
        "aria-current": String(current),
        onclick: () => this._onPick(thing),
      },
      ...content,
    );
  }
}

/** Return a mark that something is wrong with a robot; its card says what. @param {string[]} health */
function findings(health) {
  return h("span", { className: "findings", title: health.join("\n") }, plural(health.length, "finding"));
}
