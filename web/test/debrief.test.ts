import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import {
  LiveSessionSchema, MeshChunkSchema, MetricsSchema, MomentSchema, RemarkSchema, ReplayProgressSchema, ResectionSchema, SessionState, Trouble_Kind, TroubleSchema,
} from "wire";
import { Removed } from "../src/removed";
import { bySubject, distributionOf, quantile, spreadOf, type Distribution } from "../src/distribution";
import { HAS_WARPED, STATE, toolAt, WARPED } from "../src/history";
import type { Feed } from "../src/live";
import { Tissue } from "../src/mesh";
import { inBursts, withBlinks } from "../src/panels";
import { FeedSource, markerAt, noteAt, resectionsAt, type TimedEvent } from "../src/source";
import { bandsOf, firstOf, nextStop, Player, stopsOf } from "../src/playback";
import { steps } from "./meshes";

// ---- the time of a replay --------------------------------------------------------------------------------

test("a replay runs on at its speed, and waits for what has not come", () => {
  const player = new Player();
  player.advance(1, 10, true);
  assert.equal(player.time, 0); // it stands still
  player.toggle(0, 10, false);
  player.speed = 4;
  player.advance(0.5, 10, false);
  assert.equal(player.time, 2);
  player.advance(5, 10, false);
  assert.deepEqual([player.time, player.waiting, player.playing], [10, true, true]);
  player.advance(0.5, 30, false);
  assert.deepEqual([player.time, player.waiting], [12, false]);
  player.advance(60, 30, true);
  assert.deepEqual([player.time, player.playing], [30, false]);
  player.toggle(3, 30, true); // from the start again
  assert.deepEqual([player.time, player.playing], [3, true]);
});

test("a replay is put nowhere outside the session, and has a slowest and a fastest speed", () => {
  const player = new Player();
  player.seek(99, 0, 20);
  assert.equal(player.time, 20);
  player.seek(-5, 1, 20);
  assert.equal(player.time, 1);
  for (let i = 0; i < 9; i++) player.shift(1);
  assert.equal(player.speed, 8);
  for (let i = 0; i < 9; i++) player.shift(-1);
  assert.equal(player.speed, 0.25);
});

const mark = (time: number, event: TimedEvent["event"], times = 1): TimedEvent => ({ time, event, times });

test("jumps go to what happened and was said, not to touches, nor twice to one moment", () => {
  const stops = stopsOf([mark(1, "state"), mark(2, "contact"), mark(3, "cut"), mark(3.01, "piece"), mark(7, "refused")], [5]);
  assert.deepEqual(stops, [1, 3, 5, 7]);
  assert.equal(nextStop(stops, 3, 1), 5);
  assert.equal(nextStop(stops, 3, -1), 1);
  assert.equal(nextStop(stops, 4.9, -1), 3);
  assert.equal(nextStop(stops, 7, 1), undefined);
  assert.equal(nextStop(stops, 0.5, -1), undefined);
});

test("the same event again and again within a second is one in the list", () => {
  assert.deepEqual(inBursts([mark(1, "cut"), mark(1.6, "cut", 2), mark(2.4, "cut"), mark(4, "cut"), mark(4.1, "piece"), mark(4.2, "cut")]),
    [mark(1, "cut", 4), mark(4, "cut"), mark(4.1, "piece"), mark(4.2, "cut")]);
});

test("devices that are back within a second are one line with their loss", () => {
  const blink = { ...mark(1, "deviceLost", 2), blink: true };
  assert.deepEqual(withBlinks([mark(1, "deviceLost", 2), mark(1.4, "deviceBack", 2)]), [blink]);
  for (const apart of [[mark(1, "deviceLost"), mark(2.4, "deviceBack")], [mark(1, "deviceLost", 2), mark(1.4, "deviceBack")],
    [mark(1, "deviceLost"), mark(1.2, "cut"), mark(1.4, "deviceBack")], [mark(1, "deviceBack"), mark(1.4, "deviceLost")]])
    assert.deepEqual(withBlinks(apart), apart);
});

