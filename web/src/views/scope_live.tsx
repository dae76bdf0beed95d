// What the scope of a live session shows: poses from the station itself where it sends any, the rest from the server.
// A pose is drawn and no component is made anew for it; what is said beside the picture are signals.
import { signal } from "@preact/signals";
import { SessionState } from "wire";
import type { App } from "../app";
import { BUTTONS, INSTRUMENTS, NEWEST_LIMITS, newRow, packView, sameRow, STATE, toolAt, type Row } from "../history";
import { announcer, Empty, Loading } from "../kit";
import { QUIET_MS } from "../live";
import type { MapName } from "../scene/colours";
import { carryLoose } from "../scene/loose";
import type { Optic } from "../scene/optic";
import { opticOf, ScopeStage } from "../scope_stage";
import { FeedSource, markerAt, noteAt, type Change } from "../source";
import { StationView, type ViewAddress } from "../station_view";
import { text } from "../text";
import { chosen, keep, opticWith, type Choice, type Settings } from "./scope_settings";

const RATE_HZ = 60;
const NOTE_S = 25; // how long a note is shown
const TOLD_MS = 500; // between two figures of the frame time

/** A scope within another page: it shows that page's source, which goes on after it. */
export interface ScopePlace {
  source: FeedSource;
  plain: boolean; // no colours of touch and sight: an exam gives no hints
}

export type Sign = "stale" | "state" | "note" | "marker" | "source";

export class LiveScope {
  readonly stage: ScopeStage;
  readonly signs: Readonly<Record<Sign, ReturnType<typeof signal<string>>>> = { stale: signal(""), state: signal(""), note: signal(""), marker: signal(""), source: signal("") };
  readonly map = signal<MapName>("none"); // it hides the tissue, so each visit begins without
  readonly timing = signal<string | undefined>(undefined); // undefined: not asked for
  private readonly source: FeedSource;
  private station: StationView | undefined;
  private pending = 0;
  private drawnAt = 0; // when the picture before was drawn
  private heard = 0; // when the last moment came
  private frames: number[] = []; // ms, since the frame time was told
  private toldAt = 0;
  private readonly tell = announcer();
  private readonly tellMap = announcer();
  private readonly row = newRow(); // of the server
  private readonly near = newRow(); // the poses to draw: the station's own if it sends any, else the server's
  private readonly drawn = newRow();
  private dirty = true; // something other than poses has changed
  private settling = false; // light alone goes on

  /** It watches from now on. `settings`: as they were kept. */
  constructor(private readonly name: string, private readonly app: App, private settings: Settings, private readonly place: ScopePlace | undefined) {
    this.source = place?.source ?? FeedSource.live(app.feed, name, RATE_HZ, NEWEST_LIMITS);
    this.stage = new ScopeStage(this.optic, () => this.begin());
  }

