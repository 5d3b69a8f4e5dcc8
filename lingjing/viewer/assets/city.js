// The city: one mesh of flat shapes and extruded buildings, drawn with WebGL 2; on a plain canvas where there is none.

const LOOKS = {
  light: { sky: "#e9eef3", ground: "#edebe6", water: "#bcd9e8", land: "#edebe6", slab: "#e3dfd8", area: "#e6e2da",
    path: "#e5e0d8", road: "#ffffff", solid: "#cfc8be", bridge: "#fbfaf8", building: "#f2efe9", roof: "#fdfcfa",
    edge: "#b9b0a4", tree: "#9cbd86", pipe: "#a8987f", green: "#d5e5c3", paved: "#e2dfda", sand: "#efe6cb", shadow: 0.16 },
  dark: { sky: "#0d1218", ground: "#141a21", water: "#0f2536", land: "#161d24", slab: "#1a2129", area: "#1a2128",
    path: "#1d242c", road: "#2b343f", solid: "#333c46", bridge: "#35404c", building: "#3a4653", roof: "#465362",
    edge: "#6b7c8e", tree: "#24402f", pipe: "#6a5a43", green: "#17281f", paved: "#1e252d", sand: "#2a2a20", shadow: 0.32 },
};
const GREEN = new Set(["park", "grass", "forest", "pitch", "grass land"]);
const PAVED = new Set(["plaza", "sidewalk", "parking", "asphalt", "concrete", "concrete land", "industrial", "commercial", "residential"]);
const LAYERS = ["water", "land", "slab", "area", "path", "road", "solid", "bridge", "building", "tree", "pipe"];
const LIFT_M = 0.06; // between layers, so that what covers what is the order of the plan

function colourOf(shape, look) {
  if (GREEN.has(shape.surface)) return look.green;
  if (PAVED.has(shape.surface)) return look.paved;
  if (shape.surface === "sand") return look.sand;
  return look[shape.layer] || null;
}

function rgb(hex) {
  const n = parseInt(hex.slice(1), 16);
  return [(n >> 16) / 255, ((n >> 8) & 255) / 255, (n & 255) / 255];
}

// -- the camera: looks at (x, y, z) from a distance, turned by `turn` (0: north is up) and tilted (90: from above)

