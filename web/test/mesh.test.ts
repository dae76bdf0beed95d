import assert from "node:assert/strict";
import { test } from "node:test";
import { MeshError, Tissue } from "../src/mesh";
import { MeshHistory, Meshes, type Answer, type Chunk } from "../src/meshes";
import { steps, type Step } from "./meshes";

function check(tissue: Tissue | undefined, step: Step): void {
  assert.ok(tissue);
  assert.equal(tissue.number, step.number);
  assert.equal(tissue.hash, step.hash);
  assert.equal(tissue.vertexCount, step.vertices);
  assert.equal(tissue.triangleCount, step.triangles);
  let alive = 0;
  const used = new Set<number>();
  for (let t = 0; t < tissue.triangleBound; t++)
    if (tissue.lives(t)) {
      alive++;
      for (let k = 0; k < 3; k++) used.add(tissue.corners[3 * t + k]!);
    }
  assert.equal(alive, step.triangles);
  assert.equal(used.size, step.vertices);
}

test("a mesh follows the changes that C made", () => {
  const tissue = new Tissue();
  for (const step of steps()) {
    tissue.apply(step.payload);
    check(tissue, step);
  }
  assert.equal(steps().length, 12);
});

test("a change of another mesh is missing its base and changes nothing", () => {
  const tissue = new Tissue();
  const [first, second, third] = steps();
  tissue.apply(first!.payload);
  assert.throws(() => tissue.apply(third!.payload), (error) => error instanceof MeshError && error.missing);
  check(tissue, first!);
  tissue.apply(second!.payload);
  check(tissue, second!);
});

test("the mismatch goes with the mesh, forth and back", () => {
  const [first, second] = steps();
  const history = new MeshHistory();
  const tissue = new Tissue();
  const alive = (mesh: Tissue): number[] => [...new Set([...mesh.corners.subarray(0, 3 * mesh.triangleBound)].filter((_, i) => mesh.lives(Math.floor(i / 3))))].sort((a, b) => a - b);
  const push = (step: Step, mismatch: (vertices: number[]) => number[]): void => {
    const probe = tissue.clone();
    probe.apply(step.payload);
    const bytes = mismatch(alive(probe));
    const payload = Uint8Array.from([...step.payload, ...bytes]);
    tissue.apply(payload, bytes.length);
    history.push(step.number, tissue, payload, bytes.length);
  };
  push(first!, () => [20]); // nothing differs
  assert.equal(tissue.mismatchStep, 0.02);
  assert.ok(tissue.mismatch.length >= tissue.vertexBound && tissue.mismatch.every((steps) => steps === 0));
  push(second!, ([a, b]) => [20, a!, 49, b! - a! - 1, 0xe8, 7]);
  const [a, b] = alive(tissue);
  for (let round = 0; round < 2; round++) {
    const then = history.at(second!.number)!;
    check(then, second!);
    assert.deepEqual([then.mismatch[a!], then.mismatch[b!]], [-25, 500]);
    const before = history.at(first!.number)!;
    check(before, first!);
    assert.ok(before.mismatch.every((steps) => steps === 0));
  }
  tissue.apply(steps()[2]!.payload); // of a server that tells none
  assert.equal(tissue.mismatchStep, 0);
  const dead = tissue.clone();
  assert.throws(() => dead.apply(Uint8Array.from([...steps()[3]!.payload, 20, 255, 255, 3, 2]), 5), MeshError);
});

test("a copy has no room to spare, and can be changed as the original can", () => {
  const tissue = new Tissue();
  let copy = tissue;
  for (const step of steps()) {
    copy = copy.clone();
    copy.apply(step.payload);
    check(copy, step);
    tissue.apply(step.payload);
    const { vertexBound, triangleBound } = tissue;
    assert.equal(tissue.clone().bytes, 4 * (3 * vertexBound + vertexBound + 3 * triangleBound + triangleBound));
  }
});

test("no byte can be wrong, and none left out, without a word", () => {
  const [first, second] = steps();
  const before = new Tissue();
  before.apply(first!.payload);
  const refused = (payload: Uint8Array, what: string): void => {
    const tissue = before.clone();
    try {
      tissue.apply(payload);
    } catch (error) {
      assert.ok(error instanceof MeshError, `${what}: ${error}`);
      if (!error.missing) assert.equal(tissue.number, 0);
      return;
    }
    // The shapes of pieces are not in the hash: they are for the eye.
    assert.equal(tissue.hash, second!.hash, what);
    assert.equal(tissue.triangleCount, second!.triangles, what);
  };
  for (let at = 0; at < second!.payload.length; at++)
    for (const bit of [1, 16, 128]) {
      const payload = second!.payload.slice();
      payload[at]! ^= bit;
      refused(payload, `byte ${at} ^ ${bit}`);
    }
  for (let size = 1; size < second!.payload.length; size++)
    assert.throws(() => before.clone().apply(second!.payload.subarray(0, size)), MeshError, `${size} bytes`);
});

