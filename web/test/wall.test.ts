// What the wall says of stations, where its cards go, and how a knee is made small.
import assert from "node:assert/strict";
import { test } from "node:test";
import { create, type MessageInitShape } from "@bufbuild/protobuf";
import { PlaceSchema, SessionState } from "wire";
import type { StationState } from "../src/live";
import { sentence } from "../src/text";
import { parseRoute, routeTo } from "../src/router";
import { CaseCache } from "../src/views/wall_cases";
import { readParts } from "../src/scene/gltf";
import { kneeParts, normalsOf, thin, type Case } from "../src/views/wall_knee";
import { arrange, byUrgency, certificateWarning, grouped, isAbsent, quietFor, runningSeconds, short, statusOf, sumOfDevices, warningOf } from "../src/views/wall_model";

function state(place: MessageInitShape<typeof PlaceSchema>, placeAt = 10_000): StationState {
  return { number: place.stationNumber ?? 0, place: create(PlaceSchema, place), placeAt, momentAt: 0 };
}

test("a station stands where its connection and its session say", () => {
  const of = (connected: boolean, state: SessionState): string => statusOf(create(PlaceSchema, { info: { connected, state } }));
  assert.equal(of(false, SessionState.RUNNING), "gone");
  assert.equal(of(true, SessionState.RUNNING), "running");
  assert.equal(of(true, SessionState.PAUSED), "paused");
  assert.equal(of(true, SessionState.WAITING), "waiting");
  assert.equal(of(true, SessionState.CLOSED), "closed");
  assert.equal(statusOf(undefined), "gone");
});

test("only what no session waits for is absent", () => {
  const of = (connected: boolean, state: SessionState): boolean => isAbsent(create(PlaceSchema, { info: { connected, state } }));
  assert.equal(of(false, SessionState.CLOSED), true);
  assert.equal(of(false, SessionState.RUNNING), false);
  assert.equal(of(true, SessionState.CLOSED), false);
  assert.equal(isAbsent(undefined), true);
});

test("one station has the page to itself", () => {
  assert.deepEqual(arrange(1, 1128, 790), { density: "large", columns: 1 });
  assert.equal(arrange(2, 1128, 790).columns, 2);
});

test("the server's certificate is warned of from 30 days before its end", () => {
  const now = 1_800_000_000;
  const of = (days: number | null): string | undefined => certificateWarning(days === null ? null : now + days * 86400, now * 1000)?.words;
  assert.equal(of(30), undefined);
  assert.match(of(29.5)!, /ends in 29 days/);
  assert.match(of(1.5)!, /ends in 1 day\./);
  assert.equal(of(null), undefined);
});

test("a station that nothing is heard of is warned of, whatever the server last said", () => {
  const one = state({ info: { station: "bay-1" }, urgency: 1, warning: "calibration" });
  assert.equal(warningOf(one, 12_999, false)?.words, "Calibration");
  assert.equal(quietFor(one, 12_999), undefined);
  assert.equal(quietFor(one, 13_000), 3000);
  assert.equal(warningOf(one, 13_000, false)?.urgency, 2);
  assert.equal(warningOf(one, 13_000, true)?.words, "Calibration"); // the server as a whole is said to be quiet
  assert.equal(warningOf(state({}), 10_000, false), undefined);
});

test("warnings are sorted by urgency, then by station as people count", () => {
  const warn = (station: string, urgency: number) => warningOf(state({ info: { station }, urgency, warning: "w" }), 10_000, false)!;
  const sorted = byUrgency([warn("bay-10", 1), warn("bay-2", 1), warn("bay-3", 3), warn("bay-1", 7)]);
  assert.deepEqual(sorted.map((warning) => `${warning.station} ${warning.urgency}`), ["bay-1 3", "bay-3 3", "bay-2 1", "bay-10 1"]);
});

test("what is wrong with many stations is said once", () => {
  const warn = (station: string, urgency: number, warning: string) => warningOf(state({ info: { station }, urgency, warning }), 10_000, false)!;
  const alarms = grouped(byUrgency([warn("a", 1, "case healthy is not checked"), warn("b", 3, "device all is lost"), warn("c", 1, "case healthy is not checked"), warn("d", 2, "device all is lost")]));
  assert.deepEqual(alarms.map(({ urgency, words, stations }) => [urgency, words, stations.join()]),
    [[3, "Device all is lost", "b"], [2, "Device all is lost", "d"], [1, "Case healthy is not checked", "a,c"]]);
});

test("large figures take no more room", () => {
  assert.deepEqual([0.04, 9.94, 99.9, 119.9, undefined].map((value) => short(value, 1)), ["0.0", "9.9", "99.9", "120", "–"]);
  assert.deepEqual([0, 701, 9999, 12_345].map((value) => short(value, 0)), ["0", "701", "9,999", "12k"]);
});

