// The player: reads the episode, draws it, and listens to keys, buttons, touch and the server.

const KINDS = { information_handoff: "#3f9bff", cooperation: "#2fbf71", competition: "#e8505b", guidance: "#b47cff", dependency: "#e0a030" };
const SPEEDS = [0.5, 1, 2, 4, 8, 16, 32];
const PANES = ["agent", "log", "relations", "goal"];
const SVG = "http://www.w3.org/2000/svg";

function node(tag, text, name) { const made = document.createElement(tag); if (text !== undefined) made.textContent = text; if (name) made.className = name; return made; }
function drawn(tag, facts) { const made = document.createElementNS(SVG, tag); for (const [k, v] of Object.entries(facts)) made.setAttribute(k, v); return made; }
function remembered(key, value) { try { if (value === undefined) return localStorage.getItem(key); localStorage.setItem(key, value); } catch { /* a file without storage */ } return null; }

class Player {
  constructor(episode) {
    this.episode = episode; this.at = episode.live ? Math.max(0, episode.last) : 0; this.playing = false; this.pane = "agent"; this.shown = -1;
    this.agent = episode.head.agents.length ? episode.head.agents[0].id : ""; this.following = false;
    this.theme = document.documentElement.dataset.theme;
    this.camera = new Camera(); this.city = new CityView(byId("city")); this.marks = new Marks(byId("marks"), episode, this.camera);
    this.graph = { counted: -1, counts: new Map(), fresh: new Map() };
    episode.changed = () => { this.shown = -1; this.draw(); };
    this.words(); this.agents(); this.size(); this.camera.fit(episode.head.frame, this.camera.wide, this.camera.high);
    this.listen(); this.show("agent"); this.draw();
  }
  words() {
    const { head, ending } = this.episode;
    byId("title").textContent = head.title || head.mission; document.title = `${head.mission} · seed ${head.seed} · Lingjing`;
    byId("facts").textContent = [head.mission, `seed ${head.seed}`, head.mode, head.policies.join(", ")].concat(head.truth ? ["truth shown"] : []).filter(Boolean).join(" · ");
    byId("goal").textContent = head.goal; byId("credit").textContent = head.credit; byId("live").hidden = !this.episode.live;
    const speed = byId("speed"); speed.replaceChildren(...SPEEDS.map((s) => { const o = node("option", `${s}×`); o.value = s; return o; }));
    speed.value = SPEEDS.find((s) => this.episode.steps.length / s <= 75) || 32; if (this.episode.live) speed.value = 1;
    this.legend(); this.ended(ending);
    if (this.episode.notes.length) this.note(this.episode.notes.join(" "));
  }
  legend() {
    const has = new Set(); for (const track of this.episode.tracks.values()) for (const [, sight] of track.sights) has.add(sight);
    byId("legend").replaceChildren(...Object.keys(SIGNS).filter((s) => has.has(s)).map((s) => { const li = node("li"), b = node("b", SIGNS[s][0]); b.style.color = SIGN_INKS[this.theme][s]; li.append(b, SIGNS[s][1]); return li; }));
    this.signs = has.size;
  }
  ended(ending) {
    const box = byId("ending"); box.replaceChildren();
    if (!ending) return;
    box.append(node("p", ending.line, ending.state === "won" ? "good" : ending.state === "lost" ? "bad" : "dim"));
    if (ending.why) { byId("why").textContent = ending.why; byId("why").hidden = false; }
  }
  note(text) { const p = node("p", text, "dim"); byId("pane-goal").append(p); }
  agents() {
    const pick = byId("agent");
    pick.replaceChildren(...this.episode.head.agents.map((a) => { const o = node("option", a.role && a.role !== a.id ? `${a.id} · ${a.role}` : a.id); o.value = a.id; return o; }));
    pick.value = this.agent;
  }
  // -- time
  get step() { return Math.max(0, Math.min(this.episode.last, Math.floor(this.at + 1e-6))); }
  go(n) { this.at = Math.max(0, Math.min(this.episode.last, n)); this.draw(); }
  play(on) {
    if (on && !this.episode.live && this.at >= this.episode.last) this.at = 0;
    this.playing = on; byId("play-icon").setAttribute("d", on ? "M3 2.5h4v11H3zM9 2.5h4v11H9z" : "M4 2.5l9 5.5-9 5.5z"); byId("play").setAttribute("aria-label", on ? "pause" : "play");
    if (on) { this.before = performance.now(); requestAnimationFrame((now) => this.tick(now)); } else this.draw();
  }
  tick(now) {
    if (!this.playing) return;
    const passed = Math.max(0, Math.min(0.25, (now - this.before) / 1000)), last = this.episode.last; this.before = now;
    const rate = Number(byId("speed").value), behind = last - this.at;
    this.at = Math.min(last, this.at + passed * (this.episode.live && behind > 1.5 ? Math.max(rate, behind) : rate));
    if (this.at >= last && !this.episode.live) { this.play(false); return; }
    if (this.drawnAt !== this.at) this.draw();
    requestAnimationFrame((next) => this.tick(next));
  }
  jump(way) {
    const steps = this.episode.steps, matters = (s) => (s.events || []).some((e) => e.kind !== "plain");
    for (let n = this.step + way; n >= 0 && n < steps.length; n += way) if (matters(steps[n])) return this.go(n);
    this.go(way > 0 ? this.episode.last : 0);
  }
  // -- drawing
  size() {
    const ratio = Math.min(2, window.devicePixelRatio || 1), stage = byId("stage"), wide = stage.clientWidth, high = stage.clientHeight;
    for (const id of ["city", "marks"]) { const c = byId(id); c.width = Math.round(wide * ratio); c.height = Math.round(high * ratio); }
    const line = byId("line"); line.width = Math.round(line.clientWidth * ratio); line.height = Math.round(line.clientHeight * ratio);
    this.ratio = ratio; this.camera.wide = wide; this.camera.high = Math.max(1, high); this.lined = null;
  }
  draw() {
    if (!this.episode.steps.length) return;
    this.drawnAt = this.at;
    const n = this.step, time = this.episode.time(this.at);
    if (this.following) {
      const own = this.episode.head.agents.find((a) => a.id === this.agent), place = own && own.controls.map((id) => this.episode.where(id, time)).find((p) => p && p.z < 20000);
      if (place) { this.camera.x = place.x; this.camera.y = place.y; this.camera.z = place.z / 2; }
    }
    this.camera.matrix();
    this.city.draw(this.camera);
    const picture = this.picture(n);
    this.marks.draw(this.at, this.agent, this.theme, picture && picture.view && this.episode.steps[n].tick - picture.tick < 3 ? picture : null);
    this.timeline(n);
    if (n !== this.shown) { this.shown = n; this.read(n); }
  }
  picture(n) {
    const list = this.episode.shots.get(this.agent), k = list ? this.episode.place(list, n) : -1;
    return k < 0 ? null : Object.assign({ tick: this.episode.steps[list[k][0]].tick, number: k, of: list.length, step: list[k][0] }, list[k][1]);
  }
  read(n) {
    const step = this.episode.steps[n], { head } = this.episode;
    byId("score-words").textContent = `score ${step.score.toFixed(2)}`; byId("score-bar").style.width = `${Math.max(0, Math.min(1, step.score)) * 100}%`;
    byId("score").title = `score ${step.score} · subtasks completed ${(step.scr * 100).toFixed(0)} %`;
    const seek = byId("seek"); seek.max = this.episode.last; seek.value = n; seek.setAttribute("aria-valuetext", `tick ${step.tick}`);
    byId("clock").textContent = `tick ${step.tick} of ${head.ticks} · ${clock(step.time)}`;
    if (this.signs !== undefined && (step.cards || []).length) this.legend();
    this.toast(n); this.agentPane(n);
    if (this.pane === "log") this.log(n); if (this.pane === "relations") this.relations(n); if (this.pane === "goal") this.goal(n);
  }
  toast(n) {
    const box = byId("toast"), back = Math.max(1, Math.round(Number(byId("speed").value) * 1.6));
    for (let k = n; k >= 0 && k > n - back; k--) {
      const told = (this.episode.steps[k].events || []).filter((e) => e.kind !== "plain");
      if (!told.length) continue;
      box.replaceChildren(node("span", told.slice(0, 2).map((e) => short(e.text, 110)).join(" · "), "told"));
      if (told.length > 2) box.append(node("span", `and ${told.length - 2} more`, "rest")); // a line of its own, which long texts cannot push out
      box.className = told.some((e) => e.kind === "bad") ? "bad" : "good"; return;
    }
    box.replaceChildren();
  }
  timeline(n) {
    const canvas = byId("line"), pen = canvas.getContext("2d"), steps = this.episode.steps, r = this.ratio, wide = canvas.width / r, high = canvas.height / r;
    if (!canvas.width || !canvas.height) return; // not laid out: nothing can be drawn from an empty canvas
    const pad = 8, x = (k) => pad + (wide - 2 * pad) * (this.episode.last ? k / this.episode.last : 0), style = getComputedStyle(document.documentElement);
    const key = [steps.length, canvas.width, canvas.height, this.theme, this.agent].join();
    if (this.lined !== key) { // what does not move is drawn once
      this.lined = key; const kept = this.kept = document.createElement("canvas"); kept.width = canvas.width; kept.height = canvas.height;
      const c = kept.getContext("2d"), ink = (name) => style.getPropertyValue(name); c.scale(r, r);
      const most = highest(steps, (s) => s.said || 0), bar = Math.max(1, (wide - 2 * pad) / Math.max(1, steps.length) - 0.5);
      c.fillStyle = ink("--rule"); steps.forEach((s, k) => { const h = (s.said || 0) / most * (high - 20); if (h) c.fillRect(x(k) - bar / 2, high - 4 - h, bar, h); });
      const top = highest(steps, (s) => s.score); c.beginPath(); c.moveTo(x(0), high - 4);
      steps.forEach((s, k) => { const y = high - 4 - Math.max(0, s.score) / top * (high - 20); if (k) c.lineTo(x(k), high - 4 - Math.max(0, steps[k - 1].score) / top * (high - 20)); c.lineTo(x(k), y); });
      c.lineTo(x(steps.length - 1), high - 4); c.closePath(); c.globalAlpha = 0.22; c.fillStyle = ink("--good"); c.fill(); c.globalAlpha = 1; c.strokeStyle = ink("--good"); c.lineWidth = 1.2; c.stroke();
      c.fillStyle = ink("--accent"); (this.episode.shots.get(this.agent) || []).forEach(([k]) => c.fillRect(x(k) - 1, high - 4, 2, 4));
      steps.forEach((s, k) => { for (const kind of ["good", "bad"]) if ((s.events || []).some((e) => e.kind === kind)) { c.beginPath(); c.arc(x(k), kind === "bad" ? 12 : 5, 3.2, 0, 7); c.fillStyle = ink(`--${kind}`); c.fill(); } });
    }
    pen.setTransform(1, 0, 0, 1, 0, 0); pen.clearRect(0, 0, canvas.width, canvas.height); pen.drawImage(this.kept, 0, 0); pen.scale(r, r);
    pen.fillStyle = style.getPropertyValue("--ink"); pen.fillRect(x(this.at) - 0.75, 0, 1.5, high);
  }
  // -- the panes
  show(name) {
    this.pane = name;
    for (const pane of PANES) { byId(`pane-${pane}`).hidden = pane !== name; const tab = byId(`tab-${pane}`); tab.setAttribute("aria-selected", pane === name); tab.tabIndex = pane === name ? 0 : -1; }
    this.shown = -1; this.draw();
  }
  choose(agent) { if (!agent) return; this.agent = agent; byId("agent").value = agent; this.shown = -1; this.draw(); }
  agentPane(n) {
    if (this.pane !== "agent") return;
    const { episode } = this, picture = this.picture(n), step = episode.steps[n];
    this.photo(picture);
    byId("photo-back").disabled = !picture; byId("photo-on").disabled = !(episode.shots.get(this.agent) || []).some(([k]) => k > n);
    const card = episode.head.agents.find((a) => a.id === this.agent), list = byId("facts-agent");
    if (!card) { list.replaceChildren(); return; }
    const detail = episode.detail(n), own = (detail && detail.agents && detail.agents[card.id]) || {}, parts = [];
    const put = (term, ...what) => { if (what.length) parts.push(node("dt", term), ...what); };
    const played = card.policy ? `${card.policy}${card.privileged ? " (sees the truth)" : ""}` : "–";
    if (own.replaced) put("answer replaced", node("dd", own.replaced, "bad"));
    if (own.thought || !detail) put("thought", node("dd", own.thought || "…", own.thought ? "thought" : "dim"));
    put("command", node("dd", own.command || "–", own.command ? "mono" : "dim"), ...(own.receipts || []).map(([text, bad]) => node("dd", text, bad ? "mono bad" : "mono dim")));
    const said = (detail && detail.messages) || [];
    put("says", ...said.filter((m) => m.sender === card.id).slice(0, 12).map((m) => message(m, m.recipients.length ? `→ ${m.recipients.length > 3 ? `${m.recipients.length} agents` : m.recipients.join(", ")}` : "→ nobody in reach")));
    put("is sent", ...said.filter((m) => m.recipients.includes(card.id)).slice(0, 12).map((m) => message(m, `${m.sender} →`)));
    for (const id of card.controls.slice(0, 6)) {
      const track = episode.tracks.get(id), state = track && episode.latest(track.status, n), place = episode.where(id, step.time);
      if (!track) continue;
      const words = [state ? state[0] : "", state && state[1] !== null && state[1] !== undefined ? `battery ${Math.round(state[1] * 100)} %` : "", place ? `at ${place.x.toFixed(0)}, ${place.y.toFixed(0)}, ${place.z.toFixed(0)} m` : ""];
      put(id, node("dd", words.filter(Boolean).join(" · ") || "–"));
    }
    put("played by", node("dd", played + (own.tokens ? ` · ${own.tokens} tokens` : "")));
    list.replaceChildren(...parts);
  }
  photo(picture) {
    const img = byId("photo"), none = byId("no-photo"), boxes = byId("boxes"), keys = byId("key-boxes");
    boxes.replaceChildren(); keys.replaceChildren();
    if (!picture) { img.hidden = true; img.removeAttribute("src"); this.wanted = null; none.textContent = "no picture yet"; byId("caption").textContent = ""; return; }
    byId("shot").style.aspectRatio = `${picture.width} / ${picture.height}`;
    byId("caption").textContent = `${picture.entity} · ${picture.camera} · tick ${picture.tick} · picture ${picture.number + 1} of ${picture.of}`;
    this.load(picture.id);
    boxes.setAttribute("viewBox", "0 0 1000 1000");
    const box = ([x0, y0, x1, y1], kind) => { const c = [x0, y0, x1, y1].map((v) => Math.max(0, Math.min(1, Number(v) || 0)) * 1000); const room = kind === "truth" ? 5 : 9; boxes.append(drawn("rect", { x: Math.min(c[0], c[2]) - room, y: Math.min(c[1], c[3]) - room, width: Math.abs(c[2] - c[0]) + 2 * room, height: Math.abs(c[3] - c[1]) + 2 * room, class: kind })); };
    const words = [];
    for (const [name, cls, where] of picture.truth || []) { box(where, "truth"); words.push(["truth-word", `true: ${cls} ${name}`]); }
    for (const [k, report] of this.episode.reports.get(picture.id) || []) {
      if (k > this.step) continue;
      box(report.box, "said");
      const found = this.episode.matched.get(report.id), sure = report.confidence === undefined || report.confidence === null ? "" : ` ${Math.round(report.confidence * 100)} %`;
      words.push(["said-word", `reported by ${report.sender}: ${report.cls}${sure}${found && found[0] <= this.step ? ` – is ${found[1]}` : ""}`]);
    }
    words.slice(0, 14).forEach(([name, text], k) => { if (k) keys.append(" · "); keys.append(node("b", text, name)); });
    if (words.length > 14) keys.append(` · and ${words.length - 14} more`);
  }
  load(id) {
    const img = byId("photo"), none = byId("no-photo");
    if (this.wanted === id) return;
    this.wanted = id;
    if (this.loading) return; // one at a time: the last that is wanted comes next
    const url = this.episode.source.picture(id);
    if (!url) { img.hidden = true; none.textContent = "this picture is not in the file, to keep it small"; return; }
    this.loading = id; img.alt = `picture ${id}`;
    const done = (ok) => {
      this.loading = null;
      if (this.wanted !== id && this.wanted) { const next = this.wanted; this.wanted = null; this.load(next); return; }
      img.hidden = !ok; none.textContent = ok ? "" : "this picture cannot be read: it is broken or lost";
    };
    img.onload = () => done(true); img.onerror = () => done(false); none.textContent = img.hidden ? "…" : ""; img.src = url;
  }
  log(n) {
    const rows = [], { episode } = this;
    for (let k = n; k >= 0 && rows.length < 160; k--) {
      const step = episode.steps[k], detail = step.said && n - k < 2 * episode.source.chunk ? episode.detail(k) : null, here = [];
      for (const e of step.events || []) here.push([e.text, e.kind === "plain" ? "" : e.kind]);
      for (const m of (detail && detail.messages) || []) here.push([`${m.sender} → ${m.recipients.length ? (m.recipients.length > 3 ? `${m.recipients.length} agents` : m.recipients.join(", ")) : "nobody in reach"}: ${m.kind} ${short(m.text, 240)}`, "dim"]);
      for (const [text, name] of here.slice(0, 40)) { const li = node("li"), when = node("button", String(step.tick), "when"); when.type = "button"; when.title = "go to this tick"; when.addEventListener("click", () => this.go(k)); li.append(when, node("span", text, name)); rows.push(li); }
    }
    byId("log").replaceChildren(...(rows.length ? rows : [node("li", "nothing has happened yet", "dim")]));
  }
  relations(n) {
    const { episode, graph } = this, agents = episode.head.agents, grouped = agents.length > 16;
    const group = (name) => (grouped ? name.replace(/\[\d+\]$/, "") : name);
    if (n < graph.counted) { graph.counted = -1; graph.counts.clear(); graph.fresh.clear(); }
    for (let k = graph.counted + 1; k <= n; k++) for (const [kind, source, target] of episode.steps[k].relations || []) { const key = `${kind}\n${group(source)}\n${group(target)}`; graph.counts.set(key, (graph.counts.get(key) || 0) + 1); graph.fresh.set(key, k); }
    graph.counted = n;
    const names = [...new Set([...agents.map((a) => group(a.id)), ...[...graph.counts.keys()].flatMap((key) => key.split("\n").slice(1))])].filter(Boolean).slice(0, 28);
    const svg = byId("graph"), wide = svg.clientWidth || 340, high = 300, place = new Map();
    svg.setAttribute("viewBox", `0 0 ${wide} ${high}`);
    names.forEach((name, i) => { const a = 2 * Math.PI * i / names.length - Math.PI / 2; place.set(name, [wide / 2 + (wide / 2 - 62) * Math.cos(a), high / 2 + (high / 2 - 30) * Math.sin(a)]); });
    const parts = [], seen = new Map();
    for (const [key, count] of graph.counts) {
      const [kind, source, target] = key.split("\n"), a = place.get(source), b = place.get(target);
      seen.set(kind, (seen.get(kind) || 0) + count);
      if (!a || !b) continue;
      const order = Object.keys(KINDS).indexOf(kind), dx = b[0] - a[0], dy = b[1] - a[1], bend = 0.1 + 0.05 * order, ink = KINDS[kind] || "#888";
      const d = source === target ? `M${a[0]},${a[1] - 8} c-26,-34 26,-34 0,0` : `M${a[0]},${a[1]} Q${(a[0] + b[0]) / 2 - dy * bend},${(a[1] + b[1]) / 2 + dx * bend} ${b[0]},${b[1]}`;
      parts.push(drawn("path", { d, fill: "none", stroke: ink, "stroke-width": Math.min(6, 1 + Math.log2(1 + count)), "stroke-opacity": n - graph.fresh.get(key) < 3 ? 1 : 0.35, "stroke-linecap": "round" }));
      if (source !== target) { const t = 0.62, u = 1 - t, mx = (a[0] + b[0]) / 2 - dy * bend, my = (a[1] + b[1]) / 2 + dx * bend, x = u * u * a[0] + 2 * u * t * mx + t * t * b[0], y = u * u * a[1] + 2 * u * t * my + t * t * b[1], turn = Math.atan2(2 * u * (my - a[1]) + 2 * t * (b[1] - my), 2 * u * (mx - a[0]) + 2 * t * (b[0] - mx)) * 180 / Math.PI; parts.push(drawn("path", { d: "M-5,-4 L5,0 L-5,4 Z", fill: ink, transform: `translate(${x},${y}) rotate(${turn})`, "fill-opacity": n - graph.fresh.get(key) < 3 ? 1 : 0.5 })); }
    }
    for (const [name, [x, y]] of place) {
      const agent = agents.find((a) => group(a.id) === name), id = agent && agent.controls[0], card = id && episode.cards.get(id);
      const dot = drawn("circle", { cx: x, cy: y, r: 8, fill: card ? this.marks.ink(card) : "#8a96a3" }), words = drawn("text", { x, y: y + (y < high / 2 ? -13 : 22) });
      words.textContent = short(name, 18); parts.push(dot, words);
      if (agent && !grouped) { dot.style.cursor = "pointer"; dot.addEventListener("click", () => { this.choose(agent.id); this.show("agent"); }); }
    }
    svg.replaceChildren(...parts);
    const declared = [...new Set([...episode.head.relations.map((r) => r.kind), ...seen.keys()])];
    byId("kinds").replaceChildren(...(declared.length ? declared : []).map((kind) => { const li = node("li"), i = node("i"); i.style.background = KINDS[kind] || "#888"; li.append(i, node("span", kind.replace(/_/g, " ")), node("span", String(seen.get(kind) || 0))); return li; }));
    if (!declared.length) byId("kinds").replaceChildren(node("li", "the mission declares no relations", "dim"));
  }
  goal(n) {
    const { episode } = this, stages = episode.latest(episode.states, n) || [];
    byId("stages").replaceChildren(...stages.map(([name, done, all]) => { const li = node("li"), meter = node("span", undefined, "meter"), i = node("i"); i.style.width = `${all ? done / all * 100 : 0}%`; meter.append(i); li.append(node("span", name), meter, node("span", `${done} of ${all}`)); return li; }));
    const rows = [];
    for (const card of episode.cards.values()) { const sight = card.role === "target" && episode.latest(episode.tracks.get(card.id).sights, n); if (!sight || rows.length > 60) continue; const li = node("li"), b = node("b", SIGNS[sight][0]); b.style.color = SIGN_INKS[this.theme][sight]; li.append(b, node("span", `${card.label || card.id} · ${card.type}`), node("span", sight === "truth" ? "hidden" : sight, "dim")); rows.push(li); }
    byId("targets").replaceChildren(...rows);
    byId("ending").hidden = n < episode.last;
  }
  // -- listening
  look(theme) { this.theme = document.documentElement.dataset.theme = theme; remembered("lingjing-theme", theme); this.city.load(this.city.ground, LOOKS[theme]); this.legend(); this.lined = null; this.shown = -1; this.draw(); }
  ground(ground) {
    this.city.load(ground, LOOKS[this.theme]); document.documentElement.dataset.ready = "yes";
    if (!this.episode.steps.length && !this.episode.live) return;
    byId("loading").textContent = ground.known ? "" : "the city is not here any more: only what moved is shown"; if (!ground.known) setTimeout(() => { byId("loading").textContent = ""; }, 5000); this.draw();
  }
  flat(on) { this.camera.flat = on; byId("flat").setAttribute("aria-pressed", on); byId("flat").textContent = on ? "3D" : "Plan"; byId("flat").title = on ? "3D (V)" : "plan (V)"; if (this.following) this.draw(); else this.fit(); }
  follow(on) { this.following = on; byId("follow").setAttribute("aria-pressed", on); if (!on) this.camera.z = 0; this.draw(); }
  fit() { this.follow(false); this.camera.fit(this.episode.head.frame, this.camera.wide, this.camera.high); this.draw(); }
  zoom(by) { this.camera.distance = Math.max(15, Math.min(60000, this.camera.distance * by)); this.draw(); }
  turn(dx, dy) { if (this.camera.flat) { this.pan(dx, dy); return; } this.camera.turn = (this.camera.turn + dx * 0.35) % 360; this.camera.tilt = Math.max(8, Math.min(89, this.camera.tilt + dy * 0.3)); this.draw(); }
  pan(dx, dy) { if (this.following) this.follow(false); this.camera.pan(dx, dy); this.draw(); }
  speed(way) { const list = byId("speed"), k = list.selectedIndex + way; if (k >= 0 && k < list.length) list.selectedIndex = k; }
  other(way) { const ids = this.episode.head.agents.map((a) => a.id), k = ids.indexOf(this.agent) + way; if (k >= 0 && k < ids.length) this.choose(ids[k]); }
  listen() {
    const on = (id, act) => byId(id).addEventListener("click", (event) => { act(); if (event.detail > 0) event.currentTarget.blur(); });
    on("play", () => this.play(!this.playing)); on("less", () => this.go(this.step - 1)); on("more", () => this.go(this.step + 1)); on("back", () => this.jump(-1)); on("next", () => this.jump(1));
    on("flat", () => this.flat(!this.camera.flat)); on("follow", () => this.follow(!this.following)); on("fit", () => this.fit());
    on("theme", () => this.look(this.theme === "dark" ? "light" : "dark")); on("help", () => byId("keyboard").showModal());
    on("photo-back", () => { const p = this.picture(this.step), list = this.episode.shots.get(this.agent); if (p) this.go(p.step < this.step ? p.step : p.number ? list[p.number - 1][0] : 0); });
    on("photo-on", () => { const next = (this.episode.shots.get(this.agent) || []).find(([k]) => k > this.step); if (next) this.go(next[0]); });
    for (const pane of PANES) byId(`tab-${pane}`).addEventListener("click", () => this.show(pane));
    byId("tabs").addEventListener("keydown", (event) => { const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key]; if (way) { const next = PANES[(PANES.indexOf(this.pane) + way + PANES.length) % PANES.length]; this.show(next); byId(`tab-${next}`).focus(); event.preventDefault(); event.stopPropagation(); } });
    byId("agent").addEventListener("change", (event) => this.choose(event.target.value));
    byId("seek").addEventListener("input", (event) => { if (this.playing) this.play(false); this.go(Number(event.target.value)); });
    byId("line").addEventListener("pointerdown", (event) => { const to = (e) => { const box = byId("line").getBoundingClientRect(); this.go(Math.round((e.clientX - box.left - 8) / Math.max(1, box.width - 16) * this.episode.last)); }; to(event); const move = (e) => to(e), up = () => { removeEventListener("pointermove", move); removeEventListener("pointerup", up); }; addEventListener("pointermove", move); addEventListener("pointerup", up); });
    addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => { this.size(); this.draw(); }).observe(byId("stage"));
    this.pointers();
  }
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("keyboard").open) return;
    const tag = event.target.tagName, key = event.key;
    if (tag === "SELECT" || (tag === "BUTTON" && (key === " " || key === "Enter"))) return;
    if (tag === "INPUT" && !event.shiftKey && ["Home", "End", "ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"].includes(key)) return;
    const inPane = event.target.getAttribute && event.target.getAttribute("role") === "tabpanel";
    if (inPane && ["ArrowUp", "ArrowDown", "Home", "End"].includes(key)) return; // it scrolls
    const keys = {
      " ": () => this.play(!this.playing), ArrowLeft: () => (event.shiftKey ? this.jump(-1) : this.go(this.step - 1)), ArrowRight: () => (event.shiftKey ? this.jump(1) : this.go(this.step + 1)),
      Home: () => this.go(0), End: () => this.go(this.episode.last), ArrowUp: () => this.other(-1), ArrowDown: () => this.other(1), ",": () => this.speed(-1), ".": () => this.speed(1),
      v: () => this.flat(!this.camera.flat), f: () => this.follow(!this.following), 0: () => this.fit(), t: () => this.look(this.theme === "dark" ? "light" : "dark"), "?": () => byId("keyboard").showModal(),
      "+": () => this.zoom(0.85), "=": () => this.zoom(0.85), "-": () => this.zoom(1.18), a: () => this.turn(-20, 0), d: () => this.turn(20, 0), w: () => this.turn(0, 12), s: () => this.turn(0, -12),
      i: () => this.pan(0, 40), k: () => this.pan(0, -40), j: () => this.pan(40, 0), l: () => this.pan(-40, 0), 1: () => this.show("agent"), 2: () => this.show("log"), 3: () => this.show("relations"), 4: () => this.show("goal"),
    };
    const act = keys[key.length === 1 ? key.toLowerCase() : key];
    if (act) { act(); event.preventDefault(); }
  }
  pointers() {
    const canvas = byId("marks"), down = new Map(); let moved = 0, spread = 0;
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); down.set(e.pointerId, [e.clientX, e.clientY]); moved = 0; spread = 0; });
    canvas.addEventListener("pointermove", (e) => {
      const before = down.get(e.pointerId);
      if (!before) return;
      const dx = e.clientX - before[0], dy = e.clientY - before[1]; down.set(e.pointerId, [e.clientX, e.clientY]); moved += Math.abs(dx) + Math.abs(dy);
      if (down.size === 2) { const [p, q] = [...down.values()], now = Math.hypot(p[0] - q[0], p[1] - q[1]); if (spread) this.zoom(spread / Math.max(1, now)); spread = now; this.pan(dx / 2, dy / 2); }
      else if (e.shiftKey || e.buttons === 2 || e.buttons === 4 || this.camera.flat) this.pan(dx, dy); else this.turn(dx, dy);
    });
    const end = (e) => { if (down.delete(e.pointerId) && moved < 6 && e.type === "pointerup") { const box = canvas.getBoundingClientRect(), agent = this.marks.hit(e.clientX - box.left, e.clientY - box.top); if (agent) { this.choose(agent); this.show("agent"); } } spread = 0; };
    canvas.addEventListener("pointerup", end); canvas.addEventListener("pointercancel", end); canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoom(Math.exp(Math.max(-60, Math.min(60, e.deltaY)) * 0.0035)); }, { passive: false });
  }
  follows() { // live
    const { episode } = this;
    this.stream = episode.source.follow(episode.steps.length, (news) => {
      const edge = this.at >= episode.last - 0.01 || this.playing;
      episode.add(news.steps, news.details);
      if (edge && !this.playing) this.play(true); else { this.shown = -1; this.draw(); }
    }, (ending) => { episode.live = false; byId("live").hidden = true; episode.ending = ending; this.ended(ending); this.shown = -1; this.draw(); });
    if (episode.steps.length) this.play(true);
  }
}

