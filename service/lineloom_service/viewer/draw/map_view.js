import { noFrames } from "../data/frames.js";
import { compose } from "../geometry/pose.js";
import { Bounds } from "../geometry/bounds.js";
import { arrange, pageBounds } from "./arrangement.js";
import { Camera } from "./camera.js";
import { drawComponents } from "./component_marks.js";
import { drawGrid } from "./grid_marks.js";
import { drawThing, FreshLines, stroke } from "./highlight_marks.js";
import { DEFAULT_LAYERS } from "./layers.js";
import { paint } from "./painter.js";
import { Palette } from "./palette.js";
import { Picture } from "./picture.js";
import { RobotMarks } from "./robot_marks.js";
import { Transition } from "./transition.js";

/** Lines that a frame of a transition may draw. */
const MOST_MOVING_LINES = 12000;
/** Room around a thing that is gone to: it comes to lie in the middle, under the crosshair. */
const AROUND = { top: 60, right: 60, bottom: 60, left: 60 };
/** Nearer to an edge than this a thing is hardly seen. */
const EDGE_PX = 24;

/**
 * @typedef {import("../data/site_state.js").SiteState} SiteState
 * @typedef {import("./highlight_marks.js").Thing} Thing
 * @typedef {{draw: (context: CanvasRenderingContext2D, camera: Camera, scene: import("./scene.js").Scene) => void}} Mark
 */