// ---- a record, as it comes -------------------------------------------------------------------------------

class Played {
  unwatched = 0;
  sent = 0;
  private readonly listeners = new Map<string, (value: never) => void>();
  readonly source: FeedSource;

  constructor(live = false) {
    const feed = this as unknown as Feed;
    this.source = live ? FeedSource.live(feed, "bay-1", 60) : FeedSource.recorded(feed, "0".repeat(32), 60);
  }

  onLink(listener: (link: object) => void): () => void {
    return this.on("link", listener);
  }

  on(kind: string, listener: (value: never) => void): () => void {
    this.listeners.set(kind, listener);
    return () => {};
  }
  watch(): void {}
  unwatch(): void {
    this.unwatched++;
  }
  send(): boolean {
    this.sent++;
    return true;
  }
  tell(kind: string, value: object): void {
    this.listeners.get(kind)!(value as never);
  }

  session(): void {
    this.tell("session", create(LiveSessionSchema, { stationNumber: 3, id: new Uint8Array(16), caseName: "tear-radial", recorded: true, lengthNs: 10_000_000_000n }));
  }
  moment(time: number, events: number[] = [], state = 1): void {
    this.tell("moment", create(MomentSchema, { timeNs: BigInt(Math.round(time * 1e9)), events, state }));
  }
  cut(base: number, number: number, payload: Uint8Array, volumeMm3: number): void {
    this.tell("meshChunk", create(MeshChunkSchema, { group: "meniscus_medial", base, number, size: payload.length, index: 0, data: payload }));
    this.tell("resection", create(ResectionSchema, { group: "meniscus_medial", meshNumber: number, volumeMm3 }));
  }
}

test("what a cut did has the time of the moment that comes after it", () => {
  const played = new Played();
  const { source } = played;
  const [first, second] = steps();
  played.session();
  played.cut(0, first!.number, first!.payload, 100);
  played.moment(0.5, [1]);
  played.moment(1, [1]);
  played.cut(first!.number, second!.number, second!.payload, 90);
  assert.equal(source.tissue("meniscus_medial", 1), source.tissue("meniscus_medial", 2)); // the newest
  played.moment(1.25, [1, 0, 0, 0, 0, 1]);
  played.moment(2, [2, 0, 0, 2, 0, 1], 2);

  assert.deepEqual(source.resections.map(({ time }) => time), [0.5, 1.25]);
  assert.equal(resectionsAt(source, 1.2).get("meniscus_medial")?.volumeMm3, 100);
  assert.equal(source.tissue("meniscus_medial", 1.2)?.number, first!.number);
  assert.equal(source.tissue("meniscus_medial", 1.25)?.number, second!.number);
  assert.deepEqual(source.events.map(({ time, event }) => [time, event]), [[0.5, "state"], [1.25, "cut"], [2, "state"], [2, "contact"]]);
  assert.equal(source.history.value(3, STATE), 2);
  assert.equal(played.sent, 0); // nothing is asked for in a replay
});

test("removed tissue is plotted for the group that it is of, of other groups together", () => {
  const played = new Played();
  const removed = new Removed(played.source);
  played.session();
  const cut = (time: number, group: string, removedMm3: number, piecesMm3 = 0): void => {
    played.tell("resection", create(ResectionSchema, { group, removedMm3, piecesMm3 }));
    played.moment(time);
  };
  cut(1, "meniscus_lateral", 2);
  cut(2, "acl", 5, 1);
  cut(3, "meniscus_medial", 3);
  cut(4, "cartilage_tibia", 10);
  cut(5, "acl", 7);
  assert.deepEqual([0, 1, 2].map((trace) => removed.of(trace).map(({ time, mm3 }) => [time, mm3])), [[[3, 3]], [[1, 2]], [[2, 6], [4, 16], [5, 17]]]);
  played.session();
  assert.deepEqual([0, 1, 2].map((trace) => removed.of(trace).length), [0, 0, 0]);
});

