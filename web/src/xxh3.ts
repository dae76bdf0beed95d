// XXH3-64 with seed 0 of 16 and of 20 bytes: the records of vertices and triangles (PROTOCOL.md, Meshes).

export const MASK = 0xffffffffffffffffn;
const FLIP_LOW = 0x1f67b3b7a4a44072n ^ 0x78e5c0cc4ee679cbn; // secret, bytes 24 to 39
const FLIP_HIGH = 0x2172ffcc7dd05a82n ^ 0x8e2443f7744608b8n; // secret, bytes 40 to 55
const SECRET_0 = 0xbe4ba423396cfeb8n;
const SECRET_8 = 0x1cad21f72c81017cn;
const SECRET_16 = 0xdb979083e96dd4den;
const SECRET_24 = 0x1f67b3b7a4a44072n;
const PRIME = 0x9e3779b185ebca87n;

function fold(a: bigint, b: bigint): bigint {
  const product = a * b;
  return (product & MASK) ^ (product >> 64n);
}

function avalanche(h: bigint): bigint {
  h &= MASK;
  h ^= h >> 37n;
  h = (h * 0x165667919e3779f9n) & MASK;
  return h ^ (h >> 32n);
}

export const record = new DataView(new ArrayBuffer(20));
const swapped = new DataView(new ArrayBuffer(8));

/** Of the first 16 bytes of `record`. */
export function hash16(): bigint {
  const low = record.getBigUint64(0, true) ^ FLIP_LOW;
  const high = record.getBigUint64(8, true) ^ FLIP_HIGH;
  swapped.setBigUint64(0, low, true);
  return avalanche(16n + swapped.getBigUint64(0) + high + fold(low, high));
}

/** Of all 20 bytes of `record`. */
export function hash20(): bigint {
  const first = fold(record.getBigUint64(0, true) ^ SECRET_0, record.getBigUint64(8, true) ^ SECRET_8);
  const last = fold(record.getBigUint64(4, true) ^ SECRET_16, record.getBigUint64(12, true) ^ SECRET_24);
  return avalanche(20n * PRIME + first + last);
}
