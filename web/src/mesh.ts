// The meshes that are cut, as the server sends them (PROTOCOL.md, Meshes): payloads decoded and their
// changes made. Millimetres, in the frame of the group's body.
//
// The hash of the whole mesh is checked after every change, which costs what was changed: it tells
// wrong bytes and wrong changes alike. The payload's own hash says nothing more over TLS, and is not
// looked at.

import { hash16, hash20, MASK, record } from "./xxh3";

const IDS_MAX = 1 << 20;
const PIECES_MAX = 64;
const REACH_MM = 10000;

// What came was no change of the mesh. `missing`: its base is another number than the mesh has, which is as before.
export class MeshError extends Error {
  constructor(text: string, readonly missing = false) {
    super(text);
  }
}

// ---- bytes ----------------------------------------------------------------------------------------

class Reader {
  private at = 0;
  private readonly view: DataView;

  constructor(private readonly bytes: Uint8Array) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  get done(): boolean {
    return this.at === this.bytes.length;
  }

  private take(size: number): number {
    const from = this.at;
    if (size > this.bytes.length - from) throw new MeshError("it ends too early");
    this.at += size;
    return from;
  }

  varint(): number {
    let value = 0;
    for (let shift = 0; shift < 35; shift += 7) {
      const byte = this.bytes[this.take(1)]!;
      if (shift === 28 && byte > 15) break;
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) return value >>> 0;
    }
    throw new MeshError("a number beyond 32 bits");
  }

  // Of things of at least `least` bytes each.
  count(least: number): number {
    const count = this.varint();
    if (count * least > this.bytes.length - this.at) throw new MeshError(`${count} things do not fit`);
    return count;
  }

  diff(before: number): number {
    const zigzag = this.varint();
    return (before + ((zigzag >>> 1) ^ -(zigzag & 1))) >>> 0;
  }

  coordinate(): number {
    const value = this.view.getFloat32(this.take(4), true);
    if (!(Math.abs(value) <= REACH_MM)) throw new MeshError(`a coordinate of ${value}`);
    return value;
  }

  f32(): number {
    return this.view.getFloat32(this.take(4), true);
  }

  u64(): bigint {
    return this.view.getBigUint64(this.take(8), true);
  }
}

// A part that came off; it is not in the mesh.
export interface Piece {
  volume: number; // mm³
  centroid: [number, number, number];
  positions: Float32Array;
  triangles: Uint32Array;
}

interface Delta {
  base: number;
  number: number;
  freed: Uint32Array;
  vertexIds: Uint32Array;
  positions: Float32Array;
  madeIds: Uint32Array;
  corners: Uint32Array;
  labels: Uint32Array;
  pieces: Piece[];
  hash: bigint;
}

// `before`: -1 before the first.
function id(before: number, gap: number): number {
  const next = before + 1 + gap;
  if (next >= IDS_MAX) throw new MeshError(`id ${next} is not below ${IDS_MAX}`);
  return next;
}

function readFreed(r: Reader, delta: Delta): void {
  const freed = (delta.freed = new Uint32Array(r.count(1)));
  for (let i = 0, last = -1; i < freed.length; i++) freed[i] = last = id(last, r.varint());
}

function readVertices(r: Reader, delta: Delta): void {
  const count = r.count(13);
  delta.vertexIds = new Uint32Array(count);
  delta.positions = new Float32Array(3 * count);
  for (let i = 0, last = -1; i < count; i++) {
    delta.vertexIds[i] = last = id(last, r.varint());
    for (let k = 0; k < 3; k++) delta.positions[3 * i + k] = r.coordinate();
  }
}

function readMade(r: Reader, delta: Delta): void {
  const count = r.count(4);
  delta.madeIds = new Uint32Array(count);
  delta.labels = new Uint32Array(count);
  delta.corners = new Uint32Array(3 * count);
  for (let i = 0, last = -1, label = 0, corner = 0; i < count; i++) {
    const head = r.varint();
    delta.madeIds[i] = last = id(last, head >>> 1);
    if (head & 1) label = r.diff(label);
    delta.labels[i] = label;
    for (let k = 0; k < 3; k++) {
      delta.corners[3 * i + k] = corner = r.diff(corner);
      if (corner >= IDS_MAX) throw new MeshError(`corner ${corner} is not below ${IDS_MAX}`);
    }
    checkDistinct(delta.corners, i);
  }
}

function checkDistinct(corners: Uint32Array, triangle: number): void {
  const [a, b, c] = corners.subarray(3 * triangle, 3 * triangle + 3);
  if (a === b || b === c || c === a) throw new MeshError(`corners ${a}, ${b}, ${c} are not distinct`);
}

