import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { MomentSchema, ViewSchema, type Moment } from "wire";
import { clockStep, lastBefore, niceStep } from "../src/axes";
import { bodyAt, FLEXION, FORCE, HAS_WARPED, History, LIVE_LIMITS, NEWEST_LIMITS, newRow, packView, SEEN, SPEED, STATE, TIP, toolAt, WARPED, WORKING } from "../src/history";

function moment(time: number, speeds: (number | undefined)[] = [5]): Moment {
  return create(MomentSchema, {
    timeNs: BigInt(Math.round(time * 1e9)), state: 1, joint: { flexionDeg: 10 * time },
    bodies: [{ body: 1, pose: { q: [1, 0, 0, 0], t: [time, 2, 3] } }, { body: 2, pose: { q: [0, 1, 0, 0], t: [0, 0, 0] }, virtualPose: { q: [0, 0, 1, 0], t: [9, 8, 7] } }],
    instruments: speeds.flatMap((speedMmS, i) => (speedMmS === undefined ? [] : [{
      channel: 4 + i, validity: 0, tip: { q: [1, 0, 0, 0], t: [1, 2, 3] }, warped: { q: [1, 0, 0, 0], t: [4, 5, 6] }, speedMmS,
    }])),
  });
}

test("moments come back as they were, and are found by time", () => {
  const history = new History();
  for (let i = 0; i < 2000; i++) assert.ok(history.append(moment(i / 10)));
  assert.equal(history.count, 2000);
  const row = newRow();
  for (const i of [0, 511, 512, 1024, 1999]) {
    history.read(i, row);
    assert.equal(row[FLEXION], Math.fround(i));
    assert.equal(row[bodyAt(1, false) + 4], Math.fround(i / 10));
    assert.equal(history.indexAt(i / 10 + 0.05), i);
  }
  assert.equal(history.indexAt(-0.01), -1);
  assert.equal(history.indexAt(1e6), 1999);
  assert.deepEqual([...row.slice(bodyAt(1, true), bodyAt(1, true) + 7)], [1, 0, 0, 0, Math.fround(199.9), 2, 3]); // no virtual pose: the same
  assert.deepEqual([...row.slice(bodyAt(2, true), bodyAt(2, true) + 7)], [0, 0, 1, 0, 9, 8, 7]);
  assert.deepEqual([...row.slice(toolAt(0) + WARPED + 4, toolAt(0) + WARPED + 7)], [4, 5, 6]);
});

test("a history that keeps few has the newest", () => {
  const few = NEWEST_LIMITS.recent;
  const history = new History(NEWEST_LIMITS);
  for (let i = 0; i <= 3 * few; i++) history.append(moment(i));
  assert.ok(history.count <= few && history.count >= few / 2);
  const row = newRow();
  for (const back of [1, 2, history.count]) {
    const [index, wanted] = [history.count - back, 3 * few + 1 - back];
    history.read(index, row);
    assert.deepEqual([row[FLEXION], history.time(index), history.indexAt(wanted + 0.5)], [10 * wanted, wanted, index]);
  }
  assert.deepEqual([history.start, history.end], [3 * few + 1 - history.count, 3 * few]);
});

test("a limited history has the last 10 minutes in full, and what is older more and more thinly from the start on", () => {
  const history = new History(LIVE_LIMITS);
  const [hz, length] = [30, 2 * 3600];
  let most = 0;
  for (let i = 0; i <= length * hz; i++) {
    history.append(moment(i / hz));
    most = Math.max(most, history.count);
  }
  assert.ok(most <= LIVE_LIMITS.recent + LIVE_LIMITS.older, `${most} moments`);
  assert.deepEqual([history.start, history.end], [0, length]);
  const tenMinutes = history.indexAt(history.end - 595);
  assert.equal(history.count - 1 - tenMinutes, 595 * hz);
  const row = newRow();
  for (const time of [0, 600, 3600, length - 1000, length - 1]) {
    const index = history.indexAt(time);
    assert.ok(time - history.time(index) <= 2 * history.spacing, `${history.time(index)} for ${time}`);
    history.read(index, row);
    assert.ok(Math.abs(row[FLEXION]! - 10 * history.time(index)) < 0.05);
    assert.equal(history.value(index, FLEXION), row[FLEXION]);
  }
  for (let i = 1; i < history.count; i++) assert.ok(history.time(i) - history.time(i - 1) <= 2 * history.spacing);
  history.clear();
  assert.deepEqual([history.count, history.spacing, history.end], [0, 0, 0]);
});

