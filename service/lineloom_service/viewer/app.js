import { History } from "./data/history.js";
import { newsBetween } from "./data/news.js";
import { Preferences } from "./data/preferences.js";
import { MapView } from "./draw/map_view.js";
import { Palette } from "./draw/palette.js";
import { Api } from "./net/api.js";
import { SiteDirectory } from "./net/site_directory.js";
import { SiteFeed } from "./net/site_feed.js";
import { Token } from "./net/token.js";
import { Selection } from "./selection.js";
import { FrameControl } from "./tools/frame_control.js";
import { Joiner } from "./tools/joiner.js";
import { Localizer } from "./tools/localizer.js";
import { MapControl } from "./tools/map_control.js";
import { BlankPage } from "./ui/blank_page.js";
import { byId } from "./ui/dom.js";
import { Inspector } from "./ui/inspector.js";
import { localizeCard } from "./ui/localize_card.js";
import { joinCard } from "./ui/join_card.js";
import { Notices } from "./ui/notices.js";
import { SidePanel } from "./ui/side_panel.js";
import { SitePicker } from "./ui/site_picker.js";
import { StatusBadge } from "./ui/status_badge.js";
import { Theme } from "./ui/theme.js";
import { TimeBar } from "./ui/time_bar.js";
import { TokenDialog } from "./ui/token_dialog.js";
import { saveFile } from "./ui/save_file.js";

/**
 * @typedef {import("./data/site_state.js").SiteState} SiteState
 * @typedef {import("./draw/highlight_marks.js").Thing} Thing
 */

/** The page: what arrives goes to the map and the panels, what the reader does goes back. */
export class App {
  constructor() {
    this.preferences = new Preferences();
    this.token = new Token();
    this.api = new Api(this.token);
    this.history = new History();
    this.localizer = new Localizer(this.api);
    this.site = "";
    /** @type {SiteFeed|null} */
    this._feed = null;
    this._connection = "connecting";
    this._exportsOffered = false;

    this.view = new MapView(byId("map"));
    this.view.layers = { ...this.view.layers, ...this.preferences.get("layers", {}) };
    this.notices = new Notices(byId("notices"));
    this.badge = new StatusBadge(byId("status"), byId("trouble"));
    this.blank = new BlankPage(byId("blank"));
    this.picker = new SitePicker(byId("site-picker"), (site) => this.open(site));
    this.panel = new SidePanel({
      onPick: (thing) => this.pick(thing, true),
      onLayer: (name, on) => this._switchLayer(name, on),
      onFrame: (choice) => void this.frames.choose(choice),
      onDownload: (path, name) => this._download(path, name),
    });
    this.frames = new FrameControl(this);
    this.inspector = new Inspector(byId("inspector"), (id) =>
      this.api.get(`${this._path}/constraints/${encodeURIComponent(id)}`),
    );
    this.time = new TimeBar(byId("time"), () => this._showMoment());
    this.selection = new Selection(() => this._showSelection());
    this.tokenDialog = new TokenDialog((token, remember) => this._setToken(token, remember));
    this.theme = new Theme(this.preferences, (theme) => this._recolour(theme));
    this.joiner = new Joiner(this, () => this._showJoining());
    this.view.adjust = (placement) => this.joiner.place(placement);
    this.control = new MapControl(this);
    this.directory = new SiteDirectory(this.api, (sites) => this._takeSites(sites));
  }

  start() {
    this.theme.apply();
    const site = new URLSearchParams(window.location.search).get("site");
    if (site) this.open(site);
    void this._findSites();
  }

  /** Show a site. @param {string} site */
  open(site) {
    const url = new URL(window.location.href);
    if (url.searchParams.get("site") !== site) {
      url.searchParams.set("site", site);
      url.hash = "";
      window.history.pushState(null, "", url);
    }
    this.site = site;
    document.title = `${site} – Lineloom`;
    this.history.clear();
    this.localizer.clear();
    this.joiner.stop();
    this.frames.open();
    this.view.following = true;
    this.view.show(null);
    this.control.restoreView();
    this._listenTo(site);
    this._redraw();
    this.picker.show(this.directory.sites, site);
  }