function readPieces(r: Reader, delta: Delta): void {
  const count = r.count(18);
  if (count > PIECES_MAX) throw new MeshError(`${count} pieces`);
  for (let i = 0; i < count; i++) {
    const piece: Piece = {
      volume: r.f32(),
      centroid: [r.coordinate(), r.coordinate(), r.coordinate()],
      positions: new Float32Array(0),
      triangles: new Uint32Array(0),
    };
    piece.positions = new Float32Array(3 * r.count(12));
    for (let k = 0; k < piece.positions.length; k++) piece.positions[k] = r.coordinate();
    piece.triangles = new Uint32Array(3 * r.count(3));
    for (let k = 0, corner = 0; k < piece.triangles.length; k++) {
      piece.triangles[k] = corner = r.diff(corner);
      if (3 * corner >= piece.positions.length) throw new MeshError(`a piece has no vertex ${corner}`);
    }
    delta.pieces.push(piece);
  }
}

function readDelta(r: Reader): Delta {
  const base = r.varint();
  const delta: Delta = {
    base,
    number: base + r.varint() + 1,
    freed: new Uint32Array(0),
    vertexIds: new Uint32Array(0),
    positions: new Float32Array(0),
    madeIds: new Uint32Array(0),
    corners: new Uint32Array(0),
    labels: new Uint32Array(0),
    pieces: [],
    hash: 0n,
  };
  if (delta.number > 0xffffffff) throw new MeshError("its number is not above its base");
  readFreed(r, delta);
  readVertices(r, delta);
  readMade(r, delta);
  readPieces(r, delta);
  delta.hash = r.u64();
  return delta;
}

// ---- a mesh that is kept by changes ----------------------------------------------------------------

type Numbers = Float32Array | Uint32Array | Int16Array;

function grown<T extends Numbers>(items: T, count: number): T {
  if (items.length >= count) return items;
  const larger = new (items.constructor as { new (n: number): T })(Math.max(count, Math.ceil(1.25 * items.length)));
  larger.set(items as never);
  return larger;
}

export class Tissue {
  number = 0; // 0: nothing yet
  hash = 0n;
  vertexCount = 0; // living
  triangleCount = 0;
  vertexBound = 0; // above every id, of the living and the dead
  triangleBound = 0;
  positions = new Float32Array(0);
  corners = new Uint32Array(0); // of a dead triangle three times 0
  labels = new Uint32Array(0); // number of the cut that made the surface; 0: the original one
  // How far the touched surface lies from this one at each vertex, in steps; positive: touched where nothing is seen.
  mismatch = new Int16Array(0);
  mismatchStep = 0; // mm; 0: it is not told
  pieces: Piece[] = []; // that came off with the last payload
  before = 0; // number before that; 0: it was a whole mesh
  private uses = new Uint32Array(0);
  private hashes = true; // are summed up

  clear(): void {
    this.number = this.vertexCount = this.triangleCount = this.vertexBound = this.triangleBound = 0;
    this.hash = 0n;
    this.positions = new Float32Array(0);
    this.corners = new Uint32Array(0);
    this.labels = new Uint32Array(0);
    this.uses = new Uint32Array(0);
    this.mismatch = new Int16Array(0);
    this.mismatchStep = 0;
    this.pieces = [];
  }

  /** Without the room to grow that this one may have. */
  clone(): Tissue {
    const copy = Object.assign(new Tissue(), this);
    copy.positions = this.positions.slice(0, 3 * this.vertexBound);
    copy.corners = this.corners.slice(0, 3 * this.triangleBound);
    copy.labels = this.labels.slice(0, this.triangleBound);
    copy.uses = this.uses.slice(0, this.vertexBound);
    copy.mismatch = this.mismatch.slice(0, this.vertexBound);
    return copy;
  }

  get bytes(): number {
    return [this.positions, this.corners, this.labels, this.uses, this.mismatch].reduce((sum, { byteLength }) => sum + byteLength, 0);
  }

  // Inside the surface, mm³.
  volume(): number {
    let six = 0;
    const { positions, corners } = this;
    for (let t = 0; t < this.triangleBound; t++) {
      if (!this.lives(t)) continue;
      const a = 3 * corners[3 * t]!;
      const b = 3 * corners[3 * t + 1]!;
      const c = 3 * corners[3 * t + 2]!;
      six += positions[a]! * (positions[b + 1]! * positions[c + 2]! - positions[b + 2]! * positions[c + 1]!) +
        positions[a + 1]! * (positions[b + 2]! * positions[c]! - positions[b]! * positions[c + 2]!) +
        positions[a + 2]! * (positions[b]! * positions[c + 1]! - positions[b + 1]! * positions[c]!);
    }
    return six / 6;
  }

  lives(triangle: number): boolean {
    return this.corners[3 * triangle] !== this.corners[3 * triangle + 1];
  }

  // Makes changes that were made before, to the same mesh: what was hashed then is not hashed again.
  applyAgain(payload: Uint8Array, mismatchSize = 0): void {
    this.hashes = false;
    this.apply(payload, mismatchSize);
    this.hashes = true;
  }