  /** Returns what ends it. */
  open(): () => void {
    this.watchStation();
    const end = this.source.onChange((change) => this.changed(change));
    const timer = setInterval(() => this.showState(), 1000);
    this.showState();
    if (this.place) this.changed("session");
    return () => {
      end();
      clearInterval(timer);
      cancelAnimationFrame(this.pending);
      this.station?.close();
      if (!this.place) this.source.close();
    };
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

  get optic(): Optic {
    return opticWith(this.settings, opticOf(this.source.session));
  }

  private changed(change: Change): void {
    const { session } = this.source;
    if (change === "session" && session) {
      this.stage.setOptic(this.optic);
      this.stage.load(session);
    }
    if (change === "moment") this.heard = this.app.feed.now();
    else this.showState();
    if (!this.own) this.soon(change !== "moment");
  }

  private begin(): void {
    this.stage.shown?.optic.setMap(this.map.value);
    this.soon();
  }

  // ---- a picture -------------------------------------------------------------------------------------

  /** Draws in the next frame. If only a moment came (`changed` false), draws only if its poses differ from those drawn. */
  private soon(changed = true): void {
    this.dirty ||= changed;
    this.pending ||= requestAnimationFrame((now) => {
      this.pending = 0;
      if (!document.hidden) this.draw(now);
    });
  }

  private draw(now: number): void {
    const { shown } = this.stage;
    const { history, session } = this.source;
    if (!session || !shown) return; // the message shown instead stays
    const station = this.own;
    if (history.count) history.read(history.count - 1, this.row);
    if (station) {
      packView(station.newest!, this.near);
      carryLoose(this.row, this.near);
    } else this.near.set(this.row);
    const stands = !this.dirty && sameRow(this.near, this.drawn) && !runs(this.near);
    if (stands && !this.settling) return;
    if (!stands) shown.optic.resolution.move();
    this.render(now);
    if (station) this.stage.canvas.dataset.drawn = String(station.newest!.number);
  }

  private render(now: number): void {
    const { shown } = this.stage;
    if (!shown || !this.source.session) return;
    const { joint, optic } = shown;
    for (const group of this.source.groups()) {
      const tissue = this.source.tissue(group, Infinity);
      if (tissue) joint.setTissue(group, tissue);
    }
    const remark = this.place?.plain ? undefined : markerAt(this.source, Infinity);
    joint.setMarker(remark?.point && { body: remark.body, point: remark.point });
    joint.setLoose(this.source.session.loose);
    const more = joint.paint(now);
    optic.setInstruments(this.source.history.instruments);
    const seen = optic.draw(this.near, now / 1000);
    this.drawn.set(this.near);
    this.dirty = false;
    optic.resolution.drawn(now);
    this.timed(now - this.drawnAt, performance.now() - (this.own?.at ?? now));
    this.drawnAt = now;
    if (seen) this.stage.showPicture();
    else if (this.source.history.count) this.sayInstead();
    this.settling = seen && !optic.settled;
    if (more || this.settling) this.soon(more);
    else optic.resolution.rest(() => this.render(performance.now()));
  }

  private timed(ms: number, ageMs: number): void {
    if (this.timing.value === undefined || ms > 1000) return;
    this.frames.push(ms);
    const now = performance.now();
    if (now - this.toldAt < TOLD_MS) return;
    const mean = this.frames.reduce((sum, one) => sum + one, 0) / this.frames.length;
    this.timing.value = text.scope.frame(mean.toFixed(1), Math.max(...this.frames).toFixed(1), Math.max(0, ageMs).toFixed(1));
    this.frames = [];
    this.toldAt = now;
  }

  // ---- words -----------------------------------------------------------------------------------------

  /** Why there is no picture. */
  private sayInstead(): void {
    const words = text.scope;
    const state = this.row[STATE];
    const [title, hint] = state === SessionState.WAITING ? [words.notStarted, words.notStartedHint]
      : state === SessionState.CLOSED ? [words.closed, words.closedHint] : [words.noScope, words.noScopeHint];
    this.stage.say(title, () => <Empty title={title} hint={hint} />);
  }

  private sayNoSession(): void {
    const { trouble, refused } = this.source;
    if (!trouble) this.stage.say("waiting", () => <Loading what={text.scope.waiting} />);
    else this.stage.say(`${refused} ${trouble}`, () => refused ? <Empty title={trouble} /> : <Empty title={text.station.noSession} hint={trouble} />);
  }

  private showState(): void {
    const { source, signs } = this;
    const { history } = source;
    const own = this.own !== undefined;
    const age = own || !this.heard || !history.count ? 0 : this.app.feed.now() - this.heard;
    const state = history.count ? history.value(history.count - 1, STATE) : undefined;
    const lost = this.app.feed.lostMs();
    const old = age >= QUIET_MS && state !== SessionState.CLOSED;
    const stale = lost !== undefined ? text.station.lost(lost) : old ? text.scope.stale(age) : "";
    signs.stale.value = stale;
    this.tell(lost !== undefined ? "lost" : old ? "stale" : "", stale || text.link.open);
    signs.state.value = state === SessionState.PAUSED ? text.scope.paused : state === SessionState.CLOSED ? text.scope.closed : "";
    const note = noteAt(source, Infinity);
    signs.note.value = note && history.end - Number(note.timeNs) * 1e-9 < NOTE_S ? note.text : "";
    signs.marker.value = markerAt(source, Infinity) ? text.scope.marker : "";
    const from = own ? text.scope.sources.station : this.settings.place ? text.scope.sources.trying : text.scope.sources.server;
    signs.source.value = this.timing.value === undefined ? "" : `${from} · ${text.scope.optic(this.optic.tiltDeg)}`;
    if (!source.session) this.sayNoSession();
  }

  // ---- choices ---------------------------------------------------------------------------------------

  get choice(): Choice {
    return { optic: this.optic, place: this.settings.place, map: this.place?.plain ? undefined : this.map.value };
  }

  chooseOptic(optic: Optic): void {
    this.choose(optic, this.settings.place);
  }

  choose(optic: Optic, place: ViewAddress | undefined): void {
    const moved = place?.port !== this.settings.place?.port || place?.token !== this.settings.place?.token;
    this.settings = chosen(optic, opticOf(this.source.session), place);
    keep(this.name, this.settings);
    this.stage.setOptic(this.optic);
    if (moved) this.watchStation();
    this.showState();
    this.soon();
  }

  colour(map: MapName): void {
    if (map === this.map.value) return;
    this.map.value = map;
    this.stage.shown?.optic.setMap(map);
    this.tellMap(map, text.scope.colours(text.session.maps[map]));
    this.soon();
  }

  turnTiming(): void {
    this.timing.value = this.timing.value === undefined ? "" : undefined;
    this.showState();
  }
}

function runs(row: Row): boolean {
  for (let instrument = 0; instrument < INSTRUMENTS; instrument++) if (row[toolAt(instrument) + BUTTONS]! !== 0) return true;
  return false;
}
