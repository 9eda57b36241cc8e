/** Light or dark: as the reader chose, else as the system is. */
export class Theme {
  /** @param {import("../data/preferences.js").Preferences} preferences @param {(theme: "light"|"dark") => void} onChange */
  constructor(preferences, onChange) {
    this._preferences = preferences;
    this._onChange = onChange;
    this._system = window.matchMedia("(prefers-color-scheme: dark)");
    this._system.addEventListener("change", () => this.apply());
  }

  /** @returns {"light"|"dark"} */
  get current() {
    return this._preferences.get("theme") ?? (this._system.matches ? "dark" : "light");
  }

  apply() {
    document.documentElement.dataset.theme = this.current;
    this._onChange(this.current);
  }

  toggle() {
    const next = this.current === "dark" ? "light" : "dark";
    this._preferences.set("theme", next, { device: true });
    this.apply();
  }
}
