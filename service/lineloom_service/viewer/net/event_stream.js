import { ProblemError } from "./api.js";
import { EventParser } from "./event_parser.js";

/**
 * Server-Sent Events read by fetch, so that the token travels in a header: the browser's own
 * EventSource cannot send one.
 */
export class EventStream {
  /**
   * @param {import("./api.js").Api} api
   * @param {string} path
   * @param {(event: {type: string, data: any}) => void} onEvent
   */
  constructor(api, path, onEvent) {
    this._api = api;
    this._path = path;
    this._onEvent = onEvent;
    this._parser = new EventParser();
    this._abort = new AbortController();
  }

  /**
   * Read until the connection ends; resumes behind the last event of the time before. Returns
   * false where the service has no such stream. Throws what Api throws.
   *
   * @param {() => void} onOpen called once the service has answered
   */
  async read(onOpen) {
    /** @type {Record<string, string>} */
    const headers = { Accept: "text/event-stream" };
    if (this._parser.lastId) headers["Last-Event-ID"] = this._parser.lastId;
    let response;
    try {
      response = await this._api.open(this._path, headers, this._abort.signal);
    } catch (error) {
      if (error instanceof ProblemError && [404, 405, 501].includes(error.status)) return false;
      throw error;
    }
    this._parser.restart();
    onOpen();
    await this._consume(response);
    return true;
  }

  /** Milliseconds to wait before reading again, where the service has named them. */
  get retry() {
    return this._parser.retry;
  }

  close() {
    this._abort.abort();
  }

  /** @param {Response} response */
  async _consume(response) {
    const reader = response.body?.getReader();
    const decoder = new TextDecoder();
    while (reader) {
      const { done, value } = await reader.read();
      if (done) return;
      for (const event of this._parser.push(decoder.decode(value, { stream: true }))) {
        this._onEvent({ type: event.type, data: parsed(event.data) });
      }
    }
  }
}

/** @param {string} text */
function parsed(text) {
  try {
    return JSON.parse(text);
  } catch {
    return text;
  }
}
