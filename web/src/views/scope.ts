// #/scope/NAME: what the trainee sees, in full screen. On the station's PC poses come from the station
// itself, so that the network is not between hand and eye; the rest comes from the server.
import { SessionState } from "wire";
import type { App, View } from "../app";
import { BUTTONS, INSTRUMENTS, NEWEST_LIMITS, newRow, packView, sameRow, STATE, toolAt, type Row } from "../history";
import { QUIET_MS } from "../live";
import { routeTo, type Route } from "../router";
import { loadKnee, type Knee } from "../scene/anatomy";
import { Arthroscope } from "../scene/arthroscope";
import type { MapName } from "../scene/colours";
import { Joint } from "../scene/joint";
import { carryLoose } from "../scene/loose";
import { notchAngle, USUAL_OPTIC, type Optic } from "../scene/optic";
import { NoWebGl } from "../scene/view3d";
import { FeedSource, markerAt, noteAt, type Change } from "../source";
import { isPort, StationView, TOKEN, type ViewAddress } from "../station_view";
import { text } from "../text";
import { announcer } from "../kit/keys";
import { broken, empty, everySecond, field, formDialog, h, loading, select, setFault } from "../ui";
import { Picture } from "./scope_picture";

const RATE_HZ = 60;
const NOTE_S = 25; // how long a note is shown
const POST_STEP_DEG = 15;
const FIELD = { least: 40, most: 150 }; // degrees
const PAUSE_MS = 250; // longer between two pictures: nothing changed meanwhile

// The optic is the station's, but for what the trainee chose.
interface Settings {
  place: ViewAddress | undefined;
  tiltDeg: number | undefined;
  fieldDeg: number | undefined;
  postDeg: number;
}

const KEY = "scope-settings";
const placeKey = (station: string): string => `scope-place ${station}`;
const NOTHING_CHOSEN: Settings = { place: undefined, tiltDeg: undefined, fieldDeg: undefined, postDeg: USUAL_OPTIC.postDeg };

function read<T>(key: string): Partial<T> {
  try {
    return (JSON.parse(localStorage.getItem(key) ?? "{}") as Partial<T> | null) ?? {};
  } catch {
    return {};
  }
}

// The optic is the trainee's at all stations, the place is that station's.
function kept(station: string): Settings {
  const { port, token = "" } = read<ViewAddress>(placeKey(station));
  return { ...NOTHING_CHOSEN, ...read<Settings>(KEY), place: isPort(port) && TOKEN.test(token) ? { port, token } : undefined };
}

function keep(station: string, { place, ...chosen }: Settings): void {
  localStorage.setItem(KEY, JSON.stringify(chosen));
  localStorage.setItem(placeKey(station), JSON.stringify(place ?? {}));
}

// What the address says goes before what was kept; the token does not stay in the address.
function settingsOf(route: Route): Settings {
  const station = route.args[0] ?? "";
  const settings = kept(station);
  const { query } = route;
  const port = Number(query.get("port"));
  const token = query.get("token") ?? "";
  if (isPort(port) && TOKEN.test(token)) {
    settings.place = { port, token };
    keep(station, settings);
    history.replaceState(null, "", routeTo(route.name, route.args));
  }
  if (query.has("optic")) settings.tiltDeg = Number(query.get("optic")) || 0;
  return settings;
}

export const scope: View = (root, route, app) => {
  const shown = new Scope(root, route, app);
  return () => shown.close();
};

/** A scope within another page: it shows that page's source, which goes on after it. */
export interface ScopePlace {
  source: FeedSource;
  plain: boolean; // no colours of touch and sight: an exam gives no hints
}

export class Scope {
  private readonly name: string;
  private readonly picture: Picture;
  private readonly source: FeedSource;
  private settings: Settings;
  private map: MapName = "none"; // it hides the tissue, so each visit begins without
  private station: StationView | undefined;
  private knee = ""; // which one is shown, or asked for
  private shown: { joint: Joint; optic: Arthroscope } | undefined;
  private pending = 0;
  private drawnAt = 0; // when the picture before was drawn
  private heard = 0; // when the last moment came
  private timing = false;
  private readonly tell = announcer();
  private readonly tellMap = announcer();
  private readonly row = newRow(); // of the server
  private readonly near = newRow(); // the poses to draw: the station's own if it sends any, else the server's
  private readonly drawn = newRow();
  private dirty = true; // something other than poses has changed
  private readonly ends: (() => void)[];

