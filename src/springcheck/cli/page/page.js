// The stored motion, the loops of loops.js at once and by sliders, and charts of studies.

// rows of numbers stand once: [rows, data]; {"#": i} for the i-th of them, {"$": i} where it is text;
// infinities and NaN are words in JSON
const TEXT = by("data").textContent, [ROWS] = JSON.parse(TEXT);
const [, DATA] = JSON.parse(TEXT, (_, x) => {
  if (x === null || typeof x !== "object") return x;
  return "$" in x ? ROWS[x.$] : "#" in x ? ROWS[x["#"]].map(Number) : x;
});

// A run by its scheme's loop here: equal, near, not computed; what differs.
function compared(run) {
  const law = DATA.laws[run.scheme], { label, t, q, p } = run;
  if (!law) return ["not"];
  const { share, frame, first } = departure(run, run.loop ? DATA.spring : DATA.linear, law);
  if (run.loop && !first) return ["equal"];
  if (run.loop) {
    return ["wrong", `${label} differs first in frame ${first.i}, t = ${t[first.i]}: here q = ${first.q}, `
      + `p = ${first.p}; in the file q = ${q[first.i]}, p = ${p[first.i]}`];
  }
  const told = run.failed ? ", as its verdicts say" : "", kind = told ? "told" : "wrong";
  const much = share < 1e3 ? `${number(share, 2)} times` : "more than a thousand times";
  return share <= 1 ? ["near"] : [kind, `${label} is not ${run.title}: in frame ${frame}, `
    + `t = ${t[frame]}, its difference is ${much} what rounding allows${told}`];
}

function selfCheck() {
  const place = by("selfcheck"), said = { wrong: [], equal: [], near: [], not: [], told: [] };
  if (!place) return;
  const lines = [changed()], failed = [], { runs } = DATA, frames = new Set();
  const put = (words, labels) => labels.length && lines.push(`${words}: ${labels.join(", ")}`);
  for (const run of DATA.linear ? runs : []) {
    const [kind, text] = compared(run);
    said[kind].push(run.label);
    if (kind === "equal") frames.add(run.t.length);
    (kind === "told" ? failed : lines).push(text);
  }
  put(`q and p the same doubles (${[...frames].join(", ")} frames)`, said.equal);
  put("the scheme's motion to rounding, or the exact one to tolerance", said.near);
  put("not computed again here", said.not);
  const { equal, near, wrong } = said, list = lines.filter(Boolean).map((text) => html("li", {}, text));
  const bad = ["differs", "bad", "Your browser and this file differ:"];
  const [result, look, head] = lines[0] || wrong.length ? bad
    : !DATA.linear ? ["none", "", place.textContent]
    : !equal.length && !near.length ? ["none", "", "None of these methods is computed again here."]
      : ["equal", "good", `Your browser = this file: ${equal.length} of ${runs.length} methods to the last `
        + `bit, ${near.length} to rounding or tolerance.`];
  place.dataset.result = result;
  place.replaceChildren(html("p", { class: look }, head), html("ul", {}, ...list));
  place.after(...failed.map((text) => html("p", { class: "bad" }, text)));
}

// A count or verdict that is not as it was written; "" where none is.
function changed() {
  const cells = "#counts, .method summary b + span, .method tbody :is(th, td:not(.why))", { words } = DATA;
  const texts = [...document.querySelectorAll(cells), html("p", {})].map((cell) => cell.textContent.trim());
  const i = texts.findIndex((text, j) => text !== (words[j] || ""));
  return i < 0 ? "" : `a verdict or a count reads "${texts[i]}", and was "${words[i]}"`;
}

function live() {
  if (!DATA.spring) return;
  const own = { ...DATA.spring, c: 0 }, now = { ...own }, asked = new URLSearchParams(location.hash.slice(1));
  const names = Object.keys(DATA.sliders);
  by("live").hidden = false;
  const bank = new Bank(by("orbits"), { ...DATA.live, charts: tried(now) });
  const show = () => {
    tried(now).forEach((chart, i) => bank.charts[i].show(chart));
    said(now);
    const changed = names.filter((name) => now[name] !== own[name]).map((name) => [name, now[name]]);
    if (changed.length || asked.size) history.replaceState(null, "", `#${new URLSearchParams(changed)}`);
  };
  const right = (name, v) => ({ h: v !== 0, m: v > 0, c: v >= 0 })[name] ?? true;
  const [put, tell] = sliding("", DATA.sliders, now, right, show);
  for (const name of names.filter((one) => asked.has(one))) put(name, Number(asked.get(name)));
  made(by("reset"), { click: () => tell(names.forEach((name) => put(name, own[name]))) });
  tell();
}

