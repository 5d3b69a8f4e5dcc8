// The episode: where it comes from (a server or this file), its steps, and where everything was at any moment.

const b64 = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

async function inflated(text) {
  const stream = new Blob([b64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

const byId = (id) => document.getElementById(id);

class FileSource {
  constructor(spec) { this.spec = spec; this.live = false; }
  pageStart() { return inflated(byId("d-page-start").textContent); }
  ground() { return inflated(byId("d-ground").textContent); }
  details(chunk) { return inflated(byId("d-details-" + chunk).textContent); }
  picture(id) {
    const n = this.spec.pictures[id];
    return n === undefined ? null : "data:image/jpeg;base64," + byId("d-picture-" + n).textContent;
  }
}

class ServerSource {
  constructor(spec) { this.token = new URLSearchParams(location.search).get("token") || ""; this.chunk = spec.chunk; }
  url(path, more) { return path + "?token=" + encodeURIComponent(this.token) + (more || ""); }
  async get(path, more) {
    const answer = await fetch(this.url(path, more), { cache: "no-store" });
    if (!answer.ok) throw new Error((await answer.text()).slice(0, 300) || answer.statusText);
    return answer.json();
  }
  pageStart() { return this.get("page-start"); }
  ground() { return this.get("ground"); }
  details(chunk) { return this.get("details", "&chunk=" + chunk); }
  picture(id) { return this.url("picture", "&id=" + encodeURIComponent(id)); }
  follow(from, taken, over) {
    const stream = new EventSource(this.url("follow", "&from=" + from));
    stream.addEventListener("steps", (event) => taken(JSON.parse(event.data)));
    stream.addEventListener("ending", (event) => { stream.close(); over(JSON.parse(event.data)); });
    return stream;
  }
}

class Episode {
  constructor(source, told) {
    this.source = source; this.head = told.head; this.live = told.live; this.ending = told.ending; this.notes = told.notes || [];
    this.steps = []; this.tracks = new Map(); this.cards = new Map(); this.shots = new Map(); this.reports = new Map();
    this.matched = new Map(); this.chunks = new Map(); this.states = [];
    this.owner = new Map(); this.head.agents.forEach((agent) => agent.controls.forEach((name) => { if (!this.owner.has(name)) this.owner.set(name, agent.id); }));
    told.steps.forEach((step) => this.take(step));
  }
  get last() { return this.steps.length - 1; }
  take(step) {
    const n = this.steps.length;
    this.steps.push(step);
    for (const card of step.cards || []) {
      this.cards.set(card.id, card);
      this.tracks.set(card.id, { t: [], x: [], y: [], z: [], h: [], status: [], sights: [], routes: [] });
    }
    for (const [id, samples] of Object.entries(step.moves || {})) {
      const track = this.tracks.get(id);
      for (const [t, x, y, z, h] of samples) {
        const k = track.t.length;
        if (k && t - track.t[k - 1] > this.head.tick_s / 4 + 0.11) this.push(track, Math.max(track.t[k - 1], t - this.head.tick_s / 5), track.x[k - 1], track.y[k - 1], track.z[k - 1], track.h[k - 1]);
        this.push(track, t, x, y, z, h);
      }
    }
    for (const [id, word] of Object.entries(step.status || {})) this.tracks.get(id).status.push([n, word]);
    for (const [id, sight] of Object.entries(step.sights || {})) this.tracks.get(id).sights.push([n, sight]);
    for (const [id, route] of Object.entries(step.routes || {})) this.tracks.get(id).routes.push([n, route]);
    for (const picture of step.pictures || []) {
      const owner = this.owner.get(picture.entity);
      for (const agent of new Set([...(picture.agents || []), ...(owner ? [owner] : [])])) {
        if (!this.shots.has(agent)) this.shots.set(agent, []);
        this.shots.get(agent).push([n, picture]);
      }
    }
    for (const report of step.reports || []) {
      if (!this.reports.has(report.frame)) this.reports.set(report.frame, []);
      this.reports.get(report.frame).push([n, report]);
    }
    for (const [id, target] of Object.entries(step.matched || {})) this.matched.set(id, [n, target]);
    if (step.stages) this.states.push([n, step.stages]);
  }
  push(track, t, x, y, z, h) { track.t.push(t); track.x.push(x); track.y.push(y); track.z.push(z); track.h.push(h); }
  // the simulated second of a place between two steps
  time(at) {
    const i = Math.max(0, Math.min(this.last, Math.floor(at))), a = this.steps[i].time, b = this.steps[Math.min(this.last, i + 1)].time;
    return a + (b - a) * Math.min(1, Math.max(0, at - i));
  }
  where(id, time) {
    const track = this.tracks.get(id), n = track ? track.t.length : 0;
    if (!n || time < track.t[0] - 0.05) return null;
    const i = upto(track.t, time + 0.05), j = Math.min(n - 1, i + 1), gap = track.t[j] - track.t[i];
    const f = gap > 0 ? Math.min(1, Math.max(0, (time - track.t[i]) / gap)) : 0, mix = (a) => a[i] + (a[j] - a[i]) * f;
    const turn = ((track.h[j] - track.h[i] + 540) % 360) - 180;
    return { x: mix(track.x), y: mix(track.y), z: mix(track.z), h: track.h[i] + turn * f, i };
  }
  latest(list, n) { let lo = 0, hi = list.length; while (lo < hi) { const m = (lo + hi) >> 1; if (list[m][0] <= n) lo = m + 1; else hi = m; } return lo ? list[lo - 1][1] : undefined; }
  place(list, n) { let lo = 0, hi = list.length; while (lo < hi) { const m = (lo + hi) >> 1; if (list[m][0] <= n) lo = m + 1; else hi = m; } return lo - 1; }
  detail(n) { // what is known of a step now; asks for it where it is not here yet
    const chunk = Math.floor(n / this.source.chunk), got = this.chunks.get(chunk);
    if (got === undefined) {
      this.chunks.set(chunk, null);
      this.source.details(chunk).then((list) => { this.chunks.set(chunk, list); if (this.changed) this.changed(); }, () => this.chunks.set(chunk, []));
      if (this.chunks.size > 40) this.chunks.delete(this.chunks.keys().next().value);
    }
    return got ? got[n % this.source.chunk] || null : null;
  }
  add(steps, details) { // live
    steps.forEach((step, k) => {
      const n = this.steps.length, chunk = Math.floor(n / this.source.chunk), got = this.chunks.get(chunk);
      if (step.tick <= (n ? this.steps[n - 1].tick : -1)) return;
      this.take(step);
      if (got) got[n % this.source.chunk] = details[k]; else if (n % this.source.chunk === 0) this.chunks.set(chunk, [details[k]]); else this.chunks.delete(chunk);
    });
  }
}

function upto(list, value) { let lo = 0, hi = list.length; while (lo < hi) { const m = (lo + hi) >> 1; if (list[m] <= value) lo = m + 1; else hi = m; } return Math.max(0, lo - 1); }