class Camera {
  constructor() {
    Object.assign(this, { x: 0, y: 0, z: 0, distance: 500, turn: -28, tilt: 48, flat: false, wide: 1, high: 1 });
    this.fov = 38 * Math.PI / 180;
  }
  fit(frame, wide, high) {
    const [west, south, east, north] = frame;
    this.x = (west + east) / 2; this.y = (south + north) / 2; this.z = 0;
    this.wide = wide; this.high = high;
    this.distance = Math.max(north - south, east - west);
    for (let pass = 0; pass < 6; pass++) { // until the corners just fit
      this.matrix();
      const at = [[west, south], [east, south], [east, north], [west, north]].map(([x, y]) => this.project(x, y, 0));
      if (!at.every(Boolean)) { this.distance *= 2; continue; }
      const xs = at.map((p) => p[0]), ys = at.map((p) => p[1]);
      const share = Math.max((Math.max(...xs) - Math.min(...xs)) / wide, (Math.max(...ys) - Math.min(...ys)) / high) / 0.86;
      this.distance *= Math.max(0.3, Math.min(3, share));
      this.pan(wide / 2 - (Math.max(...xs) + Math.min(...xs)) / 2, high / 2 - (Math.max(...ys) + Math.min(...ys)) / 2 + 8);
    }
  }
  matrix() {
    const tilt = (this.flat ? 90 : this.tilt) * Math.PI / 180, turn = (this.flat ? 0 : this.turn) * Math.PI / 180;
    const back = [-Math.sin(turn) * Math.cos(tilt), -Math.cos(turn) * Math.cos(tilt), Math.sin(tilt)];
    const right = [Math.cos(turn), -Math.sin(turn), 0];
    const up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]];
    const eye = [this.x + back[0] * this.distance, this.y + back[1] * this.distance, this.z + back[2] * this.distance];
    this.eye = eye; this.right = right; this.up = up;
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, dot(right), dot(up), dot(back), 1];
    const near = this.distance * 0.02, far = this.distance * 12 + 4000, aspect = this.wide / this.high;
    let shape;
    if (this.flat) {
      const half = this.distance * Math.tan(this.fov / 2);
      shape = [1 / (half * aspect), 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, -2 / (far - near), 0, 0, 0, -(far + near) / (far - near), 1];
    } else {
      const f = 1 / Math.tan(this.fov / 2);
      shape = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, -(far + near) / (far - near), -1, 0, 0, -2 * far * near / (far - near), 0];
    }
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[c * 4 + r] += shape[k * 4 + r] * view[c * 4 + k];
    return this.m = out;
  }
  // pixel of a point, or null behind the camera; the third number is how many pixels a metre is there
  project(x, y, z) {
    const m = this.m, w = m[3] * x + m[7] * y + m[11] * z + m[15];
    if (w <= 1e-3) return null;
    const px = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w, py = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
    const scale = this.flat ? this.high / 2 / (this.distance * Math.tan(this.fov / 2)) : this.high / 2 / Math.tan(this.fov / 2) / w;
    return [(px + 1) / 2 * this.wide, (1 - py) / 2 * this.high, scale];
  }
  perPixel() { return 2 * this.distance * Math.tan(this.fov / 2) / this.high; }
  pan(dx, dy) {
    const turn = (this.flat ? 0 : this.turn) * Math.PI / 180, p = this.perPixel();
    const along = this.flat ? 1 : 1 / Math.max(0.35, Math.sin(this.tilt * Math.PI / 180));
    this.x += -dx * p * Math.cos(turn) + dy * p * along * Math.sin(turn);
    this.y += dx * p * Math.sin(turn) + dy * p * along * Math.cos(turn);
  }
}

// -- meshes: nine floats a corner: place, normal, colour; buildings have a tenth, the height of their foot

function meshes(ground, look) {
  const flat = [], tall = [], edges = [];
  const put = (to, x, y, z, n, c, foot) => { to.push(x, y, z, n[0], n[1], n[2], c[0], c[1], c[2], foot); };
  const UP = [0, 0, 1];
  for (const shape of ground.shapes) {
    const hex = colourOf(shape, look);
    if (!hex) continue;
    const c = rgb(hex), lift = LAYERS.indexOf(shape.layer) * LIFT_M;
    if (shape.width) ribbon(shape, c, lift, (x, y, z) => put(flat, x, y, z, UP, c, z));
    else if (shape.layer === "building" || shape.layer === "solid") prism(shape, c, look, tall, edges, put);
    else {
      const xy = shape.rings.flat(), z = (shape.top || 0) / 10 + lift;
      for (const i of shape.triangles) put(flat, xy[2 * i] / 10, xy[2 * i + 1] / 10, z, UP, c, z);
    }
  }
  return { flat: new Float32Array(flat), tall: new Float32Array(tall), edges: new Float32Array(edges) };
}

function ribbon(shape, c, lift, put) {
  const p = shape.rings[0], half = shape.width / 20, h = shape.heights || [];
  const z = (i) => (h[i] || 0) / 10 + lift;
  if (p.length === 2) { // a tree: a six-cornered cone
    const x = p[0] / 10, y = p[1] / 10, b = z(0), top = b + half * 3;
    for (let k = 0; k < 6; k++) {
      const a = k * Math.PI / 3, d = a + Math.PI / 3;
      put(x + half * Math.cos(a), y + half * Math.sin(a), b + half * 0.6); put(x + half * Math.cos(d), y + half * Math.sin(d), b + half * 0.6); put(x, y, top);
    }
    return;
  }
  const n = p.length / 2, left = [], right = [];
  for (let i = 0; i < n; i++) {
    const a = Math.max(0, i - 1), b = Math.min(n - 1, i + 1);
    let dx = p[2 * b] - p[2 * a], dy = p[2 * b + 1] - p[2 * a + 1];
    const len = Math.hypot(dx, dy) || 1; dx /= len; dy /= len;
    const x = p[2 * i] / 10, y = p[2 * i + 1] / 10;
    left.push([x - dy * half, y + dx * half, z(i)]); right.push([x + dy * half, y - dx * half, z(i)]);
  }
  for (let i = 0; i + 1 < n; i++) {
    put(...left[i]); put(...right[i]); put(...right[i + 1]); put(...left[i]); put(...right[i + 1]); put(...left[i + 1]);
  }
}