  constructor(root: HTMLElement, route: Route, private readonly app: App, private readonly place?: ScopePlace) {
    this.name = route.args[0] ?? "";
    if (!place) app.title(text.scope.title(this.name));
    this.picture = new Picture(root, text.scope.title(this.name));
    this.settings = settingsOf(route);
    this.source = place?.source ?? FeedSource.live(app.feed, this.name, RATE_HZ, NEWEST_LIMITS);
    this.watchStation();
    this.picture.onSide = (side) => {
      this.shown?.optic.setSide(side);
      this.soon();
    };
    this.picture.turnNotch(notchAngle(this.optic));
    const key = (event: KeyboardEvent): void => this.key(event);
    document.addEventListener("keydown", key);
    document.documentElement.classList.add("scope-page");
    this.ends = [
      this.source.onChange((change) => this.changed(change)),
      everySecond(() => this.showState()),
      () => document.removeEventListener("keydown", key),
      () => document.documentElement.classList.remove("scope-page"),
    ];
    if (place) this.changed("session");
  }

  close(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.pending);
    this.station?.close();
    if (!this.place) this.source.close();
    this.picture.close();
    this.drop();
  }

  private watchStation(): void {
    this.station?.close();
    this.station = this.settings.place && new StationView(this.settings.place);
    if (this.station) this.station.onView = () => this.soon(false);
  }

  /** The station's own poses, where they are of now and of the knee that is shown. */
  private get own(): StationView | undefined {
    const { station, source } = this;
    return station?.fresh && station.newest!.caseHash === source.session?.caseHash ? station : undefined;
  }

  /** As the trainee chose it, or as the station has it; a server that says nothing of it has 0 for its angle. */
  private get optic(): Optic {
    const { tiltDeg, fieldDeg, postDeg } = this.settings;
    const own = this.stations;
    return { tiltDeg: tiltDeg ?? own.tiltDeg, fieldDeg: fieldDeg ?? own.fieldDeg, postDeg };
  }

  private get stations(): Optic {
    const { session } = this.source;
    return session?.opticViewDeg ? { tiltDeg: session.opticDeg, fieldDeg: session.opticViewDeg, postDeg: 0 } : USUAL_OPTIC;
  }

  private changed(change: Change): void {
    if (change === "session") {
      this.shown?.optic.setOptic(this.optic);
      this.load();
    }
    if (change === "moment") this.heard = this.app.feed.now();
    else this.showState();
    if (!this.own) this.soon(change !== "moment");
  }

  // ---- the case --------------------------------------------------------------------------------------

  private load(): void {
    const { session } = this.source;
    if (!session) return;
    const key = `${session.caseName} ${session.caseHash}`;
    if (key === this.knee) return;
    this.knee = key;
    this.picture.say(loading(text.session.loadingCase(session.caseName)));
    loadKnee(session.caseName, key, session.groups).then(
      (knee) => this.knee === key && this.picture.canvas.isConnected && this.begin(knee),
      () => this.knee === key && this.picture.say(broken(text.session.noCase, "", () => {
        this.knee = "";
        this.load();
      })));
  }

  private begin(knee: Knee): void {
    this.drop();
    this.picture.fresh();
    const joint = new Joint(knee, true);
    try {
      this.shown = { joint, optic: new Arthroscope(this.picture.canvas, joint, this.optic) };
    } catch (error) {
      if (!(error instanceof NoWebGl)) throw error;
      this.picture.say(broken(text.session.noScene, text.session.noSceneHint));
      return;
    }
    this.shown.optic.setSide(this.picture.side);
    this.shown.optic.setMap(this.map);
    this.soon();
  }

  private drop(): void {
    this.shown?.optic.close();
    this.shown?.joint.dispose();
    this.shown = undefined;
  }

  // ---- a picture -------------------------------------------------------------------------------------

  /** Draws in the next frame. If only a moment came (`changed` false), draws only if its poses differ from those drawn. */
  private soon(changed = true): void {
    this.dirty ||= changed;
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      if (this.shown && !document.hidden) this.draw(now, this.shown);
    });
  }

  private draw(now: number, { joint, optic }: { joint: Joint; optic: Arthroscope }): void {
    const { history, session } = this.source;
    if (!session) return; // the message shown instead stays
    const station = this.own;
    if (history.count) history.read(history.count - 1, this.row);
    if (station) {
      packView(station.newest!, this.near);
      carryLoose(this.row, this.near);
    } else this.near.set(this.row);
    if (!this.dirty && sameRow(this.near, this.drawn) && !runs(this.near)) return;
    optic.resolution.move();
    this.render(now, joint, optic);
    if (station) this.picture.canvas.dataset.drawn = String(station.newest!.number);
  }

  private render(now: number, joint: Joint, optic: Arthroscope): void {
    for (const group of this.source.groups()) {
      const tissue = this.source.tissue(group, Infinity);
      if (tissue) joint.setTissue(group, tissue);
    }
    const remark = this.place?.plain ? undefined : markerAt(this.source, Infinity);
    joint.setMarker(remark?.point && { body: remark.body, point: remark.point });
    joint.setLoose(this.source.session?.loose ?? []);
    const more = joint.paint(now);
    optic.setInstruments(this.source.history.instruments);
    const seen = optic.draw(this.near, now / 1000);
    this.drawn.set(this.near);
    this.dirty = false;
    if (now - this.drawnAt < PAUSE_MS) optic.resolution.took(now - this.drawnAt);
    this.picture.timed(now - this.drawnAt, performance.now() - (this.own?.at ?? now));
    this.drawnAt = now;
    if (seen) this.picture.say(undefined);
    else if (this.source.history.count) this.picture.say(this.instead());
    if (more || (seen && !optic.settled)) this.soon();
    else optic.resolution.rest(() => this.source.session && this.render(performance.now(), joint, optic));
  }

  // ---- words -----------------------------------------------------------------------------------------

  /** Why there is no picture. */
  private instead(): HTMLElement {
    const words = text.scope;
    const state = this.row[STATE];
    if (state === SessionState.WAITING) return empty(words.notStarted, words.notStartedHint);
    return state === SessionState.CLOSED ? empty(words.closed, words.closedHint) : empty(words.noScope, words.noScopeHint);
  }

  private showState(): void {
    const { source, picture } = this;
    const { history } = source;
    const own = this.own !== undefined;
    const age = own || !this.heard || !history.count ? 0 : this.app.feed.now() - this.heard;
    const state = history.count ? history.value(history.count - 1, STATE) : undefined;
    const lost = this.app.feed.lostMs();
    const old = age >= QUIET_MS && state !== SessionState.CLOSED;
    const stale = lost !== undefined ? text.station.lost(lost) : old ? text.scope.stale(age) : "";
    picture.sign("stale", stale);
    this.tell(lost !== undefined ? "lost" : old ? "stale" : "", stale || text.link.open);
    picture.sign("state", state === SessionState.PAUSED ? text.scope.paused : state === SessionState.CLOSED ? text.scope.closed : "");
    const note = noteAt(source, Infinity);
    const young = note && history.end - Number(note.timeNs) * 1e-9 < NOTE_S;
    picture.sign("note", young ? note.text : "");
    picture.sign("marker", markerAt(source, Infinity) ? text.scope.marker : "");
    const from = own ? text.scope.sources.station : this.settings.place ? text.scope.sources.trying : text.scope.sources.server;
    picture.sign("source", this.timing ? `${from} · ${text.scope.optic(this.optic.tiltDeg)}` : "");
    if (!source.session) picture.say(!source.trouble ? loading(text.scope.waiting) : source.refused ? empty(source.trouble) : empty(text.station.noSession, source.trouble));
  }

  // ---- settings --------------------------------------------------------------------------------------

  private change(next: Settings): void {
    const moved = next.place?.port !== this.settings.place?.port || next.place?.token !== this.settings.place?.token;
    this.settings = next;
    keep(this.name, next);
    this.shown?.optic.setOptic(this.optic);
    this.picture.turnNotch(notchAngle(this.optic));
    if (moved) this.watchStation();
    this.showState();
    this.soon();
  }

  // What is as the station has it is not chosen.
  private choose(next: Optic, place = this.settings.place): void {
    const own = this.stations;
    this.change({
      place,
      tiltDeg: next.tiltDeg === own.tiltDeg ? undefined : next.tiltDeg,
      fieldDeg: next.fieldDeg === own.fieldDeg ? undefined : next.fieldDeg,
      postDeg: next.postDeg,
    });
  }

  private colour(map: MapName): void {
    if (map === this.map) return;
    this.map = map;
    this.shown?.optic.setMap(map);
    this.picture.showLegend(map);
    this.tellMap(map, text.scope.colours(text.session.maps[map]));
    this.soon();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if (this.place && (event.key === "Escape" || (this.place.plain && event.key === "t"))) return;
    const { optic, settings } = this;
    if (event.key === "f") this.picture.showTiming((this.timing = !this.timing));
    else if (event.key === "o") this.choose({ ...optic, tiltDeg: optic.tiltDeg === 30 ? 70 : 30 });
    else if (event.key === ",") this.choose({ ...optic, postDeg: optic.postDeg - POST_STEP_DEG });
    else if (event.key === ".") this.choose({ ...optic, postDeg: optic.postDeg + POST_STEP_DEG });
    else if (event.key === "t") this.colour(this.map === "none" ? "mismatch" : "none");
    else if (event.key === "?") this.picture.toggleKeys();
    else if (event.key === "Escape") location.hash = routeTo("station", [this.name]);
    else if (event.key === "s") ask({ optic, place: settings.place, map: this.map }, ({ optic: next, place, map }) => {
      this.choose(next, place);
      this.colour(map);
    });
    else return;
    event.preventDefault();
    this.showState();
  }
}

