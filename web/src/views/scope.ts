// #/scope/NAME: what the trainee sees, in full screen. On the station's PC poses come from the station
// itself, so that the network is not between hand and eye; the rest comes from the server.
import { SessionState } from "wire";
import type { View } from "../app";
import { newRow, packView, STATE } from "../history";
import { QUIET_MS } from "../live";
import type { Route } from "../router";
import { routeTo } from "../router";
import { loadKnee, type Knee } from "../scene/anatomy";
import { Arthroscope } from "../scene/arthroscope";
import { Joint } from "../scene/joint";
import { notchAngle, USUAL_OPTIC, type Optic } from "../scene/optic";
import { NoWebGl } from "../scene/view3d";
import { FeedSource, markerAt, noteAt } from "../source";
import { StationView, TOKEN, type ViewPlace } from "../station_view";
import { text } from "../text";
import { broken, empty, everySecond, field, fill, formDialog, h, loading, select, setClass, setFault, setText } from "../ui";


const RATE_HZ = 60;
const NOTE_S = 25; // how long a note is shown
const POST_STEP_DEG = 15;

interface Settings extends Optic {
  place: ViewPlace | undefined;
}

const KEY = "scope";

function kept(): Settings {
  try {
    const found = JSON.parse(localStorage.getItem(KEY) ?? "{}") as Partial<Settings>;
    return { ...USUAL_OPTIC, place: undefined, ...found };
  } catch {
    return { ...USUAL_OPTIC, place: undefined };
  }
}

// What the address says goes before what was kept; the token does not stay in the address.
function settingsOf(route: Route): Settings {
  const settings = kept();
  const { query } = route;
  const port = Number(query.get("port"));
  const token = query.get("token") ?? "";
  if (port > 0 && TOKEN.test(token)) {
    settings.place = { port, token };
    localStorage.setItem(KEY, JSON.stringify(settings));
    history.replaceState(null, "", routeTo(route.name, route.args));
  }
  if (query.has("optic")) settings.tiltDeg = Number(query.get("optic")) || 0;
  return settings;
}