function prism(shape, c, look, tall, edges, put) {
  const base = (shape.base || 0) / 10, top = (shape.top || 0) / 10, roof = shape.layer === "building" ? rgb(look.roof) : c, e = rgb(look.edge);
  const xy = shape.rings.flat();
  for (const i of shape.triangles) put(tall, xy[2 * i] / 10, xy[2 * i + 1] / 10, top, [0, 0, 1], roof, base);
  const low = c.map((v) => v * 0.78);
  shape.rings.forEach((ring, nth) => {
    const n = ring.length / 2;
    let area = 0;
    for (let i = 0; i < n; i++) { const j = (i + 1) % n; area += ring[2 * i] * ring[2 * j + 1] - ring[2 * j] * ring[2 * i + 1]; }
    const sign = (area > 0) === (nth === 0) ? 1 : -1;
    for (let i = 0; i < n; i++) {
      const j = (i + 1) % n, ax = ring[2 * i] / 10, ay = ring[2 * i + 1] / 10, bx = ring[2 * j] / 10, by = ring[2 * j + 1] / 10;
      const len = Math.hypot(bx - ax, by - ay) || 1, normal = [sign * (by - ay) / len, -sign * (bx - ax) / len, 0];
      put(tall, ax, ay, base, normal, low, base); put(tall, bx, by, base, normal, low, base); put(tall, bx, by, top, normal, c, base);
      put(tall, ax, ay, base, normal, low, base); put(tall, bx, by, top, normal, c, base); put(tall, ax, ay, top, normal, c, base);
      put(edges, ax, ay, top + 0.05, normal, e, base); put(edges, bx, by, top + 0.05, normal, e, base);
    }
  });
}

// -- drawing

const VERTEX = `#version 300 es
in vec3 place; in vec3 normal; in vec3 colour; in float foot;
uniform mat4 view; uniform vec3 sun; uniform float shade;
out vec3 c; out float far; out float storey; out float wall;
void main() {
  vec3 at = place;
  if (shade > 0.5) { at.xy -= sun.xy / sun.z * (at.z - foot); at.z = foot + 0.75; }
  float light = 0.68 + 0.32 * max(dot(normal, sun), 0.0) + 0.06 * normal.z;
  c = colour * light; storey = (place.z - foot) / 3.2; wall = 1.0 - step(0.5, normal.z);
  gl_Position = view * vec4(at, 1.0); far = gl_Position.w;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 c; in float far; in float storey; in float wall;
uniform vec3 sky; uniform float reach; uniform float shade; uniform float shadow; uniform float windows;
out vec4 pixel;
void main() {
  if (shade > 0.5) { pixel = vec4(0.0, 0.0, 0.0, shadow); return; }
  float fine = 1.0 - clamp(fwidth(storey) * 3.0, 0.0, 1.0);
  float band = smoothstep(0.30, 0.36, fract(storey)) * (1.0 - smoothstep(0.74, 0.80, fract(storey)));
  vec3 shown = c * (1.0 - 0.13 * band * fine * wall * windows);
  float fog = clamp((far - reach) / (reach * 3.0), 0.0, 0.9);
  pixel = vec4(mix(shown, sky, fog), 1.0);
}`;

