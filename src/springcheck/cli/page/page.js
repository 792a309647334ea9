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
    return ["wrong", `${label} differs first in frame ${first.i}, t = ${number(t[first.i], 6)}: here q = ${first.q}, `
      + `p = ${first.p}; in the file q = ${q[first.i]}, p = ${p[first.i]}`];
  }
  const told = run.failed ? ", as its verdicts say" : "", kind = told ? "told" : "wrong";
  const much = share < 1e3 ? `${number(share, 2)} times` : "more than a thousand times";
  return share <= 1 ? ["near"] : [kind, `${label} is not ${run.title}: in frame ${frame}, `
    + `t = ${number(t[frame], 6)}, its difference is ${much} what rounding allows${told}`];
}

function selfCheck() {
  const place = by("selfcheck"), said = { wrong: [], equal: [], near: [], not: [], told: [] };
  if (!place || !DATA.linear) return;
  const { runs } = DATA, lines = [], failed = [], frames = new Set();
  for (const run of runs) {
    const [kind, text] = compared(run);
    said[kind].push(run.label);
    if (kind === "equal") frames.add(run.t.length);
    if (text) (kind === "told" ? failed : lines).push(text);
  }
  const { equal, near, wrong } = said;
  const put = (words, labels) => labels.length && lines.push(`${words}: ${labels.join(", ")}`);
  put(`q and p equal bit for bit (${[...frames].join(", ")} frames)`, equal);
  put("the scheme's solution to rounding, or the exact solution to tolerance", near);
  put("not computed again here", said.not);
  const [result, look, head] = wrong.length ? ["differs", "bad", "Your browser and this file differ:"]
    : !equal.length && !near.length ? ["none", "", "None of these methods is computed again here."]
      : ["equal", "good", `Your browser = this file: ${equal.length} of ${runs.length} methods to the last `
        + `bit, ${near.length} to rounding or tolerance.`];
  place.dataset.result = result;
  const list = html("ul", {}, ...lines.map((text) => html("li", {}, text)));
  place.replaceChildren(html("p", { class: look }, head), list);
  place.after(...failed.map((text) => html("p", { class: "bad" }, text)));
}

// Sliders and number fields for the scene's numbers; what is changed stands in the address.
function live() {
  if (!DATA.spring) return;
  const own = { ...DATA.spring, c: 0 }, now = { ...own }, asked = new URLSearchParams(location.hash.slice(1));
  const places = DATA.sliders, names = Object.keys(places);
  const [slide, field] = ["slide", "show"].map((kind) => (name) => by(`${kind}-${name}`));
  const right = (name, v) => Number.isFinite(v) && (({ h: v !== 0, m: v > 0, c: v >= 0 })[name] ?? true);
  by("live").hidden = false;
  const bank = new Bank(by("orbits"), { ...DATA.live, charts: [orbits(now)] });
  const put = (name, value) => {
    if (right(name, value)) now[name] = value;
    const away = places[name].map((x) => Math.abs(x - now[name]));
    slide(name).value = away.indexOf(Math.min(...away));
  };
  const show = () => {
    for (const name of names) field(name).value = number(now[name], 6);
    bank.charts[0].show(orbits(now));
    said(now);
    const changed = names.filter((name) => now[name] !== own[name]).map((name) => [name, now[name]]);
    if (changed.length || asked.size) history.replaceState(null, "", `#${new URLSearchParams(changed)}`);
  };
  for (const name of names) {
    put(name, asked.has(name) ? Number(asked.get(name)) : now[name]);
    made(field(name), { change: (event) => show(put(name, event.target.valueAsNumber)) });
    made(slide(name), { input: (event) => show((now[name] = places[name][event.target.value])) });
  }
  made(by("reset"), { click: () => show(names.forEach((name) => put(name, own[name]))) });
  show();
}

// The orbits by these numbers.
function orbits(s) {
  const [chart] = DATA.live.charts, steps = Math.min(DATA.steps, 1000), far = [];
  const energy = (s.p * s.p) / (2 * s.m) + (s.k * (s.q - s.at) ** 2) / 2, bound = s.k > 0 && energy > 0;
  const [a, b] = bound ? [Math.sqrt((2 * energy) / s.k), Math.sqrt(2 * energy * s.m)] : [1, 1];
  const whole = Math.min(steps * Math.abs(s.h), 40 / Math.sqrt(s.k / s.m || 1));
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
  const curves = chart.curves.map(motion), title = `${chart.title}, ${steps} steps.`;
  return {
    ...chart, title: far.length ? `${title} Beyond the picture: ${far.join(", ")}.` : title, curves,
    x: range(chart.x, s.at, a), y: range(chart.y, 0, b), equal: DATA.equal && a < 3 * b && b < 3 * a,
  };
}

function said(s) {
  const size = Math.abs(s.h) * Math.sqrt(s.k / s.m), turn = `h \u03c9 = ${number(size)}`;
  const free = size < 2 ? "explicit Euler spirals out, the two others stay"
    : size > 2 ? "beyond 2, all three explode" : "the limit itself";
  by("live-said").textContent = !(s.k > 0) ? "No restoring force: nothing brings the mass back."
    : s.c ? `${turn}, damping ratio ${number(s.c / (2 * Math.sqrt(s.k * s.m)))}` : `${turn}: ${free}`;
}

selfCheck();
live();
for (const [name, bank] of Object.entries(DATA.banks)) new Bank(by(name), bank);