export const scope: View = (root, route, app) => {
  const name = route.args[0] ?? "";
  app.title(text.scope.title(name));
  const picture = new Picture(root, text.scope.title(name));
  let settings = settingsOf(route);
  const source = FeedSource.live(app.feed, name, RATE_HZ);
  let station = settings.place && new StationView(settings.place);
  let knee = "";
  let shown: { joint: Joint; optic: Arthroscope } | undefined;
  let pending = 0;
  let drawnAt = 0; // of the frame before, where it was drawn
  let heard = 0;
  let timing = false;
  const row = newRow();
  const near = newRow(); // of the station's own view

  const drop = (): void => {
    shown?.optic.close();
    shown?.joint.dispose();
    shown = undefined;
  };
  const begin = (made: Knee): void => {
    drop();
    picture.fresh();
    const joint = new Joint(made, true);
    try {
      shown = { joint, optic: new Arthroscope(picture.canvas, joint, settings) };
    } catch (error) {
      if (!(error instanceof NoWebGl)) throw error;
      picture.say(broken(text.session.noScene, text.session.noSceneHint));
      return;
    }
    shown.optic.setSide(picture.side);
    soon();
  };
  const load = (): void => {
    const { session } = source;
    if (!session) return;
    const key = `${session.caseName} ${session.caseHash}`;
    if (key === knee) return;
    knee = key;
    picture.say(loading(text.session.loadingCase(session.caseName)));
    loadKnee(session.caseName, key).then(
      (made) => knee === key && picture.canvas.isConnected && begin(made),
      () => knee === key && picture.say(broken(text.session.noCase, "", () => {
        knee = "";
        load();
      })));
  };

  const soon = (): void => {
    pending ||= requestAnimationFrame((now) => {
      pending = 0;
      draw(now);
    });
  };
  const draw = (now: number): void => {
    if (!shown || document.hidden) return;
    const { history } = source;
    const own = station?.fresh === true;
    if (history.count) history.read(history.count - 1, row);
    if (own) packView(station!.newest!, near);
    else near.set(row);
    for (const group of source.groups()) {
      const tissue = source.tissue(group, Infinity);
      if (tissue) shown.joint.setTissue(group, tissue);
    }
    const remark = markerAt(source, Infinity);
    shown.joint.setMarker(remark?.point && { body: remark.body, point: remark.point });
    shown.joint.paint(now);
    const began = performance.now();
    const seen = shown.optic.draw(near, now / 1000);
    if (now - drawnAt < 250) shown.optic.took(now - drawnAt);
    picture.timed(now - drawnAt, performance.now() - (own ? station!.at : began));
    drawnAt = now;
    if (own) picture.canvas.dataset.drawn = String(station!.newest!.number);
    if (seen) picture.say(undefined);
    else if (history.count) picture.say(empty(text.scope.noScope, text.scope.noScopeHint));
  };

  const showState = (): void => {
    const { history } = source;
    const own = station?.fresh === true;
    const age = own || !heard ? 0 : app.feed.now() - heard;
    const state = history.count ? history.value(history.count - 1, STATE) : undefined;
    picture.sign("stale", age >= QUIET_MS && state !== SessionState.CLOSED ? text.scope.stale(age) : "");
    picture.sign("state", state === SessionState.PAUSED ? text.scope.paused : state === SessionState.CLOSED ? text.scope.closed : "");
    const note = noteAt(source, Infinity);
    const young = note && history.end - Number(note.timeNs) * 1e-9 < NOTE_S;
    picture.sign("note", young ? note.text : "");
    picture.sign("marker", markerAt(source, Infinity) ? text.scope.marker : "");
    const from = own ? text.scope.sources.station : settings.place ? text.scope.sources.trying : text.scope.sources.server;
    picture.sign("source", timing ? `${from} · ${text.scope.optic(settings.tiltDeg)}` : "");
    if (!source.session) picture.say(source.trouble ? empty(text.station.noSession, source.trouble) : loading(text.scope.waiting));
  };

  const change = (next: Settings, keep = true): void => {
    const moved = next.place?.port !== settings.place?.port || next.place?.token !== settings.place?.token;
    settings = next;
    if (keep) localStorage.setItem(KEY, JSON.stringify(settings));
    shown?.optic.setOptic(settings);
    picture.turnNotch(notchAngle(settings));
    if (moved) {
      station?.close();
      station = settings.place && new StationView(settings.place);
      if (station) station.onView = soon;
    }
    showState();
    soon();
  };
  const key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.altKey || event.metaKey || document.querySelector("dialog[open]")) return;
    if (event.key === "f") picture.showTiming((timing = !timing));
    else if (event.key === "o") change({ ...settings, tiltDeg: settings.tiltDeg === 30 ? 70 : 30 });
    else if (event.key === ",") change({ ...settings, postDeg: settings.postDeg - POST_STEP_DEG });
    else if (event.key === ".") change({ ...settings, postDeg: settings.postDeg + POST_STEP_DEG });
    else if (event.key === "s") ask(settings, change);
    else return;
    event.preventDefault();
    showState();
  };

  if (station) station.onView = soon;
  picture.onSide = (side) => {
    shown?.optic.setSide(side);
    soon();
  };
  picture.turnNotch(notchAngle(settings));
  document.addEventListener("keydown", key);
  document.documentElement.classList.add("scope-page");
  const ends = [
    source.onChange((what) => {
      if (what === "session") load();
      if (what === "moment") heard = app.feed.now();
      else showState();
      if (!station?.fresh) soon();
    }),
    everySecond(showState),
    () => document.removeEventListener("keydown", key),
    () => document.documentElement.classList.remove("scope-page"),
    () => cancelAnimationFrame(pending),
    () => station?.close(),
    () => source.close(),
    () => picture.close(),
    drop,
  ];
  return () => {
    for (const end of ends) end();
  };
};

// ---- what is on the screen ----------------------------------------------------------------------------

type Sign = "stale" | "state" | "note" | "marker" | "source";

class Picture {
  canvas = h("canvas", { class: "scope-canvas", role: "img", "aria-label": text.scope.picture });
  side = 0;
  onSide: (side: number) => void = () => {};
  private readonly round: HTMLElement;
  private readonly notch = h("i", { class: "scope-notch", "aria-hidden": "true" });
  private readonly state = h("div", { class: "scope-state" });
  private readonly timing = h("p", { class: "scope-timing number", hidden: true });
  private readonly signs: Record<Sign, HTMLElement>;
  private readonly size: ResizeObserver;
  private told: HTMLElement | undefined;
  private frames: number[] = [];
  private toldAt = 0;

