const KINDS = ["line", "constraint", "robot", "component"];

/**
 * What is chosen. It stands in the address after the #, so that it can be sent to somebody and
 * survives a reload.
 *
 * @typedef {import("./draw/highlight_marks.js").Thing} Thing
 */
export class Selection {
  /** @param {(thing: Thing|null) => void} onChange */
  constructor(onChange) {
    this._onChange = onChange;
    window.addEventListener("hashchange", () => onChange(this.current));
  }

  /** @returns {Thing|null} */
  get current() {
    const [kind, id] = window.location.hash.slice(1).split("/").map(decodeURIComponent);
    if (!id || !KINDS.includes(kind)) return null;
    return { kind: /** @type {Thing["kind"]} */ (kind), id };
  }

  /** @param {Thing|null} thing */
  set(thing) {
    const hash = thing ? `#${thing.kind}/${encodeURIComponent(thing.id)}` : "";
    if (hash === window.location.hash) return;
    const { pathname, search } = window.location;
    window.history.replaceState(null, "", `${pathname}${search}${hash}`);
    this._onChange(thing);
  }
}
