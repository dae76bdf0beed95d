// Reads a recording with the format's own library, each message by the schema that the file embeds, and prints it all
// as JSON. tests/system/mcap.py compares it with the session.
import { open, readFile } from "node:fs/promises";

import { createFileRegistry, fromBinary } from "@bufbuild/protobuf";
import { FileDescriptorSetSchema } from "@bufbuild/protobuf/wkt";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

async function openIndexed(path) {
  const file = await open(path);
  return McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt((await file.stat()).size),
      read: async (offset, size) => {
        const bytes = new Uint8Array(Number(size));
        await file.read(bytes, 0, bytes.length, Number(offset));
        return bytes;
      },
    },
  });
}

const nanoseconds = (stamp) => (stamp ? String(stamp.seconds * 1000000000n + BigInt(stamp.nanos)) : null);

// A mesh as what can be compared: its sizes, and the volume that it encloses.
function summary({ points, indices }) {
  let volume = 0;
  const at = (i) => points[indices[i]];
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [at(i), at(i + 1), at(i + 2)];
    volume += a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x);
  }
  return { points: points.length, triangles: indices.length / 3, volume_m3: volume / 6 };
}

function plain(value) {
  if (value?.$typeName === "google.protobuf.Timestamp") return nanoseconds(value);
  if (value?.$typeName === "foxglove.TriangleListPrimitive") return { ...summary(value), color: plain(value.color) };
  if (Array.isArray(value)) return value.map(plain);
  if (typeof value === "number" && !Number.isFinite(value)) return String(value);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).filter(([key]) => !key.startsWith("$")).map(([key, one]) => [key, plain(one)]));
}

const path = process.argv[2];
const reader = await openIndexed(path);
const found = { header: reader.header, topics: {}, metadata: {}, streamed: {} };

const decoders = new Map();
for (const schema of reader.schemasById.values()) {
  if (schema.encoding !== "protobuf") throw new Error(`${schema.name}: ${schema.encoding}`);
  const message = createFileRegistry(fromBinary(FileDescriptorSetSchema, schema.data)).getMessage(schema.name);
  if (!message) throw new Error(`${schema.name} is not in its own descriptor set`);
  decoders.set(schema.id, (data) => plain(fromBinary(message, data)));
}
for (const channel of reader.channelsById.values())
  found.topics[channel.topic] = { schema: reader.schemasById.get(channel.schemaId).name, messages: [] };
let before = 0n;
for await (const message of reader.readMessages()) {
  if (message.logTime < before) throw new Error("messages are not in the order of their times");
  before = message.logTime;
  const channel = reader.channelsById.get(message.channelId);
  const { messages } = found.topics[channel.topic];
  if (message.sequence !== messages.length) throw new Error(`${channel.topic}: message ${message.sequence} is out of order`);
  messages.push([String(message.logTime), decoders.get(channel.schemaId)(message.data)]);
}
for await (const metadata of reader.readMetadata()) found.metadata[metadata.name] = Object.fromEntries(metadata.metadata);

// Part of it by its index alone: one topic, from the middle on.
const { messageStartTime: first, messageEndTime: last } = reader.statistics;
const middle = (first + last) / 2n;
found.later = { from: String(middle), joint: 0 };
for await (const _ of reader.readMessages({ topics: ["/joint"], startTime: middle })) found.later.joint++;
found.statistics = Object.fromEntries(Object.entries(reader.statistics).map(([key, value]) => [key, value instanceof Map ? Object.fromEntries([...value].map(([id, count]) => [reader.channelsById.get(id).topic, Number(count)])) : Number(value)]));

// From the first byte to the last, with the checksums of the chunks.
const stream = new McapStreamReader({ validateCrcs: true, includeChunks: true });
stream.append(await readFile(path));
for (let record; (record = stream.nextRecord()); ) found.streamed[record.type] = (found.streamed[record.type] ?? 0) + 1;
found.done = stream.done();
console.log(JSON.stringify(found));
