// What a page knows of one session, live or recorded: its moments, meshes, events, remarks, markers and figures,
// each with its time. Views show any of it at any time; where it comes from is the same for all of them.
import { create } from "@bufbuild/protobuf";
import {
  MeshAskSchema, MeshStateSchema, Trouble_Kind, Validity, Watch_What, Why_Code,
  type AttemptState, type LiveSession, type Marker, type Metric, type Moment, type Place, type Remark, type Resection,
} from "wire";
import { lastBefore } from "./axes";
import { whyOf } from "./explain";
import { History, LIVE_LIMITS, type Limits } from "./history";
import { FIRST_INSTRUMENT, instrumentsOf, nameOf, type Instruments } from "./instruments";
import { Batch, type Feed, type WatchInit } from "./live";
import type { Tissue } from "./mesh";
import { LIVE_MESH_BYTES, Meshes, MeshHistory, type Answer } from "./meshes";
import { text } from "./text";

export type Change = "session" | "moment" | "mesh" | "resection" | "remark" | "marker" | "metrics" | "progress" | "trouble" | "device";

// Of each bit of Reply.events.
export const EVENTS = ["state", "deviceLost", "deviceBack", "contact", "release", "cut", "piece", "refused", "undone", "grasped", "dropped", "takenOut"] as const;
export type EventName = (typeof EVENTS)[number];

export interface TimedEvent {
  time: number; // s
  event: EventName;
  times: number; // how often between this moment and the one before
  devices?: readonly string[]; // that were lost, or came back, where that is known
}

/** What a device of the station marked: a button, a coil, a register. */
export interface TimedMarker {
  time: number; // s; one may come late
  words: string;
}

export interface TimedResection {
  time: number;
  resection: Resection;
}

/** A remark as it stood from a time on; one that was changed since stands more than once. */
export interface RemarkChange {
  from: number;
  remark: Remark;
}

// A record does not have the devices' names: what they measured is lost.
function lostParts({ instruments, jointValidity }: Moment, all: Instruments): Set<string> {
  const lost = instruments.filter(({ validity }) => validity === Validity.LOST).map(({ channel }) => nameOf(all[channel - FIRST_INSTRUMENT]) ?? text.session.instrument);
  return new Set(jointValidity === Validity.LOST ? [...lost, text.session.joint] : lost);
}

const EVENTS_MOST = 20_000; // the oldest go
const MARKERS_MOST = 20_000; // too
const NAMED_S = 3; // a place comes each second, and its devices may be lost before it or after
const RESECTIONS_MOST = 4000; // of a live session: of the older ones some go

export interface Source {
  readonly recorded: boolean;
  readonly session: LiveSession | undefined;
  readonly history: History;
  readonly events: readonly TimedEvent[];
  readonly resections: readonly TimedResection[];
  readonly remarks: readonly Remark[]; // as they are in the end, by rising number
  readonly remarkChanges: readonly RemarkChange[]; // as they came
  readonly markers: readonly TimedMarker[]; // by rising time
  readonly metrics: readonly Metric[];
  readonly progress: number; // of a recorded session, 0 to 1; 1: all is here
  readonly trouble: string;
  /** Names of the groups whose mesh has come. */
  groups(): string[];
  /** A group's mesh at a time of the session, good until the next call. */
  tissue(group: string, time: number): Tissue | undefined;
  /** Returns what ends it. */
  onChange(listener: (change: Change) => void): () => void;
  close(): void;
}

/** The figures of each group at a time. */
export function resectionsAt(source: Source, time: number): Map<string, Resection> {
  const found = new Map<string, Resection>();
  for (const { time: at, resection } of source.resections) {
    if (at > time) break;
    found.set(resection.group, resection);
  }
  return found;
}

// As they stood at a time.
function remarksAt(source: Source, time: number): Iterable<Remark> {
  const found = new Map<bigint, Remark>();
  for (const { from, remark } of source.remarkChanges) if (from <= time) found.set(remark.number, remark);
  return found.values();
}

/** The marker that is to be touched at a time; undefined: none. */
export function markerAt(source: Source, time: number): Remark | undefined {
  let found: Remark | undefined;
  for (const remark of remarksAt(source, time)) if (remark.hasMarker) found = remark.withdrawn ? undefined : remark;
  return found;
}

/** The last note at a time. */
export function noteAt(source: Source, time: number): Remark | undefined {
  let found: Remark | undefined;
  for (const remark of remarksAt(source, time)) if (remark.text && !remark.withdrawn) found = remark;
  return found;
}

/** What a source needs of a feed. */
type Said = Pick<Feed, "on" | "onLink" | "watch" | "unwatch" | "send">;

export class FeedSource implements Source {
  session: LiveSession | undefined;
  readonly history: History;
  events: TimedEvent[] = [];
  resections: TimedResection[] = [];
  remarks: Remark[] = [];
  remarkChanges: RemarkChange[] = [];
  markers: TimedMarker[] = [];
  metrics: Metric[] = [];
  progress = 0;
  trouble = "";
  note = ""; // about a live session that goes on
  refused = false; // what is asked for is not there, or not for this account

