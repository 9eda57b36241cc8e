import { ConstraintList } from "./constraint_list.js";
import { byId, h, refill } from "./dom.js";
import { FleetList } from "./fleet_list.js";
import { FrameChoice } from "./frame_choice.js";
import { HelpDialog } from "./help_dialog.js";
import { icon } from "./icon.js";
import { LayerSwitches } from "./layer_switches.js";
import { LAYER_NAMES } from "../draw/layers.js";

/**
 * The panel on the left (a sheet from below on phones) and the buttons of the bar.
 *
 * @typedef {import("../draw/highlight_marks.js").Thing} Thing
 */
export class SidePanel {
  /**
   * @param {{onPick: (thing: Thing) => void, onLayer: (name: string, on: boolean) => void,
   *   onFrame: (choice: import("../data/frames.js").FrameChoice) => void,
   *   onDownload: (path: string, name: string) => void}} handlers
   */
  constructor({ onPick, onLayer, onFrame, onDownload }) {
    this._fleet = new FleetList(byId("fleet"), onPick);
    this._constraints = new ConstraintList(byId("constraints"), onPick, onLayer);
    this._layers = new LayerSwitches(byId("layers"), LAYER_NAMES, onLayer);
    this.frames = new FrameChoice(byId("frames"), onFrame);
    this._help = new HelpDialog();
    this._onDownload = onDownload;
    this._prepareToggle();
    const help = byId("help-open");
    dress(help, "help", "Keys and help (?)");
    help.addEventListener("click", () => this.help());
  }

  /** Offer the map in every format that the service writes. @param {import("../net/contract.js").MapFormats} formats */
  exports(formats) {
    const buttons = Object.entries(formats).map(([format, { title, suffix }]) =>
      h("button", { onclick: () => this._onDownload(`map?format=${format}`, `map.${suffix}`) }, title),
    );
    refill(byId("exports"), h("div", { className: "buttons" }, ...buttons));
  }

  help() {
    this._help.open();
  }

  /** @param {import("../data/site_state.js").SiteState|null} state @param {import("../draw/palette.js").Palette} palette @param {import("../draw/layers.js").LayerChoice} layers @param {Thing|null} selected */
  show(state, palette, layers, selected) {
    this._fleet.show(state, palette, selected);
    this._constraints.show(state, layers, selected);
    this._layers.show(layers);
  }

  /** @param {"light"|"dark"} theme */
  theme(theme) {
    const dark = theme === "dark";
    dress(byId("theme-toggle"), dark ? "sun" : "moon", `${dark ? "Light" : "Dark"} colours (T)`);
  }

  _prepareToggle() {
    const [toggle, side] = [byId("panel-toggle"), byId("side")];
    dress(toggle, "panel", "Fleet, constraints, layers");
    toggle.addEventListener("click", () => {
      toggle.setAttribute("aria-expanded", String(side.classList.toggle("open")));
    });
    byId("map").addEventListener("pointerdown", () => {
      side.classList.remove("open");
      toggle.setAttribute("aria-expanded", "false");
    });
  }
}

/** @param {HTMLElement} button @param {string} name @param {string} words */
function dress(button, name, words) {
  button.title = words;
  button.setAttribute("aria-label", words);
  refill(button, icon(name));
}
