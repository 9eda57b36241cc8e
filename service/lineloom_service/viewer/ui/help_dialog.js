import { h, refill } from "./dom.js";
import { KEYS } from "../tools/shortcuts.js";

/** Lists the keys. */
export class HelpDialog {
  constructor() {
    this._dialog = h("dialog", { "aria-labelledby": "help-title" });
    document.body.append(this._dialog);
  }

  open() {
    if (this._dialog.open) return;
    const rows = KEYS.flatMap(({ keys, words }) => [
      h("dt", {}, ...keys.flatMap((key, i) => [i > 0 ? " " : "", h("kbd", {}, key)])),
      h("dd", {}, words),
    ]);
    refill(
      this._dialog,
      h(
        "form",
        { method: "dialog" },
        h("h2", { id: "help-title" }, "Keys"),
        h("dl", { className: "keys" }, ...rows),
        h("p", { className: "muted" }, "On the map: drag to move, wheel or pinch to zoom, click a wall, a robot or a constraint for what is known of it. Drop a scan as a JSON file to find where it was taken."),
        h("div", { className: "buttons" }, h("button", { className: "primary", autofocus: true }, "Close")),
      ),
    );
    this._dialog.showModal();
  }
}