const dampingOf = (s) => (s.k > 0 ? (Math.sign(s.h) * s.c) / (2 * Math.sqrt(s.k * s.m)) : 0);

// The orbits by these numbers, and the growth a step at any h omega.
function tried(s) {
  const [orbits, factors] = DATA.live.charts, steps = Math.min(DATA.steps, 1000), far = [];
  const energy = (s.p * s.p) / (2 * s.m) + (s.k * (s.q - s.at) ** 2) / 2, bound = s.k > 0 && energy > 0;
  const [a, b] = bound ? [Math.sqrt((2 * energy) / s.k), Math.sqrt(2 * energy * s.m)] : [1, 1];
  const omega = Math.sqrt(s.k / s.m || 1), whole = Math.min(steps * Math.abs(s.h), 40 / omega);
  const motion = (curve) => {
    const step = curve.group === "exact" ? null : stepper(DATA.laws[curve.group], s);
    const times = Array.from({ length: bound ? 1001 : 0 }, (_, i) => (i / 1000) * whole);
    const path = step ? [[s.q, s.p]] : exactMotion(s, times);
    for (let i = 0; step && i < steps; i++) path.push(step(...path[i]));
    const notes = path.map((_, i) => (step ? `step ${i}` : `t ${times[i]}`)), [q, p] = path.at(-1) || [];
    if (step && !(Math.abs(q - s.at) <= 4 * a && Math.abs(p) <= 4 * b)) far.push(curve.name);
    return { ...curve, x: path.map((state) => state[0]), y: path.map((state) => state[1]), notes };
  };
  const range = (scale, at, size) => ({ ...scale, shown: [at - 4 * size, at + 4 * size] });
  const factor = ({ group, x }) => x.map((w) => radius(DATA.laws[group], w, dampingOf(s)));
  const here = s.k > 0 ? [{ axis: "x", at: Math.abs(s.h) * omega, name: "here", look: "here" }] : [];
  const curves = orbits.curves.map(motion), title = `${orbits.title}, ${steps} steps.`;
  return [{
    ...orbits, title: far.length ? `${title} Beyond the picture: ${far.join(", ")}.` : title, curves,
    x: range(orbits.x, s.at, a), y: range(orbits.y, 0, b), equal: DATA.equal && a < 3 * b && b < 3 * a,
  }, {
    ...factors, rules: [...factors.rules, ...here],
    curves: factors.curves.map((curve) => ({ ...curve, y: factor(curve) })),
  }];
}

function said(s) {
  const size = Math.abs(s.h) * Math.sqrt(s.k / s.m), zeta = dampingOf(s), turn = `h \u03c9 = ${number(size)}`;
  const each = DATA.live.charts[1].curves.map(({ name, group }) => {
    const factor = radius(DATA.laws[group], size, zeta);
    return `${name} ${factor > 1 ? "explodes" : "decays"} by a factor ${number(factor, 4)} a step`;
  });
  const free = size < 2 ? "explicit Euler spirals out, the two others stay"
    : size > 2 ? "beyond 2, all three explode" : "the limit itself";
  by("live-said").textContent = !(s.k > 0) ? "No restoring force: nothing brings the mass back."
    : s.c ? `${turn}, damping ratio ${number(Math.abs(zeta))}: ${each.join(", ")}` : `${turn}: ${free}`;
}

selfCheck();
live();
for (const [name, bank] of Object.entries(DATA.banks)) new Bank(by(name), bank);

// a link to a fold opens it
addEventListener("hashchange", () => {
  const there = by(location.hash.slice(1));
  if (there && there.tagName === "DETAILS") there.open = true;
});
