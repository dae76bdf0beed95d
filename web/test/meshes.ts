// Payloads that the C code made (tests/wire/mesh_file.c), with what it says of the mesh after each.
import { readFileSync } from "node:fs";

export interface Step {
  number: number;
  hash: bigint;
  vertices: number;
  triangles: number;
  payload: Uint8Array;
}

export function steps(): Step[] {
  const bytes = readFileSync("test/meshes.bin");
  const found: Step[] = [];
  for (let at = 0; at < bytes.length; ) {
    const size = bytes.readUInt32LE(at + 20);
    found.push({
      number: bytes.readUInt32LE(at),
      hash: bytes.readBigUInt64LE(at + 4),
      vertices: bytes.readUInt32LE(at + 12),
      triangles: bytes.readUInt32LE(at + 16),
      payload: Uint8Array.from(bytes.subarray(at + 24, at + 24 + size)),
    });
    at += 24 + size;
  }
  return found;
}
