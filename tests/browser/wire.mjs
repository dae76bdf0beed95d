// Messages as tests need them, read by hand: another reader than the pages'. The fields are those of
// shared/wire/arthron.proto.

/** A protobuf message as [number, value]: BigInt for varints, Buffer for all else. */
export function* fields(data) {
  let at = 0;
  const varint = () => {
    let value = 0n;
    for (let shift = 0n; ; shift += 7n) {
      const byte = data[at++];
      if (byte === undefined) throw new Error("cut short");
      value |= BigInt(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
  };
  while (at < data.length) {
    const key = Number(varint());
    const kind = key & 7;
    if (kind === 0) {
      yield [key >> 3, varint()];
      continue;
    }
    const size = kind === 1 ? 8 : kind === 5 ? 4 : Number(varint());
    yield [key >> 3, data.subarray(at, at + size)];
    at += size;
  }
}

const one = (data) => Object.fromEntries(fields(data));
const double = (bytes) => (bytes ? bytes.readDoubleLE() : 0);
const hex = (bytes) => (bytes ? bytes.readBigUInt64LE().toString(16).padStart(16, "0") : "0".repeat(16));

/** {q: [w, x, y, z], t: [x, y, z]} of a Pose; undefined where there is none. */
function pose(data) {
  if (!data) return undefined;
  const of = one(data);
  const values = [1, 2, 3, 4, 5, 6, 7].map((number) => double(of[number]));
  return { q: values.slice(0, 4), t: values.slice(4) };
}

/** A station's View. */
export function view(data) {
  const of = one(data);
  const all = [...fields(data)];
  const instruments = all.filter(([number]) => number === 7).map(([, bytes]) => {
    const { 1: channel, 2: validity, 3: time, 4: tip, 5: warpValidity, 6: warped, 7: age } = one(bytes);
    return {
      channel: Number(channel ?? 0n), validity: Number(validity ?? 0n), timeNs: time?.readBigInt64LE() ?? 0n, tip: pose(tip),
      warpValidity: Number(warpValidity ?? 0n), warped: pose(warped), ageMs: age ? age.readFloatLE() : 0,
    };
  });
  const bodies = all.filter(([number]) => number === 6).map(([, bytes]) => {
    const { 3: physical, 4: virtual } = one(bytes);
    return { pose: pose(physical), virtual: pose(virtual) };
  });
  return { number: Number(of[1].readBigUInt64LE()), timeNs: of[2].readBigInt64LE(), instruments, bodies };
}

export const LIVE = ["", "place", "session", "moment", "resection", "mesh_chunk", "remark", "metrics", "command_reply", "progress", "trouble", "beat", "marker"];

/** What kinds of messages are in a LiveBatch. */
export function kindsOfBatch(data) {
  return [...fields(data)].map(([, item]) => LIVE[[...fields(item)][0]?.[0]] ?? "unknown");
}

/** The mesh that a page says it has, of a Page message; undefined where it says something else. */
export function meshAck(data) {
  const { 5: ack } = one(data);
  if (!ack) return undefined;
  const { 1: group, 2: number, 3: hash } = one(ack);
  return { group: group.toString(), number: Number(number ?? 0n), hash: hex(hash) };
}