  private noteAbout: Why_Code | undefined;
  private readonly meshes = new Meshes();
  private readonly meshHistories = new Map<string, MeshHistory>();
  private readonly listeners = new Set<(change: Change) => void>();
  private counts: number[] | undefined; // of events, at the last moment
  private lostDevices: ReadonlySet<string> | undefined; // at the last place
  private resectionSpacing = 0.5; // between the older figures of a live session, s
  private readonly ends: (() => void)[];

  private constructor(private readonly feed: Said, readonly recorded: boolean, watch: WatchInit, limits?: Limits) {
    this.history = new History(limits);
    this.meshes.onPayload = (group, tissue, payload, mismatchSize) => this.keepMesh(group, tissue, payload, mismatchSize);
    this.ends = [
      feed.onLink(({ state }) => {
        if (state === "open") this.note = ""; // the server repeats it if it still holds
      }),
      feed.on("session", (session) => this.begin(session)),
      feed.on("moment", (moment) => this.take(moment)),
      feed.on("place", (place) => this.nameDevices(place)),
      feed.on("meshChunk", (chunk) => this.answer(this.meshes.chunk(chunk))),
      feed.on("resection", (resection) => this.addResection(resection)),
      feed.on("remark", (remark) => this.remarked(remark)),
      feed.on("marker", (marker) => this.marked(marker)),
      feed.on("metrics", ({ metrics }) => this.set("metrics", () => (this.metrics = metrics))),
      feed.on("progress", ({ share, done }) => this.progressed(share, done)),
      feed.on("trouble", ({ text: said, kind, why }) => this.troubled(whyOf(why, said), kind, why?.code)),
    ];
    feed.watch(watch);
  }

  /** What is kept is bounded: of older moments, meshes and figures only some. */
  static live(feed: Feed, station: string, rateHz: number, limits = LIVE_LIMITS): FeedSource {
    return new FeedSource(feed, false, { what: Watch_What.STATION, station, rateHz, meshes: true, mismatch: true }, limits);
  }

  /** caseName: another case to replay the same hands on; "": its own. */
  static recorded(feed: Feed, session: string, rateHz: number, caseName = ""): FeedSource {
    return new FeedSource(feed, true, { what: Watch_What.RECORDED, session, caseName, rateHz, meshes: true, mismatch: true });
  }

  /** What the items of an encoded LiveBatch say, all at once. Undefined: it cannot be read. */
  static batch(bytes: Uint8Array): { source: FeedSource; attempt: AttemptState | undefined } | undefined {
    const batch = Batch.of(bytes);
    if (!batch) return undefined;
    let attempt: AttemptState | undefined;
    const source = new FeedSource(batch, true, {});
    batch.on("attempt", (told) => (attempt = told));
    batch.play();
    return { source, attempt };
  }

  close(): void {
    for (const end of this.ends) end();
    this.listeners.clear();
    this.feed.unwatch();
  }

  groups(): string[] {
    return [...this.meshHistories.keys()];
  }

  tissue(group: string, time: number): Tissue | undefined {
    return time >= this.history.end ? this.meshes.tissue(group) : this.meshHistories.get(group)?.at(time);
  }

  onChange(listener: (change: Change) => void): () => void {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  }

  private tell(change: Change): void {
    for (const listener of this.listeners) listener(change);
  }

  private set(change: Change, what: () => void): void {
    what();
    this.tell(change);
  }

  // The same live session goes on where it was after a reconnect; a recorded one is sent afresh.
  private begin(session: LiveSession): void {
    if (!session.caseName) {
      this.none();
      return;
    }
    const same = !this.recorded && this.session !== undefined && session.caseHash === this.session.caseHash &&
      session.id.join() === this.session.id.join();
    this.session = session;
    this.history.instruments = instrumentsOf(session.instruments);
    this.history.loose = session.loose.length > 0;
    this.trouble = "";
    if (this.noteAbout === Why_Code.SERVER_AWAY) this.note = ""; // it is back
    this.refused = false;
    if (!same) this.clear();
    this.answer(this.meshes.open());
    this.tell("session");
  }

  private troubled(words: string, kind: Trouble_Kind, about?: Why_Code): void {
    if (kind === Trouble_Kind.NOTE && !this.recorded) {
      this.noteAbout = about;
      this.set("trouble", () => (this.note = words));
      return;
    }
    this.trouble = words;
    this.refused = kind === Trouble_Kind.NOT_THERE;
    if (this.refused) { // another's session is there now
      this.session = undefined;
      this.clear();
    }
    this.tell("trouble");
  }

  // A station that has no session.
  private none(): void {
    this.session = undefined;
    this.clear();
    this.trouble = text.station.noSessionHint;
    this.refused = false;
    this.tell("session");
  }

  private clear(): void {
    this.history.clear();
    this.meshes.clear();
    this.meshHistories.clear();
    this.events = [];
    this.resections = [];
    this.resectionSpacing = 0.5;
    this.remarks = [];
    this.remarkChanges = [];
    this.markers = [];
    this.metrics = [];
    this.progress = 0;
    this.counts = this.recorded ? [] : undefined;
    this.lostDevices = undefined;
  }

