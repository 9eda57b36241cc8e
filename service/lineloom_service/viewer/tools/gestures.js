const CLICK_PX = 5;

/**
 * Mouse, pen, fingers and wheel on the canvas: drag pans, wheel and pinch zoom, a tap chooses.
 * @typedef {{onPan: (dx: number, dy: number) => void,
 *   onZoom: (factor: number, x: number, y: number) => void,
 *   onTap: (x: number, y: number) => void, onMove: (x: number, y: number) => void,
 *   onLeave: () => void, onGrab: (x: number, y: number) => void, onRelease: () => void}} Handlers
 * onGrab: a finger or button went down, before anything moves. onRelease: a drag has ended.
 */
export class Gestures {
  /** @param {HTMLCanvasElement} canvas @param {Handlers} handlers */
  constructor(canvas, handlers) {
    this._canvas = canvas;
    this._handlers = handlers;
    /** @type {Map<number, {x: number, y: number}>} */
    this._pointers = new Map();
    this._travelled = 0;
    canvas.addEventListener("pointerdown", (event) => this._down(event));
    canvas.addEventListener("pointermove", (event) => this._move(event));
    canvas.addEventListener("pointerup", (event) => this._up(event));
    canvas.addEventListener("pointercancel", (event) => this._pointers.delete(event.pointerId));
    canvas.addEventListener("pointerleave", () => handlers.onLeave());
    canvas.addEventListener("wheel", (event) => this._wheel(event), { passive: false });
  }

  /** @param {MouseEvent} event */
  _at(event) {
    const box = this._canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  /** @param {PointerEvent} event */
  _down(event) {
    if (event.button !== 0) return;
    this._canvas.setPointerCapture(event.pointerId);
    if (this._pointers.size === 0) this._travelled = 0;
    const at = this._at(event);
    if (this._pointers.size === 0) this._handlers.onGrab(at.x, at.y);
    this._pointers.set(event.pointerId, at);
  }

  /** @param {PointerEvent} event */
  _move(event) {
    const now = this._at(event);
    const before = this._pointers.get(event.pointerId);
    if (!before) {
      this._handlers.onMove(now.x, now.y);
      return;
    }
    const other = [...this._pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) this._pinch(before, now, other);
    else this._drag(before, now);
    this._pointers.set(event.pointerId, now);
  }

  /** @param {{x: number, y: number}} before @param {{x: number, y: number}} now */
  _drag(before, now) {
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    const still = this._travelled <= CLICK_PX;
    this._travelled += Math.hypot(dx, dy);
    // A trembling hand taps; from a few pixels on it drags.
    if (!still || this._travelled > CLICK_PX) this._handlers.onPan(dx, dy);
  }

  /** @param {{x: number, y: number}} before @param {{x: number, y: number}} now @param {{x: number, y: number}} other */
  _pinch(before, now, other) {
    this._travelled = Infinity;
    const apart = Math.hypot(before.x - other.x, before.y - other.y);
    const factor = Math.hypot(now.x - other.x, now.y - other.y) / Math.max(apart, 1);
    this._handlers.onPan((now.x - before.x) / 2, (now.y - before.y) / 2);
    this._handlers.onZoom(factor, (now.x + other.x) / 2, (now.y + other.y) / 2);
  }

  /** @param {PointerEvent} event */
  _up(event) {
    const at = this._pointers.get(event.pointerId);
    this._pointers.delete(event.pointerId);
    if (at && this._pointers.size === 0 && this._travelled <= CLICK_PX) {
      this._handlers.onTap(at.x, at.y);
    } else if (at && this._pointers.size === 0) {
      this._handlers.onRelease();
    }
  }

  /** @param {WheelEvent} event */
  _wheel(event) {
    event.preventDefault();
    const { x, y } = this._at(event);
    const unit = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 16 : 1;
    // A touch pad's pinch comes as a wheel with ctrl, in small steps.
    const speed = event.ctrlKey ? 0.01 : 0.0015;
    this._handlers.onZoom(Math.exp(-event.deltaY * unit * speed), x, y);
  }
}
