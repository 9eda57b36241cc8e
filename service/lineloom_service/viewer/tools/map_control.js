import { byId } from "../ui/dom.js";
import { showScale } from "../ui/scale_bar.js";
import { Toolbar } from "../ui/toolbar.js";
import { Gestures } from "./gestures.js";
import { Measure, words } from "./measure.js";
import { pick } from "./picker.js";
import { listen } from "./shortcuts.js";
import { snapped } from "./snap.js";

/** How far beside a thing a mouse or a finger may be [px]. */
const REACH_PX = { mouse: 7, touch: 18 };
const SNAP_PX = 10;

/**
 * Everything that is done to the map by hand: moving, choosing, measuring, dropping scans.
 *
 * @typedef {import("../draw/highlight_marks.js").Thing} Thing
 */
export class MapControl {
  /** @param {import("../app.js").App} app */
  constructor(app) {
    this._app = app;
    this._view = app.view;
    this._measure = new Measure();
    this._trailOf = "";
    this._holding = false;
    this._reach = window.matchMedia("(pointer: coarse)").matches ? REACH_PX.touch : REACH_PX.mouse;
    const { canvas } = this._view;
    this._view.marks = [
      { draw: (context, camera, scene) => app.frames.marks.draw(context, camera, scene) },
      { draw: (context, camera, scene) => app.localizer.draw(context, camera, scene) },
      { draw: (context, camera, { palette }) => this._measure.draw(context, camera, palette) },
    ];
    this._view.onFrame = () => this._afterFrame();
    this._toolbar = new Toolbar(byId("tools"), [
      { name: "fit", icon: "fit", words: "Show all (F)", run: () => this.fit() },
      { name: "plus", icon: "plus", words: "Zoom in (+)", run: () => this._zoomMiddle(1.4) },
      { name: "minus", icon: "minus", words: "Zoom out (−)", run: () => this._zoomMiddle(1 / 1.4) },
      { name: "measure", icon: "ruler", words: "Measure a distance (M)", run: () => this._toggleMeasure(), toggles: true },
      { name: "join", icon: "join", words: "Lay one part of the map on another (J)", run: () => this.toggleJoin(), toggles: true },
      { name: "localize", icon: "locate", words: "Localise a scan from a file (L)", run: () => byId("scan-file").click() },
    ]);
    new Gestures(canvas, {
      onPan: (dx, dy) => this._pan(dx, dy),
      onZoom: (factor, x, y) => this._zoom(factor, x, y),
      onTap: (x, y) => this._tap(this._view.camera.toWorld(x, y)),
      onMove: (x, y) => this._hover(this._view.camera.toWorld(x, y)),
      onLeave: () => this._leave(),
      onGrab: (x, y) => this._grab(this._view.camera.toWorld(x, y)),
      onRelease: () => this._release(),
    });
    this._listenToKeys(canvas);
    this._takeFiles();
    new ResizeObserver(() => this._clearToolbar()).observe(byId("tools"));
    this._clearToolbar();
    this._view.covered = covered;
    new ResizeObserver(() => this._clearSheet()).observe(byId("inspector"));
  }

  /** Keep what was chosen clear of the sheet that tells of it. */
  _clearSheet() {
    const { selected } = this._view;
    if (selected) this._view.bringIntoView(selected);
    else if (this._view.following) this._view.fit();
  }

  /** Keep the map clear of the toolbar: a column on the right, a row on top of phones. */
  _clearToolbar() {
    const { offsetWidth, offsetHeight } = byId("tools");
    const row = offsetWidth > offsetHeight;
    const { insets } = this._view;
    insets.top = row ? offsetHeight + 44 : 40;
    insets.right = row ? 24 : offsetWidth + 36;
    insets.left = row ? 24 : 40;
    if (this._view.following) this._view.fit();
  }

  fit() {
    this._view.following = true;
    this._view.fit();
    this._keepView();
  }

  /** Look where the reader looked before a reload. */
  restoreView() {
    const kept = this._app.preferences.get(`view ${this._app.site}`);
    if (!kept) return;
    Object.assign(this._view.camera, kept);
    this._view.following = false;
  }

  /** Fetch and show a chosen robot's way in full. @param {Thing|null} thing @param {import("../data/site_state.js").SiteState|null} state */
  showTrail(thing, state) {
    const key = thing?.kind === "robot" && state ? `${thing.id} ${state.version}` : "";
    if (key === this._trailOf) return;
    this._trailOf = key;
    if (!key || !thing) {
      this._view.trail = [];
      return;
    }
    const path = `v1/sites/${encodeURIComponent(this._app.site)}/robots/${encodeURIComponent(thing.id)}/trajectory`;
    this._app.api.get(path).then(
      ({ poses }) => {
        if (this._trailOf !== key) return;
        this._view.trail = pieces(poses);
        this._view.draw();
      },
      () => {}, // the map without it is still right
    );
  }

  /** @param {number} dx @param {number} dy */
  _pan(dx, dy) {
    if (this._holding) {
      this._app.joiner.move(dx / this._view.camera.scale, -dy / this._view.camera.scale);
      return;
    }
    this._view.following = false;
    this._view.camera.pan(dx, dy);
    this._keepView();
    this._view.draw();
  }

  /** Where maps are laid on each other, a drag takes one along. @param {{x: number, y: number}} point page [m] */
  _grab(point) {
    this._holding = this._app.joiner.active && this._app.joiner.grab(point);
    if (this._holding) this._view.following = false;
  }

  _release() {
    if (this._holding) void this._app.joiner.drop();
    this._holding = false;
  }