test("a marker is where it was at the time, and a note that is withdrawn is none from then on", () => {
  const played = new Played();
  const { source } = played;
  const say = (number: number, time: number, change: object): void =>
    played.tell("remark", create(RemarkSchema, { number: BigInt(number), timeNs: BigInt(time * 1e9), ...change }));
  const marked = (time: number): number | undefined => markerAt(source, time)?.point?.x;
  played.session();
  played.moment(1);
  say(1, 1, { hasMarker: true, point: { x: 11 } });
  say(2, 1, { text: "slower" });
  played.moment(2);
  say(1, 1, { hasMarker: true, point: { x: 12 } });
  played.moment(3);
  say(1, 1, { hasMarker: true, point: { x: 12 }, withdrawn: true });
  say(2, 1, { text: "slower", withdrawn: true });
  played.moment(4);
  assert.deepEqual([0.5, 1.5, 2.5, 3.5, Infinity].map(marked), [undefined, 11, 12, undefined, undefined]);
  assert.deepEqual([0.5, 2.5, 3.5].map((time) => noteAt(source, time)?.text), [undefined, "slower", undefined]);
  assert.deepEqual(source.remarks.map(({ withdrawn }) => withdrawn), [true, true]);
});

test("a record that is here stays, whatever becomes of the connection", () => {
  const played = new Played();
  played.session();
  played.moment(0);
  played.tell("progress", create(ReplayProgressSchema, { share: 1 }));
  assert.deepEqual([played.source.progress, played.unwatched], [0.999, 0]);
  played.tell("progress", create(ReplayProgressSchema, { share: 1, done: true }));
  assert.deepEqual([played.source.progress, played.unwatched, played.source.history.count], [1, 1, 1]);
});

test("a record that breaks off has the metrics of what could be read", () => {
  const played = new Played();
  played.session();
  played.moment(0);
  played.tell("trouble", create(TroubleSchema, { text: "the trace is damaged", kind: Trouble_Kind.FAILED }));
  assert.deepEqual([played.source.progress, played.unwatched], [0, 0]);
  played.tell("metrics", create(MetricsSchema, { metrics: [{ name: "duration", value: 3 }] }));
  played.tell("progress", create(ReplayProgressSchema, { share: 1, done: true }));
  assert.deepEqual([played.source.progress, played.unwatched, played.source.metrics.length], [1, 1, 1]);
});

test("poses of a paused session are shown as they come, even while its time stands still", () => {
  const played = new Played(true);
  const { source } = played;
  played.session();
  let shown = 0;
  source.onChange((change) => (shown += change === "moment" ? 1 : 0));
  const paused = (timeNs: bigint, x: number): void => played.tell("moment", create(MomentSchema, {
    stationNumber: 3, timeNs, state: SessionState.PAUSED,
    instruments: [{ channel: 4, validity: 0, tip: { q: [1, 0, 0, 0], t: [x, 0, 0] }, warped: { q: [1, 0, 0, 0], t: [x, 0, 1] } }],
  }));
  for (const [time, x] of [[5n, 1], [5n, 2], [6n, 3], [6n, 4]] as const) {
    paused(time * 1_000_000_000n, x);
    const newest = source.history.count - 1;
    assert.deepEqual([source.history.value(newest, STATE), source.history.value(newest, toolAt(0) + HAS_WARPED), source.history.value(newest, toolAt(0) + WARPED + 4)],
      [SessionState.PAUSED, 1, x]);
  }
  assert.equal(shown, 4);
});

test("a note about a station stays while its session begins, and is no trouble", () => {
  const played = new Played(true);
  played.tell("trouble", create(TroubleSchema, { text: "this page gets no meshes", kind: Trouble_Kind.NOTE }));
  played.session();
  assert.deepEqual([played.source.note, played.source.trouble], ["This page gets no meshes", ""]);
  played.tell("link", { state: "open" });
  assert.equal(played.source.note, "");
});