  /** Choose a thing, or nothing. @param {Thing|null} thing @param {boolean} [go] bring it into view */
  pick(thing, go = false) {
    this.localizer.clear();
    if (thing) this.joiner.stop();
    this.selection.set(thing);
    if (thing && go) this.view.goTo(thing);
    if (thing && go) byId("side").classList.remove("open");
    this._showSelection();
    if (thing) this.view.bringIntoView(thing);
  }

  /** Ask where a scan was taken. @param {File} file */
  async localize(file) {
    this.notices.say(`Looking for ${file.name} in the map`);
    try {
      await this.localizer.ask(this.site, file);
    } catch (error) {
      this.notices.say(`${file.name}: ${/** @type {Error} */ (error).message}`, "bad");
      return;
    }
    this.selection.set(null);
    this._showHypothesis(0);
  }

  /** The site's address, below the service's. */
  get _path() {
    return `v1/sites/${encodeURIComponent(this.site)}`;
  }

  /** @param {string} site */
  _listenTo(site) {
    this._feed?.stop();
    this.badge.site(null);
    this._feed = new SiteFeed(this.api, site, {
      onState: (state) => this._takeState(state),
      onRobots: (robots) => this._takeRobots(robots),
      onSite: (answer) => this.badge.site(answer),
      onShown: () => this.view.shown(),
      onEvent: (event) => event.type === "reset" && this.api.forget(),
      onConnection: (connection, detail) => this._takeConnection(connection, detail),
    });
    this._feed.start();
  }

  /** @param {SiteState} state */
  _takeState(state) {
    const before = this.history.latest;
    if (before && state.version < before.version) this.history.clear();
    this.history.add(state);
    if (before) for (const news of newsBetween(before, state)) this.notices.say(news);
    if (this.time.isLive) this.view.show(state);
    this.time.update(this.history.moments);
    void this.frames.follow();
    this._redraw();
  }

  /** @param {import("./net/contract.js").RobotAnswer[]} robots */
  _takeRobots(robots) {
    const known = new Set(this.history.latest?.robotNames);
    if (robots.some(({ robot }) => !known.has(robot))) {
      this._feed?.refresh();
      return;
    }
    if (this.time.isLive) this.view.moveRobots(robots);
    this._redraw();
  }

  /** @param {string} connection @param {string} detail */
  _takeConnection(connection, detail) {
    this._connection = connection;
    this.badge.connection(connection, detail);
    if (connection === "unauthorised") this.tokenDialog.open(detail);
    if (connection === "live" || connection === "polling") void this._offerExports();
    this._showBlank(detail);
  }

  /** @param {string} [detail] */
  _showBlank(detail = "") {
    const { latest } = this.history;
    const empty = latest ? latest.components.length === 0 && latest.robots.length === 0 : false;
    if (latest && !empty) this.blank.hide();
    else if (this._connection === "away") this.blank.message("The service is away", "This page asks again by itself until it is back.");
    else if (this._connection === "unauthorised") this.blank.message("A token is needed", detail);
    else if (this._connection === "forbidden") this.blank.message("This token is not allowed to read here", detail);
    else if (this._connection === "failed") this.blank.message("The service does not understand this page", detail);
    else if (this._connection === "empty" || empty || !this.site) this.blank.firstScan(this.site);
    else this.blank.hide();
  }

  _showMoment() {
    const moment = this.time.chosen;
    const state = moment ? this.history.stateAt(moment) : this.history.latest;
    if (state) this.view.show(state, { glide: moment === null || moment.kind === "received" });
    this._redraw();
  }

  /** Bring the panels up to date with what the map shows. */
  _redraw() {
    const { state, palette, layers } = this.view;
    this.panel.show(state, palette, layers, this.selection.current);
    this._showBlank();
    if (this.selection.current) this._showSelection();
  }

