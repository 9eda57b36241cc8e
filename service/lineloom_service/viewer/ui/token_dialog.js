import { h, refill } from "./dom.js";

/** Asks for the access token. */
export class TokenDialog {
  /** @param {(token: string, remember: boolean) => void} onToken */
  constructor(onToken) {
    this._onToken = onToken;
    this._dialog = h("dialog", { "aria-labelledby": "token-title" });
    document.body.append(this._dialog);
  }

  /** @param {string} reason what the service said */
  open(reason) {
    if (this._dialog.open) return;
    const input = h("input", { id: "token", type: "password", autocomplete: "off", required: true, autofocus: true });
    const remember = h("input", { type: "checkbox" });
    const form = h(
      "form",
      { method: "dialog" },
      h("h2", { id: "token-title" }, "Access token"),
      h("p", { className: "muted" }, reason),
      h("label", { for: "token" }, "Token with the scope “read”; “operate” to retract and restore"),
      input,
      h("label", { className: "switch" }, remember, "Remember on this device"),
      h("div", { className: "buttons" }, h("button", { className: "primary", type: "submit" }, "Continue")),
    );
    form.addEventListener("submit", () => this._onToken(input.value.trim(), remember.checked));
    refill(this._dialog, form);
    this._dialog.showModal();
  }
}
