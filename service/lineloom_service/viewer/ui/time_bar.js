import { h, refill } from "./dom.js";
import { icon } from "./icon.js";
import { count, plural, timeOfDay } from "./format.js";

const STEP_MS = 120;

/**
 * The time slider. What it shows is said beside it: a version as it was received, or the growth
 * rebuilt from today's map.
 *
 * @typedef {import("../data/history.js").Moment} Moment
 */
export class TimeBar {
  /** @param {HTMLElement} element @param {(moment: Moment|null) => void} onMoment null: now */
  constructor(element, onMoment) {
    this._onMoment = onMoment;
    /** @type {Moment[]} */
    this._moments = [];
    /** What is shown; null: now. @type {Moment|null} */
    this.chosen = null;
    this._timer = 0;
    this._play = h("button", { className: "icon-button", onclick: () => this.toggle() });
    this._slider = h("input", { type: "range", min: "0", step: "1", "aria-label": "Time" });
    this._slider.addEventListener("input", () => this._choose(Number(this._slider.value)));
    this._said = h("span", { className: "said" });
    this._live = h("button", { className: "live", onclick: () => this.goLive() }, "Live");
    element.append(h("div", { className: "time-row" }, this._play, this._slider, this._said, this._live));
    this._draw();
  }

  /** Whether the newest version is shown, and followed. */
  get isLive() {
    return this.chosen === null;
  }

  /** @param {Moment[]} moments */
  update(moments) {
    this._moments = moments;
    this._draw();
  }

  goLive() {
    this._stop();
    this.chosen = null;
    this._draw();
    this._onMoment(null);
  }

  /** Play or pause. */
  toggle() {
    if (this._timer) {
      this._stop();
      this._draw();
      return;
    }
    if (this.isLive) this._choose(0);
    this._timer = window.setInterval(() => this._step(), STEP_MS);
    this._draw();
  }

  _step() {
    const next = this._index() + 1;
    if (next >= this._moments.length - 1) this.goLive();
    else this._choose(next);
  }

  _stop() {
    window.clearInterval(this._timer);
    this._timer = 0;
  }

  /** @param {number} index */
  _choose(index) {
    const moment = this._moments[index];
    if (!moment) return;
    if (index === this._moments.length - 1) {
      this.goLive();
      return;
    }
    this.chosen = moment;
    this._draw();
    this._onMoment(moment);
  }

  _index() {
    const last = this._moments.length - 1;
    if (!this.chosen) return last;
    const chosen = this.chosen;
    const at = this._moments.findIndex((m) =>
      m.kind === "rebuilt"
        ? chosen.kind === "rebuilt" && m.known === chosen.known
        : chosen.kind === "received" && m.state === chosen.state,
    );
    return at < 0 ? last : at;
  }

  _draw() {
    const last = Math.max(this._moments.length - 1, 0);
    this._slider.max = String(last);
    this._slider.value = String(this._index());
    this._slider.disabled = last === 0;
    this._play.disabled = last === 0;
    const words = this._words();
    this._slider.setAttribute("aria-valuetext", words);
    this._said.textContent = words;
    this._said.title = words;
    this._live.setAttribute("aria-pressed", String(this.isLive));
    const playing = this._timer !== 0;
    const label = playing ? "Pause" : "Play the growth of the map";
    this._play.setAttribute("aria-label", label);
    this._play.title = label;
    refill(this._play, icon(playing ? "pause" : "play"));
  }

  _words() {
    const newest = this._moments[this._moments.length - 1];
    if (!newest) return "Nothing received yet";
    const moment = this.chosen ?? newest;
    if (moment.kind === "received") {
      const { version, receivedAt } = moment.state;
      return `Version ${count(version)}, as received ${timeOfDay(receivedAt)}`;
    }
    return `Rebuilt from today's map, ${plural(moment.known, "keyframe")} in`;
  }
}
