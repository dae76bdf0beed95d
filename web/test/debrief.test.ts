import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import {
  LiveSessionSchema, MarkerSchema, MeshChunkSchema, MetricsSchema, MomentSchema, PlaceSchema, RemarkSchema, ReplayProgressSchema, ResectionSchema, SessionState, Trouble_Kind, TroubleSchema, Why_Code, WhySchema,
} from "wire";
import { CaseGroup_Kind, CaseGroup_Side, Validity, type CaseGroup } from "wire";
import { told } from "./told";
import { Removed, removedLabels } from "../src/removed";
import { bySubject, distributionOf, quantile, spreadOf, type Distribution } from "../src/distribution";
import { HAS_WARPED, STATE, toolAt, WARPED } from "../src/history";
import type { Feed } from "../src/live";
import { Tissue } from "../src/mesh";
import { inBursts, planDone, withBlinks, withMarkers } from "../src/panels";
import { FeedSource, markerAt, noteAt, resectionsAt, type TimedEvent } from "../src/source";
import { bandsOf, firstOf, nextStop, Player, stopsOf } from "../src/playback";
import { text } from "../src/text";
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

  session(groups: CaseGroup[] = []): void {
    this.tell("session", create(LiveSessionSchema, { groups, stationNumber: 3, id: new Uint8Array(16), caseName: "tear-radial", recorded: true, lengthNs: 10_000_000_000n }));
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

test("removed tissue is plotted for each group that can be cut, beyond the traces for others together", () => {
  const played = new Played();
  const removed = new Removed(played.source);
  const [medial, lateral, plica, fold] = [
    told("m1", CaseGroup_Kind.MENISCUS, { side: CaseGroup_Side.MEDIAL, cuttable: true, label: "Medial meniscus" }),
    told("m2", CaseGroup_Kind.MENISCUS, { side: CaseGroup_Side.LATERAL, cuttable: true, label: "Lateral meniscus" }),
    told("plica", CaseGroup_Kind.SYNOVIUM, { cuttable: true, label: "Medial plica" }), told("fold", CaseGroup_Kind.SYNOVIUM, { cuttable: true }),
  ];
  const bone = told("femur", CaseGroup_Kind.BONE);
  const cut = (time: number, group: string, removedMm3: number, piecesMm3 = 0): void => {
    played.tell("resection", create(ResectionSchema, { group, removedMm3, piecesMm3 }));
    played.moment(time);
  };
  const cutAll = (): void => {
    cut(1, "m2", 2);
    cut(2, "plica", 5, 1);
    cut(3, "m1", 3);
    cut(4, "fold", 10);
    cut(5, "plica", 7);
  };
  const plotted = (): number[][][] => [0, 1, 2].map((trace) => removed.of(trace).map(({ time, mm3 }) => [time, mm3]));
  played.session([bone, medial!, plica!]);
  cutAll();
  assert.deepEqual(removedLabels(played.source.session?.groups), ["medial", "Medial plica"]);
  assert.deepEqual(plotted().slice(0, 2), [[[3, 3]], [[2, 6], [5, 7]]]);
  played.session([bone, medial!, lateral!, plica!, fold!]);
  assert.deepEqual(plotted(), [[], [], []]);
  cutAll();
  assert.deepEqual(removedLabels(played.source.session?.groups), ["medial", "lateral", "other"]);
  assert.deepEqual(plotted(), [[[3, 3]], [[1, 2]], [[2, 6], [4, 16], [5, 17]]]);
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

test("a device's marker that comes late stands at its own time, and a new session has none", () => {
  const played = new Played();
  const { source } = played;
  const mark = (name: string, time: number, value = 1): void =>
    played.tell("marker", create(MarkerSchema, { number: 1n, timeNs: BigInt(time * 1e9), name, device: "pedal", value }));
  played.session();
  played.moment(1);
  mark("start", 0.5);
  mark("trial", 3, 7);
  mark("late", 2, 0);
  assert.deepEqual(source.markers, [{ time: 0.5, words: "start (pedal)" }, { time: 2, words: "late (pedal: 0)" }, { time: 3, words: "trial (pedal: 7)" }]);
  const listed = withMarkers([{ time: 1, event: "cut", times: 1 }], source.markers);
  assert.deepEqual(listed.map(({ event }) => event), ["marker", "cut", "marker", "marker"]);
  played.session();
  assert.equal(source.markers.length, 0);
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

test("a note that a session's server is away goes once the session is told again", () => {
  const played = new Played(true);
  const why = create(WhySchema, { code: Why_Code.SERVER_AWAY, parameters: ["b"] });
  played.tell("trouble", create(TroubleSchema, { text: "server b does not answer", kind: Trouble_Kind.NOTE, why }));
  assert.notEqual(played.source.note, "");
  played.session();
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

test("the bar of the plan grows with what is gone of it, whatever is cut beyond", () => {
  const steps = [[106, 0], [60, 0], [60, 40], [16, 72], [0, 72], [0, 300]].map(([underMm3, overMm3]) => planDone({ plannedMm3: 106, underMm3: underMm3!, overMm3: overMm3! }));
  assert.deepEqual(steps.map(({ done }) => done), [0, 46, 46, 90, 106, 106]);
  for (const [i, { doneShare, overShare }] of steps.slice(1).entries()) {
    assert.ok(doneShare >= steps[i]!.doneShare && overShare >= steps[i]!.overShare);
    assert.ok(doneShare <= 1 && overShare <= 1);
  }
  assert.equal(steps.at(-1)!.doneShare, 1);
});

test("who is at the end stays there as more comes, and plays from the beginning", () => {
  const player = new Player();
  player.toEnd(4);
  assert.deepEqual([player.time, player.atEnd], [4, true]);
  player.toEnd(9);
  player.toggle(0, 9, false);
  assert.deepEqual([player.time, player.playing, player.atEnd], [0, true, false]);
  player.toEnd(9);
  assert.equal(player.playing, false);
  player.seek(3, 0, 20);
  assert.deepEqual([player.time, player.atEnd], [3, false]);
});

test("a device that is lost, and comes back, has its name where a place tells it", () => {
  const played = new Played(true);
  const { source } = played;
  const place = (...lost: string[]): void => played.tell("place", create(PlaceSchema, {
    stationNumber: 3, devices: ["tracker", "encoders"].map((name) => ({ name, lost: lost.includes(name) })),
  }));
  const moment = (time: number, events: number[]): void => played.tell("moment", create(MomentSchema, { stationNumber: 3, timeNs: BigInt(time * 1e9), events }));
  played.session();
  place();
  moment(1, [1]);
  moment(2, [1, 1]);
  place("tracker");
  moment(4, [1, 1, 1]);
  place();
  moment(20, [1, 2, 1]);
  assert.deepEqual(source.events.map(({ event, devices }) => [event, devices]), [["deviceLost", ["tracker"]], ["deviceBack", ["tracker"]], ["deviceLost", undefined]]);
  place("encoders", "tracker");
  assert.deepEqual(source.events.at(-1)!.devices, ["tracker", "encoders"]);
  assert.deepEqual(inBursts(source.events.slice(0, 1))[0]!.devices, ["tracker"]);
});

test("a record names what was lost with a device", () => {
  const played = new Played();
  const { source } = played;
  played.session();
  const moment = (time: number, events: number[], validity: Validity): void => played.tell("moment", create(MomentSchema, {
    stationNumber: 3, timeNs: BigInt(time * 1e9), events, instruments: [{ channel: 4, validity, tip: { q: [1, 0, 0, 0], t: [0, 0, 0] } }],
  }));
  moment(1, [1], Validity.OK);
  moment(2, [1, 1], Validity.HELD);
  moment(2.1, [1, 1], Validity.LOST);
  moment(4, [1, 1, 1], Validity.OK);
  assert.deepEqual(source.events.filter(({ event }) => event !== "state").map(({ event, devices }) => [event, devices]), [["deviceLost", ["Probe"]], ["deviceBack", ["Probe"]]]);
});

test("figures are called the same on the pages and in reports", () => {
  assert.doesNotMatch(readFileSync("src/text.ts", "utf8"), /[`"][^`"]*(beyond the plan|still there|least rim)/i);
  const report = readFileSync("../server/review/words.c", "utf8");
  const enums = [...readFileSync("../server/metrics/figures.c", "utf8").matchAll(/\[(METRIC_\w+)\] = \{"(\w+)"/g)];
  assert.ok(enums.length > 40);
  for (const [, metric, name] of enums) assert.ok(report.includes(`[${metric}] = "${text.session.metricNames[name!]}"`), name);
});
