import { ProblemError, UnreachableError } from "./api.js";
import { Due } from "./due.js";
import { EventStream } from "./event_stream.js";
import { SiteReader } from "./site_reader.js";

const POLL_MS = 1500;
const WATCHDOG_MS = 15000;
const LEAST_PAUSE_MS = 350;
const MOST_PAUSE_MS = 10000;
const RETRY_MS = [500, 1000, 2000, 4000, 8000];

/**
 * @typedef {"connecting"|"live"|"polling"|"away"|"unauthorised"|"forbidden"|"empty"|"failed"} Connection
 * @typedef {{onState: (state: import("../data/site_state.js").SiteState) => void,
 *   onRobots: (robots: import("./contract.js").RobotAnswer[]) => void,
 *   onSite: (site: import("./contract.js").SiteAnswer) => void,
 *   onShown: () => Promise<unknown>,
 *   onEvent: (event: {type: string, data: any}) => void,
 *   onConnection: (connection: Connection, detail: string) => void}} Listener
 * onShown: settled once what came last is drawn
 */

/**
 * Keeps a site's state current: events say when to ask, polling takes over where there is no event
 * stream, and a service that went away is asked again until it is back.
 */
export class SiteFeed {
  /** @param {import("./api.js").Api} api @param {string} site @param {Listener} listener */
  constructor(api, site, listener) {
    this._api = api;
    this._path = `v1/sites/${encodeURIComponent(site)}/events`;
    this._due = new Due();
    this._reader = new SiteReader(api, site, (part, took) => this._due.fetched(part, took));
    this._listener = listener;
    this._stopped = false;
    this._version = -1;
    this._settled = false;
    this._wake = () => {};
    this._failures = 0;
    this._streaming = false;
    this._remaking = false;
    /** @type {EventStream|null} */
    this._stream = null;
    this._onVisible = () => document.hidden || this.refresh();
  }

  start() {
    document.addEventListener("visibilitychange", this._onVisible);
    this._listener.onConnection("connecting", "");
    void this._readLoop();
    void this._streamLoop();
  }

  stop() {
    this._stopped = true;
    document.removeEventListener("visibilitychange", this._onVisible);
    this._stream?.close();
    this._wake();
  }

  /** Ask for everything now. */
  refresh() {
    this._due.everything();
    this._failures = 0;
    this._wake();
  }

  async _readLoop() {
    while (!this._stopped) {
      const began = performance.now();
      try {
        await this._read();
        this._failures = 0;
      } catch (error) {
        this._fail(error);
        await this._sleep(this._backOff(), true);
        continue;
      }
      // The heavier the site, the longer the pause: at most a fifth of the time is spent asking.
      const took = performance.now() - began;
      const pause = this._pause(Math.min(Math.max(4 * took, LEAST_PAUSE_MS), MOST_PAUSE_MS));
      await Promise.race([this._listener.onShown(), this._pause(MOST_PAUSE_MS)]);
      await pause;
      // Of a map that is being made no event tells.
      const idle = this._streaming && !this._remaking ? WATCHDOG_MS : POLL_MS;
      if (this._due.wait > 0) await this._sleep(Math.min(this._due.wait, idle), false);
      if (this._due.wait > 0) this._due.robots();
    }
  }

  async _read() {
    const site = await this._reader.site();
    if (this._stopped) return;
    this._listener.onConnection(this._streaming ? "live" : "polling", "");
    this._listener.onSite(site);
    this._remaking = Boolean(site.remaking);
    // Without events, only this tells that something has changed.
    const changed = site.version !== this._version || site.settled !== this._settled;
    if (site.version < this._version) this._reader.forget();
    if (changed && !this._streaming) this._due.everything();
    const due = this._due.begin();
    if (document.hidden) return; // all is asked for when the page is looked at again
    if (due.state) {
      const state = await this._reader.state(due);
      if (this._stopped) return;
      this._version = state.version;
      this._settled = state.settled;
      this._remaking = Boolean(state.site.remaking);
      this._listener.onSite(state.site); // what came up between the two answers
      this._listener.onState(state);
    } else if (changed || due.robots) {
      const robots = await this._reader.robots();
      if (!this._stopped) this._listener.onRobots(robots);
    }
  }

  async _streamLoop() {
    let failures = 0;
    while (!this._stopped) {
      this._stream ??= new EventStream(this._api, this._path, (event) => this._take(event));
      let exists = true;
      try {
        exists = await this._stream.read(() => {
          failures = 0;
          this._streaming = true;
          this.refresh(); // whatever happened before the stream was open
        });
      } catch {
        failures += 1; // the read loop meets the same failure and reports it
      }
      this._streaming = false;
      if (this._stopped) return;
      if (exists) this.refresh();
      const wait = RETRY_MS[Math.min(failures, RETRY_MS.length - 1)];
      await new Promise((resolve) => setTimeout(resolve, this._stream?.retry ?? wait));
    }
  }

  /** @param {{type: string, data: any}} event */
  _take(event) {
    this._due.note(event);
    if (event.type === "reset") this._reader.forget();
    this._listener.onEvent(event);
    this._wake();
  }

  /** @param {unknown} error */
  _fail(error) {
    if (this._stopped) return;
    this._due.everything();
    this._failures += 1;
    this._reader.forget();
    if (error instanceof ProblemError) {
      const known = { 401: "unauthorised", 403: "forbidden", 404: "empty" }[error.status];
      this._listener.onConnection(/** @type {Connection} */ (known ?? "failed"), error.message);
    } else if (error instanceof UnreachableError) {
      this._listener.onConnection("away", error.message);
    } else {
      this._listener.onConnection("failed", String(error));
    }
  }

  _backOff() {
    return RETRY_MS[Math.min(this._failures - 1, RETRY_MS.length - 1)];
  }

  /** @param {number} ms */
  _pause(ms) {
    return new Promise((resolve) => setTimeout(resolve, ms));
  }

  /** Sleep; an event wakes it, or only a call of refresh where `deep`. @param {number} ms @param {boolean} deep */
  _sleep(ms, deep) {
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, ms);
      this._wake = () => {
        if (deep && this._failures > 0 && !this._stopped) return;
        clearTimeout(timer);
        resolve(undefined);
      };
    });
  }
}
