import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { LooseMoment_State, MomentSchema, type Moment } from "wire";
import { bodyAt, HAS_WARPED, History, LOOSE_ON, LOOSE_POSE, LOOSE_STATE, looseAt, newRow, toolAt, WARPED } from "../src/history";
import { carryLoose } from "../src/scene/loose";

const GRASPER = 5; // place of the first instrument that a station describes

function moment(time: number, x: number): Moment {
  const pose = { q: [1, 0, 0, 0], t: [x, 2, 3] };
  return create(MomentSchema, {
    timeNs: BigInt(time * 1e9),
    loose: [{ state: LooseMoment_State.LYING, on: 1, pose }, { state: LooseMoment_State.HELD, on: 4 + GRASPER, pose }, { state: LooseMoment_State.OUT, on: 9, pose }],
  });
}

test("loose bodies are kept with their moments, where the case has some", () => {
  const history = new History();
  const row = newRow();
  history.loose = true;
  history.clear();
  for (let i = 0; i < 600; i++) history.append(moment(i, i));
  history.read(550, row);
  assert.deepEqual([0, 1, 2, 3].map((body) => row[looseAt(body) + LOOSE_STATE]), [1, 2, 3, 0]);
  assert.deepEqual([0, 1].map((body) => row[looseAt(body) + LOOSE_ON]), [1, 4 + GRASPER]);
  assert.deepEqual([...row.slice(looseAt(1) + LOOSE_POSE, looseAt(1) + LOOSE_POSE + 7)], [1, 0, 0, 0, 550, 2, 3]);
});

test("what a bone or a jaw carries goes with it, and what is out stays", () => {
  const [from, to] = [newRow(), newRow()];
  const put = (row: Float32Array, at: number, x: number, turned: boolean) => row.set(turned ? [Math.SQRT1_2, 0, 0, Math.SQRT1_2, x, 0, 0] : [1, 0, 0, 0, x, 0, 0], at);
  for (const body of [0, 1, 2]) {
    from[looseAt(body) + LOOSE_STATE] = 1 + body;
    from[looseAt(body) + LOOSE_ON] = body === 0 ? 1 : 4 + GRASPER;
    put(from, looseAt(body) + LOOSE_POSE, 10, false);
  }
  from[toolAt(GRASPER) + HAS_WARPED] = to[toolAt(GRASPER) + HAS_WARPED] = 1;
  put(from, toolAt(GRASPER) + WARPED, 8, false);
  put(to, toolAt(GRASPER) + WARPED, 20, true); // a quarter turn about z: x becomes y
  put(to, bodyAt(1, true), 5, false);
  carryLoose(from, to);
  const places = [0, 1, 2].map((body) => [...to.slice(looseAt(body) + LOOSE_POSE + 4, looseAt(body) + LOOSE_POSE + 7)].map((v) => Math.round(1e4 * v) / 1e4));
  assert.deepEqual(places, [[15, 0, 0], [20, 2, 0], [10, 0, 0]]);
});
