// How deep a tip is in a surface, and what a shader is told of it.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Matrix4, Vector3 } from "three";
import { CaseGroup_Kind } from "wire";
import { told } from "./told";
import { HAS_WARPED, newRow, SEEN, toolAt, WARPED } from "../src/history";
import { addNormals, type Group } from "../src/scene/anatomy";
import { Joint } from "../src/scene/joint";
import { Grid, GRID_MM } from "../src/scene/paint";
import { Dent, depthAt, Shade } from "../src/scene/touch";

const STEP = 0.7; // mm between vertices

/** A net over x and y, 12 mm wide, with its height at each place; `up`: where its outside is. */
function net(height: (x: number, y: number) => number, up = true): { positions: number[]; triangles: number[] } {
  const side = Math.round(12 / STEP) + 1;
  const positions: number[] = [];
  const triangles: number[] = [];
  for (let i = 0; i < side; i++)
    for (let j = 0; j < side; j++) {
      const [x, y] = [i * STEP - 6, j * STEP - 6];
      positions.push(x, y, height(x, y));
      if (i + 1 === side || j + 1 === side) continue;
      const [a, b, c, d] = [i * side + j, (i + 1) * side + j, (i + 1) * side + j + 1, i * side + j + 1];
      triangles.push(...(up ? [a, b, c, a, c, d] : [a, c, b, a, d, c]));
    }
  return { positions, triangles };
}

function surface(...nets: ReturnType<typeof net>[]): { positions: Float32Array; normals: Float32Array; triangles: Uint32Array } {
  const positions = Float32Array.from(nets.flatMap((one) => one.positions));
  let before = 0;
  const triangles = Uint32Array.from(nets.flatMap((one) => {
    const mine = one.triangles.map((vertex) => vertex + before);
    before += one.positions.length / 3;
    return mine;
  }));
  const normals = new Float32Array(positions.length);
  addNormals(positions, triangles, triangles.length, normals);
  return { positions, normals, triangles };
}

const depths = (of: ReturnType<typeof surface>) => {
  const grid = new Grid(of.positions, of.positions.length / 3, GRID_MM);
  return (x: number, y: number, z: number) => depthAt(grid, of.positions, of.normals, new Vector3(x, y, z));
};

test("a tip is as deep as it is under a slope, wherever between vertices, and goes in against its normal", () => {
  const at = depths(surface(net((x) => 0.5 * x)));
  const normal = new Vector3(-0.5, 0, 1).normalize();
  for (const [x, y, deep] of [[0, 0, 0.4], [0.3, 0.2, 0.4], [1.1, -2.34, -0.3], [-2, 1, 1]] as const) {
    const { mm, way } = at(x - deep * normal.x, y, 0.5 * x - deep * normal.z)!;
    assert.ok(Math.abs(mm - deep) < 1e-4, `${mm} instead of ${deep}`);
    assert.ok(way.distanceTo(normal.clone().negate()) < 1e-4);
  }
  assert.equal(at(0, 0, 4), undefined);
});

test("on a round surface the depth does not jump as the tip goes along", () => {
  const radius = 20;
  const at = depths(surface(net((x, y) => Math.sqrt(radius ** 2 - x ** 2 - y ** 2) - radius)));
  let before = at(-3, 0.1, Math.sqrt(radius ** 2 - 9) - radius)!.mm;
  for (let x = -3; x < 3; x += 0.02) {
    const { mm } = at(x, 0.1, Math.sqrt(radius ** 2 - x ** 2) - radius)!;
    assert.ok(Math.abs(mm) < 0.06 && Math.abs(mm - before) < 0.01, `${mm} after ${before}`);
    before = mm;
  }
});

test("the other side of a thin surface is not what a tip is deep in", () => {
  const at = depths(surface(net(() => 0.5), net(() => -0.5, false)));
  assert.ok(Math.abs(at(0.1, 0.2, 0.7)!.mm + 0.2) < 1e-4);
  const under = at(0.1, 0.2, -0.4)!; // of a hook that lifts it
  assert.ok(Math.abs(under.mm - 0.1) < 1e-4 && under.way.z > 0.999);
});

test("tissue gives way a little ahead of a tip, to the deepest of two, and never far", () => {
  const way = new Vector3(0, 0, -1);
  const dent = new Dent(0.3);
  dent.set(new Vector3(1, 2, 3), { mm: -0.4, way });
  assert.equal(dent.tip.value.w, 0);
  dent.set(new Vector3(1, 2, 3), { mm: 0.2, way });
  dent.set(new Vector3(9, 9, 9), { mm: 0.1, way });
  assert.deepEqual(dent.tip.value.toArray(), [1, 2, 3, 0.5]);
  dent.set(new Vector3(1, 2, 3), { mm: 30, way });
  assert.equal(dent.tip.value.w, 1.5);
  dent.clear();
  assert.equal(dent.tip.value.w, 0);
});

test("a shaft is told from its tip backwards, in the eye's frame, and a third one not at all", () => {
  const shade = new Shade();
  for (const x of [1, 2, 3]) shade.add(new Matrix4().makeTranslation(x, 0, -10), { radius: 2, y: 0.5 });
  const ends = shade.ends.value.map((end) => end.toArray());
  assert.deepEqual(ends.map(([x]) => x), [1, 1, 2, 2]);
  assert.deepEqual(ends[0], [1, 0.5, -12, 2]);
  assert.deepEqual(ends[1]!.slice(0, 3), [1, 0.5, -70]);
  shade.clear();
  assert.ok(shade.ends.value.every(({ z, w }, i) => z > 0 && (i % 2 || w === 0)));
});

function meniscus(): Group {
  const { positions, normals, triangles } = surface(net(() => 0));
  const whole = { positions, normals };
  return {
    name: "meniscus", about: told("meniscus", CaseGroup_Kind.MENISCUS), bone: false, body: 1, other: -1, cuttable: true, triangles, physical: whole, virtual: whole,
    otherShare: undefined, wear: undefined, cartilage: new Uint8Array(positions.length / 3), plan: [],
  };
}

test("a probe dents a meniscus in the scope, a punch does not, nor one that is lost", () => {
  const dentBy = (instrument: number, seen: number, z: number): number | undefined => {
    const joint = new Joint({ name: "x", title: "x", left: false, portals: [], groups: [meniscus()] }, true);
    const row = newRow();
    const at = toolAt(instrument);
    row[at + SEEN] = seen;
    row[at + HAS_WARPED] = 1;
    row.set([1, 0, 0, 0, 0.2, 0.3, z], at + WARPED);
    joint.setRow(row, 0);
    joint.touch(new Matrix4());
    return joint.surfaces[0]!.dent!.tip.value.w;
  };
  const [PROBE, PUNCH] = [0, 1];
  assert.ok(Math.abs(dentBy(PROBE, 1, -0.1)! - 0.45) < 1e-4);
  assert.equal(dentBy(PROBE, 1, 1), 0);
  assert.equal(dentBy(PUNCH, 1, -0.1), 0);
  assert.equal(dentBy(PROBE, 3, -0.1), 0);
});