  /** @param {number} factor @param {number} x @param {number} y */
  _zoom(factor, x, y) {
    this._view.following = false;
    this._view.camera.zoom(factor, x, y);
    this._keepView();
    this._view.draw();
  }

  /** @param {number} factor */
  _zoomMiddle(factor) {
    const { width, height } = this._view.camera;
    this._zoom(factor, width / 2, height / 2);
  }

  _keepView() {
    const { x, y, scale } = this._view.camera;
    const { following } = this._view;
    this._app.preferences.set(`view ${this._app.site}`, following ? null : { x, y, scale });
  }

  /** @param {{x: number, y: number}} point page [m] */
  _tap(point) {
    const { scene, camera } = this._view;
    if (!scene) return;
    if (this._measure.active) {
      this._measure.add(scene, snapped(scene, point, SNAP_PX / camera.scale));
      this._view.draw();
      return;
    }
    if (this._app.joiner.active) return;
    this._app.pick(pick(scene, point, this._reach / camera.scale));
  }

  /** @param {{x: number, y: number}} point page [m] */
  _hover(point) {
    const { scene, camera, canvas } = this._view;
    byId("readout").textContent = scene ? `${point.x.toFixed(2)}, ${point.y.toFixed(2)}` : "";
    if (!scene) return;
    if (this._measure.active) {
      this._measure.pointAt(scene, snapped(scene, point, SNAP_PX / camera.scale));
      this._view.draw();
      return;
    }
    const found = pick(scene, point, this._reach / camera.scale);
    canvas.classList.toggle("pointing", found !== null);
    if (found?.id === this._view.hovered?.id) return;
    this._view.hovered = found;
    this._view.draw();
  }

  _leave() {
    byId("readout").textContent = "";
    this._measure.pointer = null;
    this._view.hovered = null;
    this._view.draw();
  }

  _toggleMeasure() {
    this._measure.toggle();
    this._toolbar.press("measure", this._measure.active);
    this._view.canvas.classList.toggle("measuring", this._measure.active);
    this._view.canvas.focus({ preventScroll: true });
    if (this._measure.active) this._app.notices.say("Click from point to point; Esc ends measuring");
    this._view.draw();
  }

  /** Begin or end laying parts of the map on each other. @param {string} [component] the one to be moved */
  toggleJoin(component = "") {
    const { joiner } = this._app;
    if (joiner.active && !component) joiner.stop();
    else joiner.start(component);
  }

  /** Show whether parts of the map are being laid on each other. */
  showJoining() {
    this._toolbar.press("join", this._app.joiner.active);
    this._view.canvas.classList.toggle("joining", this._app.joiner.active);
  }

  _escape() {
    if (this._app.joiner.active) {
      this._app.joiner.stop();
      return;
    }
    if (this._measure.active) this._toggleMeasure();
    else this._app.pick(null);
  }

  _enter() {
    const { width, height } = this._view.camera;
    this._tap(this._view.camera.toWorld(width / 2, height / 2));
    if (this._measure.active && this._measure.points.length > 1) {
      this._app.notices.say(`${words(this._measure.length)} in all`);
    }
  }

  /** @param {HTMLCanvasElement} canvas */
  _listenToKeys(canvas) {
    const app = this._app;
    listen(canvas, {
      pan: (dx, dy) => this._pan(dx, dy),
      zoom: (factor) => this._zoomMiddle(factor),
      fit: () => this.fit(),
      enter: () => this._enter(),
      measure: () => this._toggleMeasure(),
      join: () => this.toggleJoin(),
      localize: () => byId("scan-file").click(),
      play: () => app.time.toggle(),
      escape: () => this._escape(),
      theme: () => app.theme.toggle(),
      help: () => app.panel.help(),
    });
    byId("theme-toggle").addEventListener("click", () => app.theme.toggle());
    // The crosshair is for those who steer by keys.
    const update = () => {
      this._view.crosshair = canvas.matches(":focus-visible");
      this._view.draw();
    };
    canvas.addEventListener("focus", update);
    canvas.addEventListener("blur", update);
    canvas.addEventListener("keydown", update);
    canvas.addEventListener("pointerdown", () => {
      this._view.crosshair = false;
    });
  }

  _takeFiles() {
    const [drop, input] = [byId("drop"), byId("scan-file")];
    input.addEventListener("change", () => {
      const file = input.files[0];
      input.value = "";
      if (file) void this._app.localize(file);
    });
    let depth = 0;
    document.addEventListener("dragenter", () => (drop.hidden = ++depth === 0));
    document.addEventListener("dragleave", () => (drop.hidden = --depth === 0));
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      depth = 0;
      drop.hidden = true;
      const file = event.dataTransfer?.files[0];
      if (file) void this._app.localize(file);
    });
  }

  _afterFrame() {
    showScale(byId("scale-bar"), this._view.camera.scale);
  }
}

/** How much of the map the inspector covers from below, where it is a sheet [px]. */
function covered() {
  const sheet = byId("inspector");
  if (sheet.hidden || getComputedStyle(sheet).position !== "fixed") return 0;
  const map = byId("map").getBoundingClientRect();
  return Math.max(0, map.bottom - sheet.getBoundingClientRect().top);
}

/**
 * Cut a trajectory where the component changes or a scan fitted nowhere.
 * @param {import("../net/contract.js").TrajectoryPose[]} poses
 */
function pieces(poses) {
  /** @type {{component: string, x: number, y: number}[][]} */
  const found = [];
  let open = false;
  for (const { component, x, y } of poses) {
    if (component === null || x === null || y === null) {
      open = false;
      continue;
    }
    const last = found[found.length - 1];
    if (open && last[0].component === component) last.push({ component, x, y });
    else found.push([{ component, x, y }]);
    open = true;
  }
  return found;
}