  // Makes a payload's changes. Where that fails with a MeshError nothing is left, but where it is `missing`.
  // `mismatchSize`: so many bytes at its end are the mismatch.
  apply(payload: Uint8Array, mismatchSize = 0): void {
    const size = payload.length - mismatchSize;
    const reader = new Reader(payload.subarray(0, size));
    const pieces: Piece[] = [];
    let before = this.number;
    try {
      while (!reader.done) {
        const delta = readDelta(reader);
        if (!delta.base) before = 0;
        this.change(delta);
        if (!this.hashes) this.hash = delta.hash;
        if (this.hash !== delta.hash) throw new MeshError("the mesh's hash is not the one told");
        pieces.push(...delta.pieces);
      }
      this.readMismatch(payload.subarray(size));
    } catch (error) {
      if (!(error instanceof MeshError && error.missing)) this.clear();
      throw error;
    }
    this.pieces = pieces;
    this.before = before;
  }

  private readMismatch(bytes: Uint8Array): void {
    const reader = new Reader(bytes);
    this.mismatchStep = bytes.length ? reader.varint() / 1000 : 0;
    this.mismatch = grown(this.mismatch, bytes.length ? this.vertexBound : 0);
    this.mismatch.fill(0);
    for (let vertex = -1; !reader.done; ) {
      vertex = id(vertex, reader.varint());
      if (!this.uses[vertex]) throw new MeshError(`a mismatch of vertex ${vertex}, which is not alive`);
      this.mismatch[vertex] = reader.diff(0);
    }
  }

  private change(delta: Delta): void {
    if (delta.base && delta.base !== this.number)
      throw new MeshError(`it changes number ${delta.base}, and number ${this.number} is here`, true);
    if (!delta.base) this.clear();
    this.checkCorners(delta);
    for (const triangle of delta.freed) {
      if (triangle >= this.triangleBound || !this.lives(triangle))
        throw new MeshError(`it frees triangle ${triangle}, which is not alive`);
      this.drop(triangle);
    }
    this.makeRoom(delta);
    for (const triangle of delta.madeIds) if (this.lives(triangle)) this.drop(triangle);
    this.addVertices(delta);
    for (let i = 0; i < delta.madeIds.length; i++) this.put(delta, i);
    for (const vertex of delta.vertexIds)
      if (!this.uses[vertex]) throw new MeshError(`new vertex ${vertex} has no triangle`);
    this.number = delta.number;
  }

  // Before anything is freed: a vertex may lose all its triangles and get others.
  private checkCorners(delta: Delta): void {
    const fresh = new Set(delta.vertexIds);
    for (const corner of delta.corners)
      if (!this.uses[corner] && !fresh.has(corner)) throw new MeshError(`corner ${corner} is not alive`);
  }

  private makeRoom(delta: Delta): void {
    const vertices = Math.max(this.vertexBound, (delta.vertexIds.at(-1) ?? -1) + 1);
    const triangles = Math.max(this.triangleBound, (delta.madeIds.at(-1) ?? -1) + 1);
    this.positions = grown(this.positions, 3 * vertices);
    this.uses = grown(this.uses, vertices);
    this.corners = grown(this.corners, 3 * triangles);
    this.labels = grown(this.labels, triangles);
    this.vertexBound = vertices;
    this.triangleBound = triangles;
  }

  private addVertices(delta: Delta): void {
    delta.vertexIds.forEach((vertex, i) => {
      if (this.uses[vertex]) throw new MeshError(`new vertex ${vertex} has the id of a living one`);
      this.positions.set(delta.positions.subarray(3 * i, 3 * i + 3), 3 * vertex);
    });
  }

  private put(delta: Delta, i: number): void {
    const triangle = delta.madeIds[i]!;
    this.labels[triangle] = delta.labels[i]!;
    for (let k = 0; k < 3; k++) {
      const corner = (this.corners[3 * triangle + k] = delta.corners[3 * i + k]!);
      if (this.uses[corner]!++ === 0) {
        this.vertexCount++;
        if (this.hashes) this.add(this.vertexHash(corner));
      }
    }
    this.triangleCount++;
    if (this.hashes) this.add(this.triangleHash(triangle));
  }

  private drop(triangle: number): void {
    if (this.hashes) this.add(-this.triangleHash(triangle));
    this.triangleCount--;
    for (let k = 0; k < 3; k++) {
      const corner = this.corners[3 * triangle + k]!;
      if (--this.uses[corner]! === 0) {
        this.vertexCount--;
        if (this.hashes) this.add(-this.vertexHash(corner));
      }
    }
    this.corners.fill(0, 3 * triangle, 3 * triangle + 3);
  }

  private add(hash: bigint): void {
    this.hash = (this.hash + hash) & MASK;
  }

  private vertexHash(vertex: number): bigint {
    record.setUint32(0, vertex, true);
    for (let k = 0; k < 3; k++) record.setFloat32(4 + 4 * k, this.positions[3 * vertex + k]!, true);
    return hash16();
  }

  private triangleHash(triangle: number): bigint {
    record.setUint32(0, triangle, true);
    for (let k = 0; k < 3; k++) record.setUint32(4 + 4 * k, this.corners[3 * triangle + k]!, true);
    record.setUint32(16, this.labels[triangle]!, true);
    return hash20();
  }
}
