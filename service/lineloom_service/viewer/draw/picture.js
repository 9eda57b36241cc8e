import { paint } from "./painter.js";

/** How much larger than the view the picture is on every side, as a share of the view. */
const MARGIN = 0.25;
/** Milliseconds of a frame that may go into drawing the next picture. */
const BUDGET_MS = 7;
/** Lines that are drawn within one frame where it matters. */
const HURRIED_LINES = 15000;

/**
 * The map as a bitmap somewhat larger than the view. While the reader pans or zooms, the bitmap of
 * before is moved and stretched, which costs the same for ten lines and for a hundred thousand; the
 * next one is drawn meanwhile, a few milliseconds in every frame.
 */
export class Picture {
  constructor() {
    this._front = new Sheet();
    this._back = new Sheet();
    /** @type {Generator|null} */
    this._job = null;
    this._stale = true;
    /** @type {import("./scene.js").Scene|null} */
    this._scene = null;
    this._hurried = false;
  }

  /** Draw the next picture whole before the next frame, if it is a small one: a jump would show. */
  hurry() {
    this._hurried = (this._scene?.state.lines.length ?? 0) < HURRIED_LINES;
  }

  /** Show this scene from now on. @param {import("./scene.js").Scene} scene */
  show(scene) {
    this._scene = scene;
    this._stale = true;
  }

  /**
   * Put the picture on the canvas and go on with the next one where the view needs it. Returns
   * whether there is more to do.
   *
   * @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera
   * @param {number} ratio device pixels per CSS pixel
   */
  draw(context, camera, ratio) {
    if (!this._scene) return false;
    if (!this._job && (this._stale || !this._front.serves(camera, ratio))) {
      this._stale = false;
      this._back.prepare(camera, ratio);
      this._job = paint(this._back.context, this._scene, this._back.view);
    }
    this._work();
    this._front.blit(context, camera);
    return this._job !== null || this._stale || !this._front.serves(camera, ratio);
  }

  _work() {
    const end = this._hurried ? Infinity : performance.now() + BUDGET_MS;
    this._hurried = false;
    while (this._job) {
      const { done } = this._job.next();
      this._back.settle();
      if (done) {
        this._job = null;
        [this._front, this._back] = [this._back, this._front];
        return;
      }
      if (performance.now() > end) return;
    }
  }
}

/** A bitmap and the view that it shows. */
class Sheet {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.canvas.width = 1;
    this.canvas.height = 1;
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { willReadFrequently: true }));
    this.view = { x: 0, y: 0, scale: 0, width: 1, height: 1 };
    this.ratio = 1;
  }

  /** Clear the sheet for a camera's surroundings. @param {import("./camera.js").Camera} camera @param {number} ratio */
  prepare(camera, ratio) {
    const width = Math.ceil(camera.width * (1 + 2 * MARGIN));
    const height = Math.ceil(camera.height * (1 + 2 * MARGIN));
    const [w, h] = [Math.ceil(width * ratio), Math.ceil(height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) {
      this.canvas.width = w;
      this.canvas.height = h;
    }
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.clearRect(0, 0, w, h);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.view = { x: camera.x, y: camera.y, scale: camera.scale, width, height };
    this.ratio = ratio;
  }

  /**
   * Have what was drawn so far really drawn: browsers put it off until a canvas is looked at, and
   * would then do it all in one frame, whatever the clock said before.
   */
  settle() {
    this.context.getImageData(0, 0, 1, 1);
  }

  /** Tell whether the sheet shows all that the camera sees, in its sharpness. @param {import("./camera.js").Camera} camera @param {number} ratio */
  serves(camera, ratio) {
    const { view } = this;
    if (view.scale !== camera.scale || this.ratio !== ratio) return false;
    const dx = Math.abs(camera.x - view.x) * camera.scale;
    const dy = Math.abs(camera.y - view.y) * camera.scale;
    return dx + camera.width / 2 <= view.width / 2 && dy + camera.height / 2 <= view.height / 2;
  }

  /** @param {CanvasRenderingContext2D} context @param {import("./camera.js").Camera} camera */
  blit(context, camera) {
    const { view } = this;
    if (view.scale === 0) return;
    const zoom = camera.scale / view.scale;
    const corner = camera.toScreen(
      view.x - view.width / 2 / view.scale,
      view.y + view.height / 2 / view.scale,
    );
    // Whole device pixels keep an unscaled picture sharp.
    const x = zoom === 1 ? Math.round(corner.x * this.ratio) / this.ratio : corner.x;
    const y = zoom === 1 ? Math.round(corner.y * this.ratio) / this.ratio : corner.y;
    context.imageSmoothingEnabled = zoom !== 1;
    const [w, h] = [this.canvas.width / this.ratio, this.canvas.height / this.ratio];
    context.drawImage(this.canvas, x, y, w * zoom, h * zoom);
  }
}
