// What moves and what is said about places: drawn over the city on a plain canvas, so that nothing hides it.

const ASSET_INKS = {
  dark: ["#56b4ff", "#ff9e5e", "#be96ff", "#5ee2c8", "#f0d660", "#ff82be", "#a0e260", "#c8d0dc"],
  light: ["#1f6fd1", "#c2410c", "#6d28d9", "#0f766e", "#a16207", "#be185d", "#4d7c0f", "#334155"],
};
const SIGNS = {
  known: ["○", "known"], found: ["◆", "found"], completed: ["●", "completed"], truth: ["◇", "hidden, shown as the truth"],
};
const SIGN_INKS = {
  dark: { known: "#d2d7dc", found: "#ffb432", completed: "#3cdc78", truth: "#ff6f86" },
  light: { known: "#52606d", found: "#c27200", completed: "#0f8a45", truth: "#c92a4d" },
};
const FRESH_TICKS = 8, TRAIL_POINTS = 260, NAMED = 40;

class Marks {
  constructor(canvas, episode, camera) { this.canvas = canvas; this.pen = canvas.getContext("2d"); this.episode = episode; this.camera = camera; this.spots = []; }
  ink(card) { const inks = ASSET_INKS[this.theme]; return inks[((card.colour % inks.length) + inks.length) % inks.length]; }
  draw(at, chosen, theme, picture) {
    const { pen, camera, episode } = this, ratio = this.canvas.width / camera.wide, n = Math.max(0, Math.floor(at)), time = episode.time(at);
    this.theme = theme; this.halo = theme === "dark" ? "#0b0f14" : "#ffffff"; this.spots = [];
    pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.clearRect(0, 0, camera.wide, camera.high); pen.lineJoin = pen.lineCap = "round";
    const region = theme === "dark" ? "#46b4cc" : "#2f7f9e";
    for (const polygon of episode.head.regions) { this.path(polygon.map((p) => [p[0], p[1], 0]), true); pen.globalAlpha = 0.06; pen.fillStyle = region; pen.fill(); pen.globalAlpha = 0.75; this.stroke(region, 1.4, [6, 5]); }
    this.traffic(episode.steps[n], theme);
    if (picture) this.view(picture, theme);
    const cards = [...episode.cards.values()], assets = cards.filter((c) => c.role === "asset"), targets = cards.filter((c) => c.role === "target");
    for (const card of assets) {
      const route = episode.latest(episode.tracks.get(card.id).routes, n);
      if (route) { this.path(route.map((p) => [p[0], p[1], 0.5])); pen.globalAlpha = 0.55; this.stroke(this.ink(card), 1.5, [2, 5]); }
    }
    for (const card of assets) this.trail(card, time, chosen);
    const labels = [];
    for (const card of targets) this.target(card, n, time, labels);
    for (const card of assets) this.body(card, n, time, chosen, labels);
    this.names(labels, chosen);
    pen.globalAlpha = 1;
  }
  path(points, closed) {
    const { pen, camera } = this; let on = false; pen.beginPath();
    for (const p of points) { const q = camera.project(p[0], p[1], p[2]); if (!q) { on = false; continue; } on ? pen.lineTo(q[0], q[1]) : pen.moveTo(q[0], q[1]); on = true; }
    if (closed) pen.closePath();
  }
  stroke(ink, width, dash) { const pen = this.pen; pen.setLineDash(dash || []); pen.strokeStyle = ink; pen.lineWidth = width; pen.stroke(); pen.setLineDash([]); pen.globalAlpha = 1; }
  traffic(step, theme) {
    const { pen, camera } = this; pen.fillStyle = theme === "dark" ? "#8fa1b5" : "#7b8794"; pen.globalAlpha = 0.75;
    for (const [x, y, h] of step.ambient || []) {
      const a = h * Math.PI / 180, f = [Math.sin(a), Math.cos(a)], size = 1;
      const q = [[2.4, 1], [2.4, -1], [-2.4, -1], [-2.4, 1]].map(([u, v]) => camera.project(x + size * (u * f[0] + v * f[1]), y + size * (u * f[1] - v * f[0]), 0.8));
      if (q.every(Boolean)) { pen.beginPath(); q.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1]))); pen.closePath(); pen.fill(); }
    }
    pen.globalAlpha = 1;
  }
  view(picture, theme) { // the ground that the camera of the picture sees
    const { position, heading, tilt, hfov } = picture.view, rad = Math.PI / 180, h = heading * rad, t = (tilt || 0) * rad;
    const half = Math.tan(hfov * rad / 2), high = half * picture.height / picture.width;
    const ahead = [Math.sin(h) * Math.cos(t), Math.cos(h) * Math.cos(t), -Math.sin(t)], right = [Math.cos(h), -Math.sin(h), 0];
    const up = [Math.sin(h) * Math.sin(t), Math.cos(h) * Math.sin(t), Math.cos(t)], corners = [];
    for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const ray = ahead.map((a, k) => a + u * half * right[k] + v * high * up[k]), far = ray[2] < -0.02 ? Math.min(position[2] / -ray[2], 900) : 120;
      corners.push(position.map((p, k) => p + ray[k] * Math.max(far, 0)));
    }
    const ink = theme === "dark" ? "#ffffff" : "#1b2430";
    this.path(corners, true); this.pen.globalAlpha = 0.07; this.pen.fillStyle = ink; this.pen.fill(); this.pen.globalAlpha = 0.5; this.stroke(ink, 1);
    for (const corner of corners) { this.path([position, corner]); this.pen.globalAlpha = 0.2; this.stroke(ink, 1); }
  }
  trail(card, time, chosen) {
    const { episode } = this, track = episode.tracks.get(card.id), end = upto(track.t, time), here = episode.where(card.id, time);
    if (!here || here.z > 20000) return;
    const fresh = upto(track.t, time - FRESH_TICKS * episode.head.tick_s), stride = Math.max(1, Math.ceil(fresh / TRAIL_POINTS)), old = [], recent = [];
    const point = (i) => [track.x[i], track.y[i], track.z[i]];
    for (let i = 0; i < fresh; i += stride) old.push(point(i));
    old.push(point(fresh));
    const step = Math.max(1, Math.ceil((end - fresh) / TRAIL_POINTS));
    for (let i = fresh; i <= end; i += step) recent.push(point(i));
    recent.push([here.x, here.y, here.z]);
    const mine = episode.owner.get(card.id) === chosen;
    this.path(old); this.pen.globalAlpha = mine ? 0.5 : 0.3; this.stroke(this.ink(card), 1.4);
    this.path(recent); this.pen.globalAlpha = mine ? 1 : 0.8; this.stroke(this.ink(card), mine ? 3 : 2);
  }
  target(card, n, time, labels) {
    const { pen, camera, episode } = this, track = episode.tracks.get(card.id), place = episode.where(card.id, time), sight = episode.latest(track.sights, n);
    const status = episode.latest(track.status, n);
    if (!place || !sight || (status && status[0] === "dormant")) return;
    const q = camera.project(place.x, place.y, place.z);
    if (!q) return;
    const ink = SIGN_INKS[this.theme][sight], r = 6;
    pen.beginPath();
    if (sight === "known" || sight === "completed") pen.arc(q[0], q[1], r - 1, 0, 7); else { pen.moveTo(q[0], q[1] - r - 1); pen.lineTo(q[0] + r, q[1]); pen.lineTo(q[0], q[1] + r + 1); pen.lineTo(q[0] - r, q[1]); pen.closePath(); }
    this.strokeTwice(ink, sight === "found" || sight === "completed");
    labels.push([q, card.label || card.id, ink, 1]);
  }
  strokeTwice(ink, filled) {
    const pen = this.pen; pen.strokeStyle = this.halo; pen.lineWidth = 4.5; pen.stroke();
    if (filled) { pen.fillStyle = ink; pen.fill(); } else { pen.fillStyle = this.halo; pen.globalAlpha = 0.55; pen.fill(); pen.globalAlpha = 1; }
    pen.strokeStyle = ink; pen.lineWidth = 2; pen.stroke();
  }
  body(card, n, time, chosen, labels) {
    const { pen, camera, episode } = this, place = episode.where(card.id, time), status = episode.latest(episode.tracks.get(card.id).status, n);
    if (!place || place.z > 20000 || (status && status[0] === "dormant")) return;
    const q = camera.project(place.x, place.y, place.z), foot = camera.project(place.x, place.y, 0);
    if (!q) return;
    const ink = this.ink(card), mine = episode.owner.get(card.id) === chosen, size = (mine ? 11 : 9) / q[2], a = place.h * Math.PI / 180, f = [Math.sin(a), Math.cos(a)];
    if (foot && !camera.flat && Math.abs(place.z) > 2) { pen.beginPath(); pen.moveTo(q[0], q[1]); pen.lineTo(foot[0], foot[1]); pen.globalAlpha = 0.6; this.stroke(ink, 1, [2, 3]); pen.beginPath(); pen.ellipse(foot[0], foot[1], 4, 2.4, 0, 0, 7); pen.fillStyle = ink; pen.globalAlpha = 0.6; pen.fill(); pen.globalAlpha = 1; }
    const points = [[1.5, 0], [-1, 0.95], [-0.45, 0], [-1, -0.95]].map(([u, v]) => camera.project(place.x + size * (u * f[0] + v * f[1]), place.y + size * (u * f[1] - v * f[0]), place.z));
    if (!points.every(Boolean)) return;
    if (mine) { pen.beginPath(); pen.arc(q[0], q[1], 17, 0, 7); pen.globalAlpha = 0.9; this.stroke(ink, 1.5); pen.beginPath(); pen.arc(q[0], q[1], 17, 0, 7); pen.fillStyle = ink; pen.globalAlpha = 0.14; pen.fill(); pen.globalAlpha = 1; }
    pen.beginPath(); points.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1]))); pen.closePath(); this.strokeTwice(ink, true);
    this.spots.push([q[0], q[1], episode.owner.get(card.id)]);
    labels.push([q, card.label || card.id, ink, mine ? 0 : 2]);
  }
  names(labels, chosen) {
    const { pen, camera } = this, taken = this.spots.map(([x, y]) => [x - 8, y - 8, x + 8, y + 8]);
    pen.font = "600 11.5px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.lineWidth = 3.5; pen.strokeStyle = this.halo;
    const crowd = labels.length > NAMED;
    labels.sort((a, b) => a[3] - b[3]);
    for (const [q, text, ink, rank] of labels) {
      if (crowd && rank) continue;
      const short = text.length > 22 ? text.slice(0, 21) + "…" : text, wide = pen.measureText(short).width, away = rank ? 12 : 21;
      for (const x of [q[0] + away, q[0] - away - wide]) {
        const box = [x - 2, q[1] - 8, x + wide + 2, q[1] + 8];
        if (box[0] < 0 || box[2] > camera.wide || taken.some((t) => t[0] < box[2] && t[2] > box[0] && t[1] < box[3] && t[3] > box[1])) continue;
        taken.push(box); pen.strokeText(short, x, q[1]); pen.fillStyle = ink; pen.fillText(short, x, q[1]);
        break;
      }
    }
  }
  hit(x, y) { let best = null, near = 22; for (const [sx, sy, agent] of this.spots) { const d = Math.hypot(x - sx, y - sy); if (agent && d < near) { near = d; best = agent; } } return best; }
}