  constructor(private readonly root: HTMLElement, name: string) {
    const sign = (kind: Sign): HTMLElement => h("p", { class: `scope-sign ${kind}`, role: "status" });
    this.signs = { stale: sign("stale"), state: sign("state"), note: sign("note"), marker: sign("marker"), source: sign("source") };
    this.round = h("div", { class: "scope-round" }, this.canvas, h("i", { class: "scope-edge", "aria-hidden": "true" }), this.notch);
    root.append(this.round, this.state, h("div", { class: "scope-top" }, this.signs.stale, this.signs.state),
      h("div", { class: "scope-bottom" }, this.signs.marker, this.signs.note), h("div", { class: "scope-corner" }, this.signs.source, this.timing),
      h("h1", { class: "unseen" }, name), h("p", { class: "unseen" }, text.scope.keys));
    this.size = new ResizeObserver(() => this.measure());
    this.size.observe(root);
    this.measure();
  }

  close(): void {
    this.size.disconnect();
  }

  /** A canvas that no renderer has had. */
  fresh(): void {
    const next = this.canvas.cloneNode() as HTMLCanvasElement;
    this.canvas.replaceWith(next);
    this.canvas = next;
  }

  private measure(): void {
    const side = Math.floor(Math.min(this.root.clientWidth, this.root.clientHeight));
    if (side === this.side || side <= 0) return;
    this.side = side;
    this.round.style.width = this.round.style.height = `${side}px`;
    this.onSide(side);
  }

  /** Instead of the picture; undefined: the picture. */
  say(what: HTMLElement | undefined): void {
    if (what === undefined && this.told === undefined) return;
    if (what && this.told?.textContent === what.textContent) return;
    this.told = what;
    fill(this.state, what);
    setClass(this.round, "dark", what !== undefined);
  }

  sign(kind: Sign, words: string): void {
    setText(this.signs[kind], words);
  }

  turnNotch(angle: number): void {
    this.notch.style.transform = `rotate(${angle}rad)`;
  }

  showTiming(on: boolean): void {
    this.timing.hidden = !on;
  }

  timed(ms: number, ageMs: number): void {
    if (this.timing.hidden || ms > 1000) return;
    this.frames.push(ms);
    const now = performance.now();
    if (now - this.toldAt < 500) return;
    const mean = this.frames.reduce((sum, one) => sum + one, 0) / this.frames.length;
    setText(this.timing, text.scope.frame(mean.toFixed(1), Math.max(...this.frames).toFixed(1), Math.max(0, ageMs).toFixed(1)));
    this.frames = [];
    this.toldAt = now;
  }
}

function ask(now: Settings, change: (next: Settings) => void): void {
  const port = h("input", { inputmode: "numeric", value: now.place?.port ?? "", autocomplete: "off" });
  const token = h("input", { value: now.place?.token ?? "", autocomplete: "off", spellcheck: "false", class: "mono" });
  const tilt = select([["0", text.scope.optic(0)], ["30", text.scope.optic(30)], ["70", text.scope.optic(70)]], String(now.tiltDeg));
  const angle = h("input", { type: "number", min: 40, max: 120, step: 5, value: now.fieldDeg });
  const post = h("input", { type: "number", min: -180, max: 180, step: POST_STEP_DEG, value: now.postDeg });
  formDialog(text.scope.settings, [
    field(text.scope.tilt, tilt), field(text.scope.field, angle), field(text.scope.post, post, text.scope.postHint),
    field(text.scope.port, port, text.scope.portHint), field(text.scope.token, token, text.scope.tokenHint),
  ], text.save, async () => {
    const wanted = port.value.trim() !== "";
    const number = Number(port.value);
    const badPort = wanted && !(Number.isInteger(number) && number > 0 && number < 65536);
    const badToken = wanted && !TOKEN.test(token.value.trim());
    setFault(port, badPort ? text.scope.portWrong : "");
    setFault(token, badToken ? text.scope.tokenWrong : "");
    if (badPort || badToken) throw new Error("");
    change({
      tiltDeg: Number(tilt.value),
      fieldDeg: Math.min(120, Math.max(40, Number(angle.value) || USUAL_OPTIC.fieldDeg)),
      postDeg: Number(post.value) || 0,
      place: wanted ? { port: number, token: token.value.trim() } : undefined,
    });
  });
}