test("a replay that begins afresh leaves nothing of the one before", () => {
  const played = new Played();
  const [first] = steps();
  played.session();
  played.cut(0, first!.number, first!.payload, 100);
  played.moment(3, [1, 0, 0, 0, 0, 4]);
  played.session();
  assert.deepEqual([played.source.history.count, played.source.events.length, played.source.resections.length, played.source.groups().length], [0, 0, 0, 0]);
  played.cut(0, first!.number, first!.payload, 100);
  played.moment(1, [1]);
  assert.equal(played.source.tissue("meniscus_medial", 1)?.number, first!.number);
  assert.deepEqual(played.source.events, [mark(1, "state")]);
});

test("states are bands from change to change, and two sessions meet at what first happened in each", () => {
  const played = new Played();
  const { source } = played;
  played.session();
  played.moment(1, [1]);
  for (let i = 2; i <= 4; i++) played.moment(i, [2, 0, 0, i - 1], 2);
  played.moment(6, [3, 0, 0, 3], 1);
  assert.deepEqual(bandsOf(source.history, source.events), [{ from: 1, to: 2, state: 1 }, { from: 2, to: 6, state: 2 }]);
  assert.equal(firstOf("start", source.history, source.events), 1);
  assert.equal(firstOf("contact", source.history, source.events), 2);
  assert.equal(firstOf("cut", source.history, source.events), undefined);
});

test("the volume of a mesh is that inside its surface", () => {
  const tissue = new Tissue();
  // A corner of a cube of 3 mm, away from the origin; the last triangle is a dead one.
  tissue.positions = Float32Array.from([10, 20, 30, 13, 20, 30, 10, 23, 30, 10, 20, 33]);
  tissue.corners = Uint32Array.from([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3, 0, 0, 0]);
  tissue.triangleBound = 5;
  assert.ok(Math.abs(tissue.volume() - 27 / 6) < 1e-9);
});

// ---- metrics beside others' --------------------------------------------------------------------------------

test("quantiles go straight between values", () => {
  assert.equal(quantile([1, 2, 4, 8], 0.5), 3);
  assert.equal(quantile([1, 2, 4, 8], 0), 1);
  assert.equal(quantile([1, 2, 4, 8], 1), 8);
  assert.equal(quantile([5], 0.25), 5);
});

const distribution = (change: Partial<Distribution> = {}): Distribution =>
  ({ metric: "path_hand", subject: "probe", version: 1, unit: "mm", n: 5, values: [1, 2, 3, 4, 10], ...change });

test("a spread is of all values, or of the quantiles that stand for them", () => {
  assert.deepEqual(spreadOf(distribution()), { least: 1, lower: 2, median: 3, upper: 4, most: 10 });
  const quantiles = Array.from({ length: 21 }, (_, i) => 5 * i);
  assert.deepEqual(spreadOf(distribution({ n: 900, values: undefined, quantiles })), { least: 0, lower: 25, median: 50, upper: 75, most: 100 });
  assert.equal(spreadOf(distribution({ n: 0, values: [] })), undefined);
});

test("a value is compared only with those of its metric, subject and version", () => {
  const all = [distribution({ version: 2 }), distribution({ subject: "punch" }), distribution({ metric: "path_seen" })];
  const value = { name: "path_hand", subject: "probe", version: 1, unit: "mm", value: 3, belowFloor: false };
  assert.equal(distributionOf(all, value), undefined);
  assert.equal(distributionOf([...all, distribution()], value)?.n, 5);
  assert.deepEqual(bySubject([value, { ...value, subject: "" }, { ...value, name: "present" }]).map(([subject, of]) => [subject, of.length]), [["probe", 2], ["", 1]]);
});