/** The canvas: draws a frame whenever something has changed, and none otherwise. */
export class MapView {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.camera = new Camera();
    this.layers = { ...DEFAULT_LAYERS };
    this.palette = new Palette("light");
    /** @type {SiteState|null} */
    this.state = null;
    /** @type {Map<string, import("../geometry/pose.js").Pose>} */
    this.placement = new Map();
    this.frames = noFrames();
    /** @type {(state: SiteState) => import("../data/frames.js").Frames} */
    this.framesFor = noFrames;
    /** Fit the view to the map as it grows, until the reader moves it. */
    this.following = true;
    /** @type {Thing|null} */
    this.selected = null;
    /** @type {Thing|null} */
    this.hovered = null;
    /** A chosen robot's every pose, as points of its components. @type {{component: string, x: number, y: number}[][]} */
    this.trail = [];
    this.crosshair = false;
    /** What lies over the map's edges [px]. */
    this.insets = { top: 40, right: 40, bottom: 56, left: 40 };
    /** How much of the map a sheet covers from below [px]. */
    this.covered = () => 0;
    /** Tools that draw over the map. @type {Mark[]} */
    this.marks = [];
    /** Tools that lay a component elsewhere. @type {(placement: Map<string, import("../geometry/pose.js").Pose>) => void} */
    this.adjust = () => {};
    /** @type {() => void} called after every frame */
    this.onFrame = () => {};
    this._context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    this._picture = new Picture();
    this._robots = new RobotMarks();
    this._fresh = new FreshLines();
    /** @type {Transition|null} */
    this._transition = null;
    /** @type {(() => void)[]} */
    this._awaited = [];
    this._frame = 0;
    this._ratio = 1;
    new ResizeObserver(() => this._resize()).observe(canvas);
    this._resize();
  }

  /** What is drawn, and where. @returns {import("./scene.js").Scene|null} */
  get scene() {
    if (!this.state) return null;
    const { state, placement, palette, layers } = this;
    return { state, placement, palette, layers };
  }

  /** Show another state. @param {SiteState|null} state @param {{glide?: boolean}} [options] glide: let components move to their new places */
  show(state, { glide = true } = {}) {
    const [before, placedBefore] = [this.state, this.placement];
    this.state = state;
    if (state) this.frames = this.framesFor(state);
    this.placement = state ? arrange(state.components, this._aspect(), this.frames) : new Map();
    this.adjust(this.placement);
    this._transition = null;
    if (state) {
      const moving = glide && before && before.site.site === state.site.site && !prefersStillness();
      if (moving) {
        this._fresh.update(before, state);
        this._transition = Transition.of(before, placedBefore, state, this.placement);
      }
      this._robots.update(state.robots);
    }
    if (this.following && this._transition) this._transition.carry(this.camera, this._fitted());
    else if (this.following) this.fit();
    this.repaint();
  }

  /** Settled once the state shown last is drawn, and its components are in their places. @returns {Promise<void>} */
  shown() {
    if (!this.state) return Promise.resolve();
    this.draw();
    return new Promise((resolve) => this._awaited.push(resolve));
  }

  /** Show robots' new poses on the same map. @param {import("../net/contract.js").RobotAnswer[]} robots */
  moveRobots(robots) {
    if (!this.state) return;
    this.state.robots = [...robots].sort((a, b) => (a.robot < b.robot ? -1 : 1));
    this._robots.update(this.state.robots);
    this.draw();
  }

  /** Show all. */
  fit() {
    if (!this.state) return;
    Object.assign(this.camera, this._fitted());
    this.draw();
  }

  /** Return a camera that shows all. */
  _fitted() {
    const camera = this.camera.copy();
    if (!this.state) return camera;
    const bounds = pageBounds(this.state.components, this.placement);
    // The frames of several components stand out a little.
    camera.fit(bounds.grown(this.state.components.length > 1 ? 0.9 : 0), this._clear(this.insets));
    return camera;
  }

  /** Show a thing in the middle, near enough to see it. @param {Thing} thing */
  goTo(thing) {
    const bounds = this._boundsOf(thing);
    if (bounds.isEmpty) return;
    this.following = false;
    this.camera.fit(bounds.grown(3), this._clear(AROUND));
    this.draw();
  }

  /** Move the map if a thing does not lie where it can be seen. @param {Thing} thing */
  bringIntoView(thing) {
    const bounds = this._boundsOf(thing);
    if (bounds.isEmpty) return;
    const { width, height } = this.camera;
    const { x, y } = this.camera.toScreen(bounds.centre.x, bounds.centre.y);
    const bottom = height - this.covered();
    if (x > EDGE_PX && x < width - EDGE_PX && y > EDGE_PX && y < bottom - EDGE_PX) return;
    this.following = false;
    this.camera.pan(width / 2 - x, bottom / 2 - y);
    this.draw();
  }

  /** Room at the edges, what a sheet covers included. @param {{top: number, right: number, bottom: number, left: number}} insets */
  _clear(insets) {
    return { ...insets, bottom: insets.bottom + this.covered() };
  }

  /** The map itself, layers or colours have changed. */
  repaint() {
    const scene = this.scene;
    if (scene) this._picture.show(scene);
    this.draw();
  }

  /** Components lie elsewhere, as a tool says. */
  relay() {
    if (!this.state) return;
    this.placement = arrange(this.state.components, this._aspect(), this.frames);
    this.adjust(this.placement);
    this._picture.hurry();
    this.repaint();
  }

  /** Draw a frame soon. */
  draw() {
    this._frame ||= requestAnimationFrame(() => {
      this._frame = 0;
      this._drawFrame();
      this.onFrame();
    });
  }

  _drawFrame() {
    const { camera, palette, layers } = this;
    const context = this._context;
    context.setTransform(this._ratio, 0, 0, this._ratio, 0, 0);
    context.fillStyle = palette.ink.paper;
    context.fillRect(0, 0, camera.width, camera.height);
    const scene = this.scene;
    if (!scene) return;
    if (this._transition?.over) this._endTransition();
    if (layers.grid) drawGrid(context, camera, palette);
    const more = this._transition
      ? this._drawTransition(context, this._transition)
      : this._drawMap(context, scene);
    if (this.crosshair) this._drawCrosshair(context);
    if (more) this.draw();
  }

  /** @param {CanvasRenderingContext2D} context @param {import("./scene.js").Scene} scene */
  _drawMap(context, scene) {
    const { camera, palette } = this;
    const more = this._picture.draw(context, camera, this._ratio);
    if (!more) for (const resolve of this._awaited.splice(0)) resolve();
    const chosen = this.selected?.id ?? "";
    drawComponents(context, camera, scene, this.selected?.kind === "component" ? chosen : "");
    this._fresh.draw(context, camera, scene);
    this._drawTrail(context);
    drawThing(context, camera, scene, this.hovered, false);
    drawThing(context, camera, scene, this.selected, true);
    this._robots.draw(context, camera, scene, this.selected?.kind === "robot" ? chosen : "");
    for (const mark of this.marks) mark.draw(context, camera, { ...scene, palette });
    return more || this._fresh.fading || this._robots.moving;
  }

  /** @param {CanvasRenderingContext2D} context @param {Transition} transition */
  _drawTransition(context, transition) {
    const { camera, palette, layers } = this;
    const scene = { state: transition.shown, placement: transition.placement(), palette, layers };
    if (this.following) transition.steer(camera);
    const { x, y, scale, width, height } = camera;
    const every = Math.max(1, Math.ceil(scene.state.lines.length / MOST_MOVING_LINES));
    const job = paint(context, scene, { x, y, scale, width, height }, every);
    while (!job.next().done);
    drawComponents(context, camera, scene, "");
    return true;
  }

  _endTransition() {
    this._transition = null;
    if (this.following) Object.assign(this.camera, this._fitted());
    this._picture.hurry();
  }

  /** @param {CanvasRenderingContext2D} context */
  _drawTrail(context) {
    if (this.selected?.kind !== "robot") return;
    const colour = this.palette.robot(this.state?.robotNames.indexOf(this.selected.id) ?? 0);
    for (const piece of this.trail) {
      const pose = this.placement.get(piece[0].component);
      if (!pose) continue;
      const points = piece.map(({ x, y }) => compose(pose, { x, y, theta: 0 }));
      stroke(context, this.camera, points, colour, 2.2);
    }
  }

  /** @param {CanvasRenderingContext2D} context */
  _drawCrosshair(context) {
    const [x, y] = [Math.round(this.camera.width / 2) + 0.5, Math.round(this.camera.height / 2) + 0.5];
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + 4 * dx, y + 4 * dy);
      context.lineTo(x + 14 * dx, y + 14 * dy);
    }
    context.strokeStyle = this.palette.ink.accent;
    context.lineWidth = 2;
    context.stroke();
  }

  /** @param {Thing} thing */
  _boundsOf(thing) {
    const { state, placement } = this;
    const bounds = new Bounds();
    if (!state) return bounds;
    /** @param {string|null|undefined} component @param {number} x @param {number} y */
    const add = (component, x, y) => {
      const pose = placement.get(component ?? "");
      if (!pose) return;
      const at = compose(pose, { x, y, theta: 0 });
      bounds.add(at.x, at.y);
    };
    if (thing.kind === "component") {
      const found = state.component(thing.id);
      const pose = placement.get(thing.id);
      return found && pose ? found.extent(pose.theta).moved(pose.x, pose.y) : bounds;
    }
    if (thing.kind === "line") {
      const line = state.lines.answers[state.lines.indexOf(thing.id)];
      if (line) for (const [x, y] of [[line.x1, line.y1], [line.x2, line.y2]]) add(line.component, x, y);
    } else if (thing.kind === "robot") {
      const robot = state.robot(thing.id);
      if (robot?.pose) add(robot.component, robot.pose.x, robot.pose.y);
    } else {
      const constraint = state.constraints.get(thing.id);
      for (const id of constraint ? [constraint.keyframe_a, constraint.keyframe_b] : []) {
        const node = state.keyframes.get(id);
        if (node) add(node.component, node.x, node.y);
      }
    }
    return bounds;
  }

  _resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    this._ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.width = Math.round(clientWidth * this._ratio);
    this.canvas.height = Math.round(clientHeight * this._ratio);
    this.camera.width = clientWidth;
    this.camera.height = clientHeight;
    if (this.following) this.fit();
    this._drawFrame(); // at once: setting the size has cleared the canvas
    this.draw();
  }

  _aspect() {
    return Math.max(this.camera.width / this.camera.height, 0.3);
  }
}

function prefersStillness() {
  return window.matchMedia("(prefers-reduced-motion: reduce)").matches;
}
