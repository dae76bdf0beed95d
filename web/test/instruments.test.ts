// Described instruments: their places, names and shapes, and that a history keeps them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { Box3, MeshBasicMaterial, type Mesh } from "three";
import { Instrument_Kind, InstrumentSchema, MomentSchema } from "wire";
import { History, newRow, SEEN, SPEED, toolAt, WORKING } from "../src/history";
import { colourOf, instrumentsOf, isOptic, nameOf, runs, USUAL } from "../src/instruments";
import { shapeOf } from "../src/scene/instruments";

const CURETTE = create(InstrumentSchema, {
  channel: 9, name: "ring-curette", kind: Instrument_Kind.BLADE, cuts: true, lengthMm: 9, widthMm: 6, thicknessMm: 1, colour: 0xffcc00,
});
const DRILL = create(InstrumentSchema, { channel: 10, name: "drill", kind: Instrument_Kind.BURR, cuts: true, button: 2, widthMm: 8 });
const all = instrumentsOf([...USUAL, CURETTE, DRILL]);

test("the usual five are there without a word, described ones behind them", () => {
  assert.deepEqual(instrumentsOf(undefined).map(nameOf), ["Probe", "Punch", "Shaver", "Knife", "Scope"]);
  assert.deepEqual(all.map(nameOf).slice(5), ["Ring curette", "Drill"]);
  assert.deepEqual(all.map(isOptic), [false, false, false, false, true, false, false]);
  assert.equal(colourOf(CURETTE, 5), 0xffcc00);
  assert.notEqual(colourOf(DRILL, 6), colourOf(USUAL[0]!, 0));
  assert.equal(instrumentsOf([create(InstrumentSchema, { channel: 200 })]).length, 5);
});

test("a burr runs with its button", () => {
  assert.ok(runs(DRILL, 4) && !runs(DRILL, 3) && runs(USUAL[2], 1) && !runs(CURETTE, 255));
});

test("a shape has the sizes that are told", () => {
  const material = new MeshBasicMaterial();
  const blade = shapeOf(CURETTE, material, material).root.children[1]!;
  const { min, max } = new Box3().setFromObject(blade);
  assert.deepEqual([min.x, min.y, min.z, max.x, max.y, max.z].map((v) => Math.round(1e3 * v) + 0), [-500, -3000, -9000, 500, 3000, 0]);
});

test("the bend of a probe leads from its shaft to its hook", () => {
  const material = new MeshBasicMaterial();
  const places = (shapeOf(USUAL[0]!, material, material).root.children[0] as Mesh).geometry.getAttribute("position");
  for (let turn = 0; turn <= Math.PI / 2; turn += Math.PI / 16) { // a quarter of a circle of 0.7 mm, from the hook's axis to the shaft's
    const [y, z] = [1 + 0.7 * Math.sin(turn), -1.15 + 0.7 * Math.cos(turn)];
    const near = Array.from({ length: places.count }, (_, i) => Math.hypot(places.getX(i), places.getY(i) - y, places.getZ(i) - z));
    assert.ok(Math.min(...near) < 0.46, `nothing is at y ${y}, z ${z}`);
  }
});

test("a history keeps what a described instrument does", () => {
  const history = new History();
  const moment = (timeNs: bigint, speedMmS: number): ReturnType<typeof create<typeof MomentSchema>> => create(MomentSchema, {
    timeNs, instruments: [{ channel: 10, tip: { q: [1, 0, 0, 0], t: [1, 2, 3] }, speedMmS }],
  });
  history.instruments = all;
  history.clear();
  for (let i = 0; i < 1500; i++) assert.ok(history.append(moment(BigInt(i) * 10_000_000n, i)));
  const row = newRow();
  history.read(1200, row);
  assert.equal(row[toolAt(6) + SEEN], 1);
  assert.equal(row[toolAt(6) + SPEED], 1200);
  assert.equal(history.value(700, toolAt(6) + SPEED), 700);
  assert.equal(history.value(700, WORKING), 6);
  history.instruments = USUAL;
  history.clear();
  assert.ok(history.append(moment(0n, 7)));
  history.read(0, row);
  assert.equal(row[toolAt(6) + SEEN], 0); // not of this session
});
