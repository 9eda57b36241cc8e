const KEY = "lineloom.token";

/**
 * The bearer token: kept for this tab, or on this device where the user asks for it. It travels in
 * the Authorization header alone, never in an address.
 */
export class Token {
  get value() {
    return sessionStorage.getItem(KEY) ?? localStorage.getItem(KEY) ?? "";
  }

  /** @param {string} value @param {boolean} remember keep it after the tab is closed */
  set(value, remember) {
    this.forget();
    (remember ? localStorage : sessionStorage).setItem(KEY, value);
  }

  forget() {
    sessionStorage.removeItem(KEY);
    localStorage.removeItem(KEY);
  }
}
