// What a station's page keeps of a long live session, with all that comes of one.
import assert from "node:assert/strict";
import { test } from "node:test";
import { setFlagsFromString } from "node:v8";
import { runInNewContext } from "node:vm";
import { create } from "@bufbuild/protobuf";
import { LiveSessionSchema, MeshChunkSchema, MomentSchema, ResectionSchema } from "wire";
import type { Feed } from "../src/live";
import { FeedSource, resectionsAt } from "../src/source";
import { steps } from "./meshes";

const HZ = 30;
const MOST_MB = 42;

class Stand {
  private readonly listeners = new Map<string, (value: never) => void>();
  on(kind: string, listener: (value: never) => void): () => void {
    this.listeners.set(kind, listener);
    return () => {};
  }
  onLink(): () => void {
    return () => {};
  }
  watch(): void {}
  unwatch(): void {}
  send(): boolean {
    return true;
  }
  tell(kind: string, value: object): void {
    this.listeners.get(kind)!(value as never);
  }
}

setFlagsFromString("--expose_gc");
const collect = runInNewContext("gc") as () => void;
function usedMb(): number {
  collect();
  const { heapUsed, external } = process.memoryUsage(); // typed arrays are in the latter
  return (heapUsed + external) / 1e6;
}

const instruments = [4, 5, 8].map((channel) => ({ channel, validity: 0, tip: { q: [1, 0, 0, 0], t: [1, 2, 3] }, warped: { q: [1, 0, 0, 0], t: [4, 5, 6] }, speedMmS: 5 }));

function hear(feed: Stand, from: number, to: number): void {
  const all = steps();
  for (let i = from * HZ; i < to * HZ; i++) {
    feed.tell("moment", create(MomentSchema, { stationNumber: 3, timeNs: BigInt(Math.round((i / HZ) * 1e9)), state: 1, events: [1, 0, 0, Math.floor(i / 10), 0, Math.floor(i / HZ)], instruments }));
    if (i % HZ) continue;
    const second = i / HZ;
    const { number, payload } = all[second % all.length]!;
    feed.tell("meshChunk", create(MeshChunkSchema, { group: "meniscus_medial", base: second % all.length ? all[(second - 1) % all.length]!.number : 0, number, size: payload.length, index: 0, data: payload }));
    feed.tell("resection", create(ResectionSchema, { group: "meniscus_medial", meshNumber: number, cuts: second, removedZoneMm3: Array<number>(9).fill(second), wholeZoneMm3: Array<number>(9).fill(1), budgetZoneMm3: Array<number>(9).fill(1) }));
  }
}

test("a live session of two hours with a cut each second fits in a page, and all of its time can be looked at", () => {
  const feed = new Stand();
  const source = FeedSource.live(feed as unknown as Feed, "bay-1", HZ);
  feed.tell("session", create(LiveSessionSchema, { stationNumber: 3, id: new Uint8Array(16), caseName: "tear-radial" }));
  const before = usedMb();
  hear(feed, 0, 3600);
  const hour = usedMb() - before;
  hear(feed, 3600, 7200);
  const grew = usedMb() - before;
  assert.ok(Math.max(hour, grew) <= MOST_MB, `${hour.toFixed(1)} MB after an hour, ${grew.toFixed(1)} MB after two`);
  for (const time of [0, 1800, 7000, 7199.5]) {
    const [index, cuts] = [source.history.indexAt(time), resectionsAt(source, time).get("meniscus_medial")!.cuts];
    assert.ok(time - source.history.time(index) < 2, `a moment of ${source.history.time(index)} for ${time}`);
    assert.ok(time - cuts >= -1 && time - cuts < 10, `figures after ${cuts} cuts at ${time}`);
    assert.ok(source.tissue("meniscus_medial", time)!.number > 0);
  }
  source.close();
});