  _showSelection() {
    const thing = this.selection.current;
    const { state } = this.view;
    this.view.selected = thing;
    this.control.showTrail(thing, state);
    if (state) this.panel.show(state, this.view.palette, this.view.layers, thing);
    if (thing && state) void this.inspector.show(thing, this._cardContext(state));
    else if (!this.localizer.answer && !this.joiner.active) this.inspector.close();
    this.view.draw();
  }

  /** @param {number} rank */
  _showHypothesis(rank) {
    const { state } = this.view;
    if (!state || !this.localizer.answer) return;
    this.localizer.chosen = rank;
    this.inspector.open(localizeCard(this.localizer, this._cardContext(state), (next) => this._showHypothesis(next)));
    this.view.draw();
  }

  /** @param {SiteState} state @returns {import("./ui/inspector.js").CardContext} */
  _cardContext(state) {
    return {
      state,
      palette: this.view.palette,
      onClose: () => {
        this.pick(null);
        this.view.canvas.focus();
      },
      onPick: (thing) => this.pick(thing),
      onGoTo: (thing) => this.view.goTo(thing),
      onAct: (id, action) => this._act(id, action),
      onWhatIf: (id) => this.api.post(`${this._path}/constraints/${encodeURIComponent(id)}/what-if`),
      onJoin: (component) => this.control.toggleJoin(component),
      onDownload: (path, name) => this._download(path, name),
    };
  }

  /** The card of the parts that are laid on each other. */
  _showJoining() {
    this.control.showJoining();
    if (this.joiner.active) {
      this.localizer.clear();
      this.selection.set(null);
      this.inspector.open(joinCard(this.joiner, () => this.joiner.stop(), () => void this._join()));
    } else {
      this.inspector.close();
    }
    this.view.relay();
    if (this.joiner.trial) this.view.fit(); // clear of the card, which is larger now
  }

  async _join() {
    const made = await this.joiner.confirm();
    if (!made) return;
    this.notices.say(`${made.id} is believed; the map follows`);
    this.time.goLive();
    this._feed?.refresh();
  }

  /** @param {string} id @param {"retract"|"restore"|"confirm"} action */
  async _act(id, action) {
    await this.api.post(`${this._path}/constraints/${encodeURIComponent(id)}/${action}`);
    this.notices.say(`${id} is ${{ retract: "retracted", restore: "restored", confirm: "believed" }[action]}; the map follows`);
    this.time.goLive();
    this._feed?.refresh();
  }

  /** Once: what the service writes does not change while it runs. */
  async _offerExports() {
    if (this._exportsOffered) return;
    this._exportsOffered = true;
    try {
      this.panel.exports((await this.api.get("v1/map-formats")).formats);
    } catch {
      this._exportsOffered = false;
    }
  }

  /** Save a file in the coordinates that the map is shown in. @param {string} path within the site @param {string} name of the file */
  async _download(path, name) {
    try {
      await saveFile(await this.api.open(`${this._path}/${path}${this.frames.query}`), name);
    } catch (error) {
      this.notices.say(/** @type {Error} */ (error).message, "bad");
    }
  }

  /** @param {string} name @param {boolean} on */
  _switchLayer(name, on) {
    this.view.layers = { ...this.view.layers, [name]: on };
    this.preferences.set("layers", this.view.layers);
    this.view.repaint();
    this._redraw();
  }

  /** @param {"light"|"dark"} theme */
  _recolour(theme) {
    this.view.palette = new Palette(theme);
    this.view.repaint();
    this.panel.theme(theme);
    this._redraw();
  }

  /** @param {string} token @param {boolean} remember */
  _setToken(token, remember) {
    this.token.set(token, remember);
    this.api.forget();
    if (this.site) this._listenTo(this.site);
    void this._findSites();
  }

  async _findSites() {
    const answer = await this.directory.follow();
    if (answer === "unauthorised" && !this.site) this._takeConnection("unauthorised", "The service wants a token.");
  }

  /** @param {string[]} sites */
  _takeSites(sites) {
    if (!this.site && sites.length > 0) this.open(sites[0]);
    else this.picker.show(sites, this.site);
    if (!this.site) this._showBlank();
  }
}