class CityView {
  constructor(canvas) {
    this.canvas = canvas;
    this.ground = null; this.look = LOOKS.dark;
    this.gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: false, powerPreference: "low-power" });
    if (this.gl && !this.compile()) { // a canvas has one kind of context for good
      this.gl = null; const fresh = canvas.cloneNode(); canvas.replaceWith(fresh); this.canvas = canvas = fresh;
    }
    if (!this.gl) this.pen = canvas.getContext("2d");
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.lost = true; });
    canvas.addEventListener("webglcontextrestored", () => { this.lost = false; this.compile(); this.load(this.ground, this.look); });
  }
  compile() {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return false;
    this.program = program; this.at = {};
    for (const name of ["view", "sun", "shade", "sky", "reach", "shadow", "windows"]) this.at[name] = gl.getUniformLocation(program, name);
    return true;
  }
  load(ground, look) {
    this.ground = ground; this.look = look;
    if (!this.gl || !ground) return;
    const gl = this.gl, made = meshes(ground, look);
    for (const part of Object.values(this.parts || {})) { gl.deleteBuffer(part.buffer); gl.deleteVertexArray(part.array); }
    this.parts = {};
    for (const name of ["flat", "tall", "edges"]) {
      const array = gl.createVertexArray(), buffer = gl.createBuffer();
      gl.bindVertexArray(array); gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, made[name], gl.STATIC_DRAW);
      [["place", 3, 0], ["normal", 3, 12], ["colour", 3, 24], ["foot", 1, 36]].forEach(([word, size, from]) => {
        const where = gl.getAttribLocation(this.program, word);
        if (where >= 0) { gl.enableVertexAttribArray(where); gl.vertexAttribPointer(where, size, gl.FLOAT, false, 40, from); }
      });
      this.parts[name] = { array, buffer, count: made[name].length / 10 };
    }
  }
  draw(camera) {
    if (this.lost) return;
    if (!this.gl) return this.paint(camera);
    const gl = this.gl, sky = rgb(this.ground && this.ground.known ? (this.ground.sea ? this.look.water : this.look.ground) : this.look.ground);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(sky[0], sky[1], sky[2], 1); gl.clearStencil(0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    if (!this.parts) return;
    gl.useProgram(this.program); gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);
    const sun = [-0.45, 0.35, 0.82];
    gl.uniformMatrix4fv(this.at.view, false, camera.m); gl.uniform3fv(this.at.sun, sun); gl.uniform3fv(this.at.sky, sky);
    gl.uniform1f(this.at.reach, camera.flat ? 1e9 : camera.distance * 1.6); gl.uniform1f(this.at.shadow, this.look.shadow);
    gl.uniform1f(this.at.windows, camera.flat ? 0 : 1); gl.uniform1f(this.at.shade, 0);
    const run = (name, mode) => { const part = this.parts[name]; if (part.count) { gl.bindVertexArray(part.array); gl.drawArrays(mode, 0, part.count); } };
    run("flat", gl.TRIANGLES);
    gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA); gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255); gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR); gl.depthMask(false); gl.uniform1f(this.at.shade, 1);
    run("tall", gl.TRIANGLES);
    gl.disable(gl.STENCIL_TEST); gl.disable(gl.BLEND); gl.depthMask(true); gl.uniform1f(this.at.shade, 0);
    run("tall", gl.TRIANGLES); run("edges", gl.LINES);
  }
  paint(camera) { // no WebGL: the plan, or the same shapes lying flat
    const pen = this.pen, ratio = this.canvas.width / camera.wide;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = this.ground && this.ground.sea ? this.look.water : this.look.ground; pen.fillRect(0, 0, camera.wide, camera.high);
    for (const shape of this.ground ? this.ground.shapes : []) {
      const hex = colourOf(shape, this.look);
      if (!hex) continue;
      const z = shape.layer === "building" ? (shape.top || 0) / 10 : 0;
      pen.beginPath();
      for (const ring of shape.rings) {
        for (let i = 0; i < ring.length; i += 2) {
          const at = camera.project(ring[i] / 10, ring[i + 1] / 10, z);
          if (at) i ? pen.lineTo(at[0], at[1]) : pen.moveTo(at[0], at[1]);
        }
        if (!shape.width) pen.closePath();
      }
      if (shape.width) { pen.strokeStyle = hex; pen.lineWidth = Math.max(0.5, shape.width / 10 / camera.perPixel()); pen.stroke(); }
      else { pen.fillStyle = hex; pen.fill("evenodd"); }
    }
  }
}
