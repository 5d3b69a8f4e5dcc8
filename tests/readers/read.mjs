// Reads a trace as Foxglove does: `@mcap/core` with its indexes, JSON against its schemas with ajv in strict mode,
// Protobuf with the descriptors of the file. Prints the results as JSON; exits with 1 at the first error.
import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import Ajv from "ajv/dist/2020.js";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const file = await open(process.argv[2], "r");
const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(file),
  decompressHandlers: await loadDecompressHandlers(),
});

const ajv = new Ajv({ strict: true, allErrors: true });
const decoders = new Map();
for (const [id, schema] of reader.schemasById) {
  if (schema.encoding === "jsonschema") {
    const validate = ajv.compile(JSON.parse(new TextDecoder().decode(schema.data)));
    decoders.set(id, (data) => {
      const value = JSON.parse(new TextDecoder().decode(data));
      if (!validate(value)) throw new Error(`${schema.name}: ${ajv.errorsText(validate.errors)}`);
      return value;
    });
  } else {
    const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
    root.resolveAll();
    const type = root.lookupType(schema.name);
    decoders.set(id, (data) => type.decode(data));
  }
}

const counts = {};
const last = {};
let before = 0n;
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  if (message.logTime < before) throw new Error(`${channel.topic} is out of order`);
  before = message.logTime;
  last[channel.topic] = decoders.get(channel.schemaId)(message.data);
  counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
}
const city = (last["/scene/city"]?.entities ?? []).map((entity) => ({
  id: entity.id,
  points: entity.triangles[0].points.length,
  indices: entity.triangles[0].indices.length,
  most: Math.max(...entity.triangles[0].indices),
}));
console.log(JSON.stringify({ counts, city, score: last["/score"], chunks: reader.chunkIndexes.length }));
await file.close();
