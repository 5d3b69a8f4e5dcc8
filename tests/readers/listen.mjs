// Connects to a live episode with Foxglove's own client (`@foxglove/ws-protocol`), subscribes to all channels and decodes
// their messages. When `/score` reports the end of the episode, prints the number of messages of each topic as JSON.
import protocol from "@foxglove/ws-protocol";
import Ajv from "ajv/dist/2020.js";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import { WebSocket } from "ws";

const { FoxgloveClient } = protocol;
const ajv = new Ajv({ strict: true });
const client = new FoxgloveClient({ ws: new WebSocket(process.argv[2], [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });
const subscribed = new Map();
const counts = {};
const last = {};
let times = 0;
let server;

function decoder(channel) {
  if (channel.encoding === "json") {
    const validate = ajv.compile(JSON.parse(channel.schema));
    return (data) => {
      const value = JSON.parse(new TextDecoder().decode(data));
      if (!validate(value)) throw new Error(`${channel.topic}: ${ajv.errorsText(validate.errors)}`);
      return value;
    };
  }
  const files = descriptor.FileDescriptorSet.decode(Buffer.from(channel.schema, "base64"));
  const type = protobuf.Root.fromDescriptor(files).resolveAll().lookupType(channel.schemaName);
  return (data) => type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
}

client.on("serverInfo", (info) => { server = info.name; });
client.on("error", (error) => { console.error(String(error?.message ?? error)); process.exit(1); });
client.on("advertise", (channels) => {
  for (const channel of channels) subscribed.set(client.subscribe(channel.id), { channel, decode: decoder(channel) });
});
client.on("time", () => { times += 1; });
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { channel, decode } = subscribed.get(subscriptionId);
  const value = decode(data);
  counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  const frames = (value.transforms ?? []).map((one) => one.childFrameId ?? one.child_frame_id);
  const entities = (value.entities ?? []).map((one) => one.id);
  last[channel.topic] = { time: Number(timestamp) / 1e9, named: [...(last[channel.topic]?.named ?? []), ...frames, ...entities] };
  if (channel.topic === "/score" && value.done) setTimeout(finish, 1000);
});

function finish() {
  for (const one of Object.values(last)) one.named = [...new Set(one.named)].sort();
  console.log(JSON.stringify({ server, counts, last, times }));
  process.exit(0);
}
