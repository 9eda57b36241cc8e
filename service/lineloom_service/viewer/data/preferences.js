const KEY = "lineloom.view";

/**
 * What the reader chose: theme for this device; layers, view and the like for this tab, so that a
 * reload finds the page as it was.
 */
export class Preferences {
  /** @param {string} name @param {any} [fallback] */
  get(name, fallback = null) {
    const store = read(sessionStorage);
    return store[name] ?? read(localStorage)[name] ?? fallback;
  }

  /** @param {string} name @param {any} value @param {{device?: boolean}} [options] */
  set(name, value, { device = false } = {}) {
    const storage = device ? localStorage : sessionStorage;
    storage.setItem(KEY, JSON.stringify({ ...read(storage), [name]: value }));
  }
}

/** @param {Storage} storage */
function read(storage) {
  try {
    return JSON.parse(storage.getItem(KEY) ?? "{}");
  } catch {
    return {};
  }
}