function chunks(step: Step, base: number, part = 32768): Chunk[] {
  const all: Chunk[] = [];
  for (let index = 0; index * part < step.payload.length; index++)
    all.push({
      group: "meniscus_medial",
      base,
      number: step.number,
      size: step.payload.length,
      hash: 1n,
      index,
      data: step.payload.subarray(index * part, (index + 1) * part),
      mismatchSize: 0,
    });
  return all;
}

function acked(answer: Answer | null): number {
  assert.ok(answer && "ack" in answer, "no mesh was made");
  return answer.ack.number;
}

test("what follows a server says what it has, and asks again where something is wrong", () => {
  const [first, second, third] = steps();
  const meshes = new Meshes();
  assert.deepEqual(meshes.ask(), { ask: [] });
  assert.equal(acked(meshes.chunk(chunks(first!, 0)[0]!)), first!.number);
  assert.deepEqual(meshes.ask().ask, [{ group: "meniscus_medial", number: first!.number, hash: first!.hash }]);

  const wrongBase = meshes.chunk({ ...chunks(third!, second!.number)[0]! });
  assert.deepEqual(wrongBase, meshes.ask());
  assert.equal(meshes.tissue("meniscus_medial")?.number, first!.number);

  assert.deepEqual(meshes.chunk({ ...chunks(second!, first!.number)[0]!, size: second!.payload.length + 1 }), meshes.ask());
  assert.equal(meshes.chunk({ ...chunks(second!, first!.number)[0]!, index: 1 }), null); // before a chunk 0: nothing

  assert.equal(acked(meshes.chunk(chunks(second!, first!.number)[0]!)), second!.number);
  assert.equal(acked(meshes.chunk(chunks(second!, first!.number)[0]!)), second!.number); // passed already
  check(meshes.tissue("meniscus_medial"), second!);
});

test("after the fourth failure in a row a group is given up until the session opens again", () => {
  const [first, second] = steps();
  const meshes = new Meshes();
  meshes.chunk(chunks(first!, 0)[0]!);
  const bad = { ...chunks(second!, first!.number)[0]!, size: 5 };
  for (let i = 0; i < 3; i++) assert.ok(meshes.chunk(bad));
  assert.equal(meshes.chunk(bad), null);
  assert.equal(meshes.chunk(chunks(second!, first!.number)[0]!), null);
  assert.equal(meshes.open().ask.length, 1);
  assert.equal(acked(meshes.chunk(chunks(second!, first!.number)[0]!)), second!.number);
});

test("a payload comes together from its chunks", () => {
  const whole = new Uint8Array(70000).fill(255);
  const step = { ...steps()[0]!, payload: whole };
  const meshes = new Meshes();
  const parts = chunks(step, 0);
  assert.deepEqual(parts.map((part) => part.data.length), [32768, 32768, 4464]);
  assert.equal(meshes.chunk(parts[0]!), null);
  assert.equal(meshes.chunk(parts[1]!), null);
  assert.deepEqual(meshes.chunk(parts[2]!), { ask: [] }); // no change of a mesh
  meshes.chunk(parts[0]!);
  assert.deepEqual(meshes.chunk(parts[2]!), { ask: [] }); // out of order
});

test("the mesh of a recorded session is there at any time, in any order", () => {
  const history = new MeshHistory();
  const all = steps();
  // The same session over and over, so that more meshes are kept than one.
  const tissue = new Tissue();
  for (let round = 0; round < 4; round++)
    all.forEach((step, i) => {
      tissue.apply(step.payload);
      history.push(100 * round + i, tissue, step.payload);
    });
  assert.equal(history.at(-1), undefined);
  for (const at of [0, 5.5, 311, 304, 103, 0, 207, 99, 311])
    check(history.at(at), all[Math.min(11, Math.floor(at % 100))]!);
  assert.equal(history.at(-1), undefined);
});

test("a jump to the end of a recorded session does not make all changes before", () => {
  const history = new MeshHistory();
  const [first] = steps();
  const tissue = new Tissue();
  tissue.apply(first!.payload);
  // Payloads that nobody could make, but for the last one: the 17th landing, whose mesh is kept.
  for (let i = 0; i < 16; i++) history.push(i, tissue, new Uint8Array([1]));
  history.push(16, tissue, first!.payload);
  check(history.at(16), first!);
});

test("a limited mesh history has the newest meshes one by one, and of the older ones some", () => {
  const most = 1 << 20;
  const history = new MeshHistory(most);
  const tissue = new Tissue();
  const all = steps();
  const rounds = 200;
  const pushed = rounds * all.length;
  for (let i = 0; i < pushed; i++) {
    const { payload } = all[i % all.length]!;
    tissue.apply(payload);
    history.push(i, tissue, payload);
    assert.ok(history.bytes <= most, `${history.bytes} bytes after ${i}`);
  }
  for (const i of [pushed - 1, pushed - 20, pushed - 50, pushed - 2]) check(history.at(i + 0.5), all[i % all.length]!);
  const known = new Map(all.map((step) => [step.number, step]));
  for (const time of [0, 3, pushed / 4, pushed / 2, pushed - 500, 0]) {
    const mesh = history.at(time)!;
    check(mesh, known.get(mesh.number)!);
  }
  check(history.at(0), all[0]!);
});
