/**
 * @typedef {{type: string, data: string, id: string}} ServerEvent
 */

/** Cuts a text stream into Server-Sent Events, however the network cut it into pieces. */
export class EventParser {
  constructor() {
    this._rest = "";
    this._type = "";
    /** @type {string[]} */
    this._data = [];
    this.lastId = "";
    /** @type {number|null} milliseconds to wait before connecting again, if the server said so */
    this.retry = null;
  }

  /** Forget a half event: the connection that it came by is gone. */
  restart() {
    this._rest = "";
    this._type = "";
    this._data = [];
  }

  /** Take a piece of text; return the events that it completes. @param {string} text @returns {ServerEvent[]} */
  push(text) {
    const events = [];
    const lines = (this._rest + text).split(/\r\n|\n|\r(?!$)/);
    this._rest = lines.pop() ?? "";
    for (const line of lines) {
      const event = line === "" ? this._finish() : this._take(line);
      if (event) events.push(event);
    }
    return events;
  }

  /** @param {string} line */
  _take(line) {
    const colon = line.indexOf(":");
    if (colon === 0) return null; // a comment: keeps the connection alive
    const field = colon < 0 ? line : line.slice(0, colon);
    const value = colon < 0 ? "" : line.slice(colon + 1).replace(/^ /, "");
    if (field === "event") this._type = value;
    else if (field === "data") this._data.push(value);
    else if (field === "id") this.lastId = value;
    else if (field === "retry" && /^\d+$/.test(value)) this.retry = Number(value);
    return null;
  }

  /** @returns {ServerEvent|null} */
  _finish() {
    const event = { type: this._type || "message", data: this._data.join("\n"), id: this.lastId };
    const complete = this._data.length > 0;
    this._type = "";
    this._data = [];
    return complete ? event : null;
  }
}