test("the server's words begin as a sentence does, a file's name stays", () => {
  assert.deepEqual(["device all is lost", "room-1-2026.trace: it ends too early", "room-1 is away", "lost"].map(sentence),
    ["Device all is lost", "room-1-2026.trace: it ends too early", "room-1 is away", "Lost"]);
});

test("a device that is lost has no rate, and its dropouts still count", () => {
  const of = (rateHz: number, dropouts: number, lost: boolean) => ({ $typeName: "arthron.DeviceRate" as const, name: "", driver: "", rateHz, dropouts, lost });
  assert.deepEqual(sumOfDevices([of(100, 2, false), of(0, 3, true), of(250, 0, false)]), { count: 3, there: 2, slowestHz: 100, dropouts: 5 });
  assert.equal(sumOfDevices([of(0, 0, true)]).slowestHz, undefined);
});

test("the time running is the session's own where it is known", () => {
  const one = state({ info: { startUtcNs: 1_000_000_000_000n } });
  assert.equal(runningSeconds(one, 1_060_000), 60);
  assert.equal(runningSeconds(state({ info: {} }), 1_060_000), undefined);
});

test("all cards fit on the screen where any size of them does", () => {
  const size = { large: [300, 280], medium: [212, 206], small: [148, 146], tiny: [132, 110] } as const;
  for (let count = 1; count <= 64; count++)
    for (const [width, height] of [[1128, 790], [984, 606], [984, 640], [1640, 950], [2296, 1310], [788, 860]] as const) {
      const { density, columns } = arrange(count, width, height);
      const rows = Math.ceil(count / columns);
      assert.ok(columns * size[density][0] + (columns - 1) * 8 <= width || columns === 1, `${count} in ${width}: ${columns} ${density}`);
      const fits = rows * (size[density][1] + 8) - 8 <= height;
      const none = Math.floor((width + 8) / 140) * Math.floor((height + 8) / 118) < count;
      assert.ok(fits || (none && density === "tiny"), `${count} in ${width} x ${height}: ${rows} rows of ${density}`);
    }
  assert.deepEqual(arrange(32, 1128, 790), { density: "small", columns: 7 });
  assert.deepEqual(arrange(32, 984, 606), { density: "tiny", columns: 7 }); // 1280 x 720
});

test("addresses of views are read as they are written", () => {
  const route = parseRoute(routeTo("session", ["a/b c"], { with: "ö", empty: "" }));
  assert.deepEqual([route.name, route.args, [...route.query]], ["session", ["a/b c"], [["with", "ö"]]]);
  for (const hash of ["", "#", "#/"]) assert.equal(parseRoute(hash).name, "");
  assert.deepEqual(parseRoute("#/station/%zz").args, ["%zz"]);
});

test("a thinned surface stays near what it was, and is smaller", () => {
  const positions: number[] = [];
  const triangles: number[] = [];
  const n = 40;
  for (let i = 0; i <= n; i++)
    for (let j = 0; j <= n; j++) {
      const [theta, phi] = [(Math.PI * i) / n, (2 * Math.PI * j) / n];
      positions.push(30 * Math.sin(theta) * Math.cos(phi), 30 * Math.sin(theta) * Math.sin(phi), 30 * Math.cos(theta));
      if (i < n && j < n) triangles.push(i * (n + 1) + j, (i + 1) * (n + 1) + j, i * (n + 1) + j + 1, i * (n + 1) + j + 1, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1);
    }
  const small = thin(Float32Array.from(positions), Uint32Array.from(triangles), 6);
  assert.ok(small.triangles.length < triangles.length / 2 && small.triangles.length > 300);
  for (let i = 0; i < small.positions.length; i += 3) {
    const far = Math.hypot(small.positions[i]!, small.positions[i + 1]!, small.positions[i + 2]!);
    assert.ok(Math.abs(far - 30) < 2, `${far}`);
  }
  assert.ok(Math.max(...small.triangles) < small.positions.length / 3);
  const normals = normalsOf(small.positions, small.triangles);
  for (let i = 0; i < normals.length; i += 3) {
    const along = [0, 1, 2].reduce((sum, k) => sum + (normals[i + k]! * small.positions[i + k]!) / 30, 0);
    assert.ok(along > 0.9, `${along}`); // outwards
  }
});

