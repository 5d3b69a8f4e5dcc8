// The page of model calls: a list that can be searched, and one call in full.

const b64 = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const byId = (id) => document.getElementById(id);
const whole = new Intl.NumberFormat("en");
const KINDS = { all: "all calls", odd: "failed or replaced", pictures: "with pictures", messages: "with messages sent" };

function node(tag, text, name) { const made = document.createElement(tag); if (text !== undefined) made.textContent = text; if (name) made.className = name; return made; }
function remembered(key, value) { try { if (value === undefined) return localStorage.getItem(key); localStorage.setItem(key, value); } catch { /* a file without storage */ } return null; }
function usd(value) { return value === null || value === undefined ? "–" : "$" + value.toFixed(value < 0.1 ? 4 : 2); }
function pretty(text) { try { return JSON.stringify(JSON.parse(text), null, 2); } catch { return text; } }

async function inflated(text) {
  const stream = new Blob([b64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

class Calls {
  constructor(content) {
    this.content = content; this.shown = []; this.at = -1; this.words = "";
    document.title = `${content.title} · model calls`; byId("title").textContent = content.title; byId("facts").textContent = [content.facts, ...content.notes].join(" · ");
    const last = content.calls[content.calls.length - 1];
    byId("sums").textContent = last ? `${whole.format(last.spent_tokens)} tokens${content.priced ? ", " + usd(last.spent_usd) : ", no price known"}` : "";
    this.choices("agent", [["", "all agents"], ...[...new Set(content.calls.map((c) => c.agent))].sort().map((a) => [a, a])]);
    this.choices("kind", Object.entries(KINDS)); this.listen(); this.search();
  }
  choices(id, pairs) { byId(id).replaceChildren(...pairs.map(([value, words]) => { const o = node("option", words); o.value = value; return o; })); }
  listen() {
    let wait = 0;
    byId("words").addEventListener("input", () => { clearTimeout(wait); wait = setTimeout(() => this.search(), 120); });
    for (const id of ["agent", "kind"]) byId(id).addEventListener("change", () => this.search());
    byId("theme").addEventListener("click", () => this.theme());
    document.addEventListener("keydown", (event) => {
      const typing = ["INPUT", "SELECT"].includes(document.activeElement.tagName);
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "Escape" && typing) { document.activeElement.blur(); return; }
      if (typing && !(document.activeElement.id === "words" && ["ArrowUp", "ArrowDown", "Enter"].includes(event.key))) return;
      const keys = { "/": () => byId("words").focus(), ArrowDown: () => this.go(this.at + 1), ArrowUp: () => this.go(this.at - 1), Home: () => this.go(0), End: () => this.go(this.shown.length - 1), t: () => this.theme() };
      if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
    });
  }
  theme() { const now = document.documentElement.dataset.theme === "dark" ? "light" : "dark"; document.documentElement.dataset.theme = now; remembered("lingjing-theme", now); }
  texts(call) {
    const result = call.result || {}, decision = call.decision || {};
    return [...call.messages.map((m) => this.content.texts[m.text]), result.text || "", result.reasoning || "", result.failure || "", decision.detail || "", call.agent, `tick ${call.tick}`];
  }
  fits(call) {
    const agent = byId("agent").value, kind = byId("kind").value, result = call.result, decision = call.decision || {};
    if (agent && call.agent !== agent) return false;
    if (kind === "odd" && result && !result.failure && !decision.substituted) return false;
    if (kind === "pictures" && !call.messages.some((m) => m.pictures.length)) return false;
    if (kind === "messages" && !(decision.messages || []).length) return false;
    return this.words === "" || this.texts(call).join("\n").toLowerCase().includes(this.words);
  }
  search() {
    this.words = byId("words").value.trim().toLowerCase();
    const before = this.shown[this.at];
    this.shown = this.content.calls.filter((call) => this.fits(call));
    byId("found").textContent = `${whole.format(this.shown.length)} of ${whole.format(this.content.calls.length)} calls`;
    byId("list").replaceChildren(...this.shown.map((call, n) => this.line(call, n)));
    this.at = -1;
    if (this.shown.length) this.go(Math.max(0, this.shown.indexOf(before))); else byId("call").replaceChildren(node("p", "No call fits.", "dim"));
  }
  line(call, n) {
    const li = node("li"), result = call.result || {}, decision = call.decision || {}, pictures = call.messages.reduce((sum, m) => sum + m.pictures.length, 0);
    const head = node("p"); head.append(node("b", `${call.tick}`), ` ${call.agent}`, node("span", call.number ? ` call ${call.number + 1}` : "", "dim"));
    const odd = !call.result ? "no result" : result.failure ? result.fault || "failed" : decision.substituted;
    if (odd) head.append(node("em", odd, "bad"));
    const facts = [`${whole.format((result.prompt_tokens || 0) + (result.completion_tokens || 0))} tokens`];
    if (this.content.priced) facts.push(usd(result.cost_usd)); if (pictures) facts.push(`${pictures} picture${pictures > 1 ? "s" : ""}`);
    li.append(head, node("p", facts.join(" · "), "dim"), node("p", this.gist(call), "gist")); li.addEventListener("click", () => this.go(n)); return li;
  }
  gist(call) { const result = call.result || {}; if (result.failure) return result.failure; try { const step = JSON.parse(result.text); return step.thought || result.text; } catch { return result.text || ""; } }
  go(n) {
    if (n < 0 || n >= this.shown.length || n === this.at) return;
    const list = byId("list"); if (list.children[this.at]) list.children[this.at].removeAttribute("aria-current");
    this.at = n; list.children[n].setAttribute("aria-current", "true"); list.children[n].scrollIntoView({ block: "nearest" }); this.draw(this.shown[n]);
  }
  draw(call) {
    const result = call.result || {}, decision = call.decision, box = byId("call"), parts = [];
    const head = node("h2", `tick ${call.tick} · ${call.agent}${call.number ? ` · call ${call.number + 1}` : ""}`); parts.push(head);
    const facts = [["tokens in", whole.format(result.prompt_tokens || 0)], ["cached", whole.format(result.cached_tokens || 0)], ["tokens out", whole.format(result.completion_tokens || 0)], ["cost", usd(result.cost_usd)],
      ["so far", `${whole.format(call.spent_tokens)} tokens${this.content.priced ? ", " + usd(call.spent_usd) : ""}`], ["seconds", (result.wall_s || 0).toFixed(1)], ["attempts", `${result.attempts === undefined ? 1 : result.attempts}`], ["ended", result.finish_reason || "–"]];
    if (result.served) facts.push(["served by", result.served]);
    const dl = node("dl"); for (const [name, value] of facts) { const one = node("div"); one.append(node("dt", name), node("dd", value)); dl.append(one); } parts.push(dl);
    parts.push(this.checks(call));
    if (result.failure) parts.push(this.block("failure", result.failure, true, "bad")); else parts.push(this.block("answer", pretty(result.text || ""), true));
    if (result.reasoning) parts.push(this.block("reasoning", result.reasoning, false));
    if (decision && (decision.command || (decision.messages || []).length)) parts.push(this.block("decision", [decision.command ? pretty(decision.command) : "no command", ...(decision.messages || []).map(pretty)].join("\n"), true));
    const last = call.messages.length - 1;
    for (let at = last; at >= 0; at--) parts.push(this.message(call.messages[at], at, at === last));
    parts.push(this.block("parameters", this.content.texts[call.parameters], false));
    box.replaceChildren(...parts); box.scrollTop = 0;
  }
  checks(call) {
    const list = node("ul", undefined, "checks"), result = call.result, decision = call.decision;
    const add = (good, words) => list.append(node("li", (good ? "✓ " : "✗ ") + words, good ? "good" : "bad"));
    add(Boolean(result && !result.failure), !result ? "no result was recorded" : result.failure ? "no answer" : "an answer came");
    if (result && !result.failure) { let object = false; try { object = typeof JSON.parse(result.text) === "object"; } catch { /* no JSON alone */ } add(object, object ? "the answer is JSON" : "the answer is not JSON alone"); if (result.finish_reason === "length") add(false, "the answer was cut off"); }
    if (decision) add(!decision.substituted, decision.substituted ? `replaced by a no-op (${decision.substituted}): ${decision.detail || ""}` : "the decision was used");
    return list;
  }
  message(message, at, open) {
    const made = this.block(at === 0 && message.role === "system" ? "system" : `${message.role}${open ? ", the question" : ", earlier turn"}`, pretty(this.content.texts[message.text]), open || this.has(this.content.texts[message.text]));
    for (const number of message.pictures) {
      const stored = byId("d-picture-" + number);
      if (stored) { const img = node("img"); img.src = "data:image/jpeg;base64," + stored.textContent; img.alt = `picture ${number}`; img.loading = "lazy"; made.append(img); } else made.append(node("p", "This picture is not in this file.", "dim"));
    }
    return made;
  }
  has(text) { return this.words !== "" && text.toLowerCase().includes(this.words); }
  block(title, text, open, name) {
    const made = node("details", undefined, name || ""); made.open = open; made.append(node("summary", `${title} (${whole.format(text.length)} characters)`));
    const pre = node("pre"); this.marked(pre, text); made.append(pre); return made;
  }
  marked(pre, text) {
    const word = this.words, low = text.toLowerCase(); let from = 0, left = 500;
    if (word) for (let at = low.indexOf(word); at >= 0 && left > 0; at = low.indexOf(word, from), left--) { pre.append(text.slice(from, at), node("mark", text.slice(at, at + word.length))); from = at + word.length; }
    pre.append(text.slice(from));
  }
}

document.documentElement.dataset.theme = remembered("lingjing-theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
inflated(byId("d-calls").textContent).then((content) => { new Calls(content); document.documentElement.dataset.ready = "yes"; });