function runs(row: Row): boolean {
  for (let instrument = 0; instrument < INSTRUMENTS; instrument++) if (row[toolAt(instrument) + BUTTONS]! !== 0) return true;
  return false;
}

interface Choice {
  optic: Optic;
  place: ViewAddress | undefined;
  map: MapName;
}

function ask({ optic: now, place, map }: Choice, change: (next: Choice) => void): void {
  const port = h("input", { inputmode: "numeric", value: place?.port ?? "", autocomplete: "off" });
  const token = h("input", { value: place?.token ?? "", autocomplete: "off", spellcheck: "false", class: "mono" });
  const tilts = [...new Set([0, 30, 70, now.tiltDeg])].sort((a, b) => a - b);
  const tilt = select(tilts.map((deg) => [String(deg), text.scope.optic(deg)]), String(now.tiltDeg));
  const angle = h("input", { type: "number", min: FIELD.least, max: FIELD.most, step: "any", value: now.fieldDeg });
  const post = h("input", { type: "number", min: -180, max: 180, step: POST_STEP_DEG, value: now.postDeg });
  const maps = select((["none", "mismatch"] as const).map((name) => [name, text.session.maps[name]]), map);
  formDialog(text.scope.settings, [
    field(text.session.map, maps), field(text.scope.tilt, tilt), field(text.scope.field, angle), field(text.scope.post, post, text.scope.postHint),
    field(text.scope.port, port, text.scope.portHint), field(text.scope.token, token, text.scope.tokenHint),
  ], text.save, async () => {
    const wanted = port.value.trim() !== "";
    const number = Number(port.value);
    const badPort = wanted && !isPort(number);
    const badToken = wanted && !TOKEN.test(token.value.trim());
    setFault(port, badPort ? text.scope.portWrong : "");
    setFault(token, badToken ? text.scope.tokenWrong : "");
    if (badPort || badToken) throw new Error("");
    const optic = {
      tiltDeg: Number(tilt.value),
      fieldDeg: Math.min(FIELD.most, Math.max(FIELD.least, Number(angle.value) || now.fieldDeg)),
      postDeg: Number(post.value) || 0,
    };
    change({ optic, place: wanted ? { port: number, token: token.value.trim() } : undefined, map: maps.value as MapName });
  });
}