// A triangle in a node, with a target beside another one.
function glb(): ArrayBuffer {
  const json = JSON.stringify({
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], buffers: [{ byteLength: 80 }],
    nodes: [{ name: "tibia", mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 2, targets: [{ POSITION: 0 }, { POSITION: 1 }] }], extras: { targetNames: ["maxcut", "warp"] } }],
    accessors: ["VEC3", "VEC3", "SCALAR"].map((type, bufferView) => ({ bufferView, type, componentType: type === "SCALAR" ? 5123 : 5126, count: 3 })),
    bufferViews: [[0, 36], [36, 36], [72, 6]].map(([byteOffset, byteLength]) => ({ buffer: 0, byteOffset, byteLength })),
  });
  const padded = new TextEncoder().encode(json.padEnd(Math.ceil(json.length / 4) * 4));
  const buffer = new ArrayBuffer(20 + padded.length + 8 + 80);
  const view = new DataView(buffer);
  view.setUint32(0, 0x46546c67, true);
  view.setUint32(4, 2, true);
  view.setUint32(8, buffer.byteLength, true);
  view.setUint32(12, padded.length, true);
  view.setUint32(16, 0x4e4f534a, true);
  view.setUint32(20 + padded.length, 80, true);
  view.setUint32(24 + padded.length, 0x004e4942, true);
  new Uint8Array(buffer, 20).set(padded);
  const data = 20 + padded.length + 8;
  [0, 0, 0, 0.01, 0, 0, 0, 0.02, 0].forEach((value, i) => view.setFloat32(data + 4 * i, value, true));
  for (let i = 0; i < 3; i++) view.setFloat32(data + 36 + 12 * i + 8, 0.003, true);
  for (let i = 0; i < 3; i++) view.setUint16(data + 72 + 2 * i, i, true);
  return buffer;
}

const groupOf = (name: string, tissue: string, own_colour = false): Case["groups"][number] =>
  ({ name, body: name === "skin" ? "femur" : name, tissue, cuttable: tissue === "synovium", colour: "#0a0b0c", own_colour });

test("a knee is shown as the patient has it", () => {
  const meshes = readParts(glb());
  const [part, ...others] = kneeParts({ groups: [groupOf("tibia", "cartilage", true), groupOf("skin", "skin")] }, meshes, 1);
  assert.equal(others.length, 0);
  assert.deepEqual([part!.body, part!.kind, part!.colour], [1, "bone", 0x0a0b0c]);
  assert.deepEqual([...part!.positions].map((mm) => Math.round(mm)), [0, 0, 3, 10, 0, 3, 0, 20, 3]);
  assert.deepEqual([...part!.normals], [0, 0, 1, 0, 0, 1, 0, 0, 1]);
  const kinds = ["bone", "meniscus", "ligament", "synovium", "other"].map((tissue) => kneeParts({ groups: [groupOf("tibia", tissue)] }, meshes, 1)[0]!.kind);
  assert.deepEqual(kinds, ["bone", "meniscus", "ligament", "meniscus", "ligament"]);
  assert.throws(() => kneeParts({ groups: [groupOf("femur", "bone")] }, meshes, 1), /femur has no mesh/);
});

test("bytes that are no case are refused", () => {
  assert.throws(() => readParts(new ArrayBuffer(4)), /no binary glTF/);
  assert.throws(() => readParts(new ArrayBuffer(64)), /no binary glTF/);
});

// A server whose cases the test changes.
class Cases {
  hashes: Record<string, string> = { tear: "a" };
  loads: string[] = [];
  lists = 0;
  down = false;
  changes = 0;
  private timers: (() => void)[] = [];
  readonly cache = new CaseCache<string>({
    list: async () => {
      this.lists++;
      if (this.down) throw new Error("down");
      return Object.entries(this.hashes).map(([name, hash]) => ({ name, hash }));
    },
    load: async (name) => {
      this.loads.push(name);
      if (this.down) throw new Error("down");
      return `${name} ${this.hashes[name]}`;
    },
    later: (_, then) => void this.timers.push(then),
    changed: () => void this.changes++,
  });

  async get(name: string): Promise<string | undefined> {
    for (let i = 0; i < 3; i++) {
      this.cache.get(name);
      await new Promise((resolve) => setImmediate(resolve));
    }
    return this.cache.get(name)?.value;
  }
  pass(): void {
    for (const then of this.timers.splice(0)) then();
  }
}

test("a case that was changed under its name is loaded again after a reconnect, and the old one is shown till then", async () => {
  const server = new Cases();
  assert.equal(await server.get("tear"), "tear a");
  assert.equal(await server.get("tear"), "tear a");
  assert.deepEqual([server.lists, server.loads.length], [1, 1]);
  server.hashes.tear = "b";
  server.cache.renew();
  assert.deepEqual(server.cache.get("tear"), { hash: "a", value: "tear a" });
  assert.equal(await server.get("tear"), "tear b");
  assert.equal(server.cache.get("tear")!.hash, "b");
  server.cache.renew();
  assert.equal(await server.get("tear"), "tear b");
  assert.deepEqual([server.lists, server.loads.length], [3, 2]);
});

test("a case that cannot be loaded is asked for again, but not at once", async () => {
  const server = new Cases();
  server.down = true;
  assert.equal(await server.get("tear"), undefined);
  assert.equal(server.lists, 1);
  server.down = false;
  server.pass();
  assert.equal(await server.get("tear"), "tear a");
  assert.equal(await server.get("other"), undefined);
  assert.deepEqual([server.lists, server.loads.length], [2, 1]);
});
