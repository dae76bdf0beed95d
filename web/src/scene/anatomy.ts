// A case as the page has it: the surfaces of the mock-up (S) and of the patient (S'), in millimetres and
// each in the frame of its body, from case.json and anatomy.glb (docs/ARCHITECTURE.md, A case).
import { CaseGroup_Kind, type CaseGroup } from "wire";
import { groupOf, type Groups } from "../groups";
import { readParts, type GltfPart } from "./gltf";

const BODY_NAMES = ["femur", "tibia", "patella"];

export type Plane = [x: number, y: number, z: number, offset: number]; // inside: n·p <= offset

export interface Surface {
  positions: Float32Array; // mm
  normals: Float32Array;
}

export interface Group {
  name: string;
  about: CaseGroup;
  bone: boolean; // the one that its body is named after
  body: number;
  other: number; // the body that it bridges to; -1: none
  cuttable: boolean;
  triangles: Uint32Array;
  physical: Surface;
  virtual: Surface; // the same object where nothing is displaced
  otherShare: Float32Array | undefined; // of each vertex, 0 at its body to 1 at the other one
  cartilage: Uint8Array; // of each vertex of a bone: 1 where the part's name says so
  wear: Float32Array | undefined; // of each vertex the ICRS grade of its cartilage, 0 to 4; undefined: all is whole
  plan: Plane[][]; // the planned resection: a union of convex parts in the frame of S'
}

export interface Knee {
  name: string;
  title: string;
  left: boolean;
  groups: Group[];
  portals: { name: string; position: [number, number, number] }[];
}

interface Manifest {
  name: string;
  title?: string;
  side: string;
  groups: { name: string; body: string; bridges?: string; cuttable: boolean; lesion?: { plan?: Plane[][] } }[];
  portals?: { name: string; position: [number, number, number] }[];
}

export class CaseError extends Error {}

const kept = new Map<string, Promise<Knee>>();
const KEPT_MOST = 4;

/** Loads a case once; `key` is its name and hash. `groups`: what the server tells of it. */
export function loadKnee(name: string, key: string, groups: Groups): Promise<Knee> {
  let knee = kept.get(key);
  if (!knee) {
    kept.set(key, (knee = fetchKnee(name, groups)));
    knee.catch(() => kept.delete(key));
    for (const old of [...kept.keys()].slice(0, -KEPT_MOST)) kept.delete(old);
  }
  return knee;
}

async function fetchKnee(name: string, groups: Groups): Promise<Knee> {
  const get = async (file: string): Promise<Response> => {
    const response = await fetch(`/api/v1/cases/${encodeURIComponent(name)}/${file}`);
    if (!response.ok) throw new CaseError(`${file}: ${response.status}`);
    return response;
  };
  const [manifest, bytes] = await Promise.all([
    get("case.json").then((response) => response.json() as Promise<Manifest>),
    get("anatomy.glb").then((response) => response.arrayBuffer()),
  ]);
  return readKnee(manifest, bytes, groups);
}

export async function readKnee(manifest: Manifest, anatomy: ArrayBuffer, groups: Groups): Promise<Knee> {
  const parts = readParts(anatomy);
  return {
    name: manifest.name,
    title: manifest.title ?? manifest.name,
    left: manifest.side === "left",
    portals: manifest.portals ?? [],
    groups: manifest.groups.map((group) => readGroup(group, parts.filter((part) => part.group === group.name), groupOf(groups, group.name))),
  };
}

function readGroup(group: Manifest["groups"][number], parts: GltfPart[], about: CaseGroup): Group {
  if (!parts.length) throw new CaseError(`anatomy.glb has no ${group.name}`);
  const count = parts.reduce((sum, { otherShare }) => sum + otherShare.length, 0);
  const physical = new Float32Array(3 * count);
  const virtual = new Float32Array(3 * count);
  const share = new Float32Array(count);
  const cartilage = new Uint8Array(count);
  const wear = parts.some((part) => part.wear) ? new Float32Array(count) : undefined;
  const triangles = new Uint32Array(parts.reduce((sum, part) => sum + part.triangles.length, 0));
  let first = 0;
  let corner = 0;
  for (const part of parts) {
    physical.set(part.physical, 3 * first);
    virtual.set(part.virtual, 3 * first);
    share.set(part.otherShare, first);
    if (part.wear) wear!.set(part.wear, first);
    if (about.kind === CaseGroup_Kind.BONE && part.name.includes("cartilage")) cartilage.fill(1, first, first + part.otherShare.length);
    for (const vertex of part.triangles) triangles[corner++] = vertex + first;
    first += part.otherShare.length;
  }
  const surface = withNormals(physical, triangles);
  return {
    name: group.name,
    about,
    bone: group.name === group.body,
    body: BODY_NAMES.indexOf(group.body),
    other: BODY_NAMES.indexOf(group.bridges ?? ""),
    cuttable: group.cuttable,
    triangles,
    physical: surface,
    virtual: physical.every((value, i) => value === virtual[i]) ? surface : withNormals(virtual, triangles),
    otherShare: group.bridges ? share : undefined,
    cartilage,
    wear,
    plan: group.lesion?.plan ?? [],
  };
}

export function withNormals(positions: Float32Array, triangles: Uint32Array): Surface {
  const normals = new Float32Array(positions.length);
  addNormals(positions, triangles, triangles.length, normals);
  return { positions, normals };
}

/** Sums of the triangles' area vectors at each vertex, made unit; `normals` are overwritten. */
export function addNormals(positions: Float32Array, triangles: Uint32Array, count: number, normals: Float32Array): void {
  normals.fill(0);
  for (let i = 0; i < count; i += 3) {
    const a = 3 * triangles[i]!;
    const b = 3 * triangles[i + 1]!;
    const c = 3 * triangles[i + 2]!;
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    for (const at of [a, b, c]) {
      normals[at]! += nx;
      normals[at + 1]! += ny;
      normals[at + 2]! += nz;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!) || 1;
    normals[i]! /= length;
    normals[i + 1]! /= length;
    normals[i + 2]! /= length;
  }
}

/** How far a point is outside the planned resection, mm; negative inside: to the nearest face of the part that it is deepest in. */
export function outsidePlan(plan: Plane[][], x: number, y: number, z: number): number {
  let least = Infinity;
  for (const part of plan) {
    let most = -Infinity;
    for (const [a, b, c, offset] of part) most = Math.max(most, a * x + b * y + c * z - offset);
    least = Math.min(least, most);
  }
  return least;
}