test("a moment of the same time takes the place of the last, an older one is none", () => {
  const history = new History();
  history.append(moment(1));
  assert.ok(history.append(create(MomentSchema, { ...moment(1), state: 2 })));
  assert.equal(history.count, 1);
  assert.equal(history.value(0, STATE), 2);
  assert.equal(history.append(moment(0.5)), false);
  assert.equal(history.count, 1);
});

test("the instrument that is worked with changes only for one that clearly moves more", () => {
  const history = new History();
  const working = (speeds: (number | undefined)[]): number => {
    history.append(moment(history.end + 1, speeds));
    return history.value(history.count - 1, WORKING);
  };
  assert.equal(working([1, 0]), 0);
  assert.equal(working([1, 3]), 0);
  assert.equal(working([1, 30]), 1);
  assert.equal(working([1, 0]), 1);
  assert.equal(working([1, 0, undefined, undefined, 500]), 1); // the scope is not
});

test("a tool that lies on the table is not worked with", () => {
  const history = new History();
  const working = (nearest: number[]): number => {
    const next = moment(history.end + 1, nearest.map(() => 0));
    nearest.forEach((nearestMm, i) => (next.instruments[i]!.nearestMm = nearestMm));
    history.append(next);
    return history.value(history.count - 1, WORKING);
  };
  assert.equal(working([200, 5]), 1);
  assert.equal(working([5, 5]), 1);
  assert.equal(working([5, -1]), 0);
  assert.equal(working([200, 200]), -1);
});

test("a force is there while its gauge tells it", () => {
  const history = new History();
  history.append(moment(1));
  assert.equal(history.hasForce, false);
  assert.ok(Number.isNaN(history.value(0, toolAt(0) + FORCE)));
  for (const [time, forceN] of [[2, 2.5], [3, undefined]] as const) {
    const next = moment(time, [5, 5]);
    next.instruments[1]!.forceN = forceN;
    history.append(next);
  }
  assert.deepEqual([1, 2].map((i) => history.value(i, toolAt(1) + FORCE)), [2.5, NaN]);
  assert.ok(history.hasForce);
  assert.ok(Number.isNaN(history.value(1, toolAt(0) + FORCE)));
  history.clear();
  assert.equal(history.hasForce, false);
});

test("a station's own view moves poses, and says what is not there", () => {
  const row = newRow();
  const pose = (x: number) => ({ qw: 1, qx: 0, qy: 0, qz: 0, x, y: 0, z: 0 });
  packView(create(ViewSchema, {
    state: 1, bodies: [{ body: 1, pose: pose(1), virtualPose: pose(2) }],
    instruments: [{ channel: 4, validity: 0, tip: pose(3), warpValidity: 1, warped: pose(4) }, { channel: 8, validity: 0, tip: pose(5), warpValidity: 2 }],
  }), row);
  assert.equal(row[bodyAt(1, true) + 4], 2);
  assert.deepEqual([row[toolAt(0) + SEEN], row[toolAt(0) + HAS_WARPED], row[toolAt(0) + WARPED + 4]], [1, 1, 4]);
  assert.deepEqual([row[toolAt(4) + SEEN], row[toolAt(4) + HAS_WARPED], row[toolAt(4) + TIP + 4]], [1, 0, 5]);
  packView(create(ViewSchema, { instruments: [{ channel: 4, validity: 2, warpValidity: 2 }] }), row);
  assert.deepEqual([row[toolAt(0) + SEEN], row[toolAt(0) + HAS_WARPED]], [3, 0]); // lost, but seen before
  assert.equal(row[toolAt(1) + SEEN], 0);
  assert.equal(row[toolAt(0) + SPEED], 0);
});

test("axes have round steps, clocks those of a clock", () => {
  assert.equal(niceStep(10, 5), 2);
  assert.equal(niceStep(1, 4), 0.5);
  assert.equal(niceStep(7, 2), 5);
  assert.equal(clockStep(60, 8), 10);
  assert.equal(clockStep(3600, 6), 600);
  const times = [0, 1, 1, 4];
  assert.deepEqual([-1, 0, 0.5, 1, 3, 4, 9].map((time) => lastBefore(4, (i) => times[i]!, time)), [-1, 0, 0, 2, 2, 3, 3]);
});