function message(m, who) { const dd = node("dd"); dd.append(node("span", `${who} `, "dim"), node("b", m.kind), ` ${m.text || ""}`); return dd; }
function highest(steps, of) { return steps.reduce((top, step) => Math.max(top, of(step)), 1); } // at least 1; spreading into Math.max ends at about 100,000 steps
function short(text, most) { return text.length > most ? `${text.slice(0, most - 1)}…` : text; }
function clock(s) { const m = Math.floor(s / 60); return m >= 60 ? `${Math.floor(m / 60)} h ${String(m % 60).padStart(2, "0")} min` : m ? `${m} min ${String(Math.floor(s % 60)).padStart(2, "0")} s` : `${s.toFixed(0)} s`; }

async function main() {
  document.documentElement.dataset.theme = remembered("lingjing-theme") || (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
  const spec = JSON.parse(byId("d-source").textContent), source = spec.kind === "file" ? new FileSource(spec) : new ServerSource(spec);
  if (spec.calls) { byId("calls").hidden = false; byId("calls").addEventListener("click", () => window.open(source.url("calls"), "_blank")); }
  source.chunk = spec.chunk;
  try {
    let told = await source.pageStart();
    while (told.waiting) { byId("loading").textContent = "the episode is starting …"; await new Promise((wake) => setTimeout(wake, 400)); told = await source.pageStart(); }
    const episode = new Episode(source, told);
    if (!episode.steps.length && !told.live) { byId("loading").textContent = "this trace holds no boundary: nothing was played"; byId("city").hidden = true; } // a canvas that nobody draws is black
    const player = window.player = new Player(episode);
    if (told.live) player.follows();
    if (told.live || episode.steps.length) byId("loading").textContent = "building the city …";
    source.ground().then((ground) => player.ground(ground), (error) => { byId("loading").textContent = `no city: ${error.message}`; });
  } catch (error) { byId("loading").textContent = `cannot show the episode: ${error.message}`; }
}
main();