  private take(moment: Moment): void {
    if (!this.recorded && this.session && moment.stationNumber !== this.session.stationNumber) return;
    if (!this.history.append(moment)) return;
    this.settle();
    if (!this.recorded && this.history.count === 1) for (const resected of this.resections) resected.time = this.history.start; // their time is unknown
    this.count(moment.events);
    if (this.recorded) this.nameLost(lostParts(moment, this.history.instruments));
    this.tell("moment");
  }

  // In a record what a cut did comes right before the moment at which it landed.
  private get arrivalTime(): number {
    return this.recorded ? Infinity : this.history.end;
  }

  private keepMesh(group: string, tissue: Tissue, payload: Uint8Array, mismatchSize: number): void {
    const landed = this.meshHistories.get(group) ?? new MeshHistory(this.recorded ? Infinity : LIVE_MESH_BYTES);
    this.meshHistories.set(group, landed);
    landed.push(this.arrivalTime, tissue, payload, mismatchSize);
    this.tell("mesh");
  }

  private addResection(resection: Resection): void {
    this.resections.push({ time: this.arrivalTime, resection });
    if (!this.recorded && this.resections.length > RESECTIONS_MOST) this.thinResections();
    this.tell("resection");
  }

  // Of each group the newest stay, and of those before as many as are further apart.
  private thinResections(): void {
    const older = this.resections.slice(0, -RESECTIONS_MOST / 2);
    while (older.length > RESECTIONS_MOST / 4) {
      this.resectionSpacing *= 2;
      const kept = new Map<string, number>();
      const left = older.splice(0).filter(({ time, resection: { group } }) => {
        if (time - (kept.get(group) ?? -Infinity) < this.resectionSpacing) return false;
        kept.set(group, time);
        return true;
      });
      older.push(...left);
    }
    this.resections = [...older, ...this.resections.slice(-RESECTIONS_MOST / 2)];
  }

  private settle(): void {
    for (const landed of this.meshHistories.values()) landed.settle(this.history.end);
    for (let i = this.resections.length; i-- > 0 && this.resections[i]!.time === Infinity; ) this.resections[i]!.time = this.history.end;
  }

  // All of a record is here: a lost connection is none of its business any more.
  private progressed(share: number, done: boolean): void {
    this.progress = done ? 1 : Math.min(share, 0.999);
    if (done) this.settle();
    if (done && this.recorded) this.feed.unwatch();
    this.tell("progress");
  }

  // Events before the page was opened are counted, but their time is unknown.
  private count(counts: number[]): void {
    const before = this.counts ?? counts;
    counts.forEach((count, bit) => {
      const times = count - (before[bit] ?? 0);
      const event = EVENTS[bit];
      if (times > 0 && event) this.events.push({ time: this.history.end, event, times });
    });
    this.counts = [...counts];
    if (this.events.length > EVENTS_MOST) this.events = this.events.slice(EVENTS_MOST / 2);
  }

  // A place tells each second which devices are lost; a moment counts only how many.
  private nameDevices({ stationNumber, devices }: Place): void {
    if (this.recorded || stationNumber !== this.session?.stationNumber) return;
    this.nameLost(new Set(devices.filter((device) => device.lost).map(({ name }) => name)));
  }

  private nameLost(lost: ReadonlySet<string>): void {
    const before = this.lostDevices;
    this.lostDevices = lost;
    if (!before) return;
    const changes = { deviceLost: [...lost].filter((name) => !before.has(name)), deviceBack: [...before].filter((name) => !lost.has(name)) };
    for (const [event, names] of Object.entries(changes)) {
      const at = this.events.map((one) => one.event === event && !one.devices && this.history.end - one.time < NAMED_S).lastIndexOf(true);
      if (!names.length || at < 0) continue;
      this.events[at] = { ...this.events[at]!, devices: names };
      this.tell("device");
    }
  }

  // One that is changed keeps its number and its time: the change is of now.
  private remarked(remark: Remark): void {
    const at = this.remarks.findIndex(({ number }) => number === remark.number);
    const since = Number(remark.timeNs) * 1e-9;
    this.remarkChanges.push({ from: at < 0 ? since : Math.max(since, this.history.end), remark });
    if (at < 0) this.remarks.push(remark);
    else this.remarks[at] = remark;
    this.tell("remark");
  }

  private marked({ timeNs, name, device, value }: Marker): void {
    const time = Number(timeNs) * 1e-9;
    const at = lastBefore(this.markers.length, (index) => this.markers[index]!.time, time);
    this.markers.splice(at + 1, 0, { time, words: text.session.markerOf(name, device, value) });
    if (this.markers.length > MARKERS_MOST) this.markers = this.markers.slice(MARKERS_MOST / 2);
    this.tell("marker");
  }

  private answer(answer: Answer | null): void {
    if (!answer || this.recorded) return;
    if ("ack" in answer) this.feed.send({ case: "meshAck", value: create(MeshStateSchema, answer.ack) });
    else this.feed.send({ case: "meshAsk", value: create(MeshAskSchema, { have: answer.ask }) });
  }
}
