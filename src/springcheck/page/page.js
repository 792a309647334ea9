"use strict";
// Draws the stored numbers, and runs the loops of loops.js on opening and by the sliders.

const DATA = JSON.parse(document.getElementById("data").textContent);
for (const run of DATA.runs) {
  for (const name of ["t", "q", "p", "energy"]) {
    // infinities and not-a-numbers are words in JSON
    if (run[name]) run[name] = run[name].map(Number);
  }
}
const SVG = "http://www.w3.org/2000/svg";
// Okabe & Ito (2008), told apart by people with any colour vision; lightened where they vanish on black
const DARK = matchMedia("(prefers-color-scheme: dark)");
const COLOURS = DARK.matches
  ? ["#56B4E9", "#E69F00", "#2FC79A", "#E79FC8", "#F0E442", "#FF7A33", "#c8c8c8"]
  : ["#0072B2", "#D55E00", "#00805C", "#B0508C", "#8A6100", "#2A7FB0", "#000000"];
const DASHES = ["", "7 4", "2 3", "9 3 2 3", "14 4", "4 2"];
const TICKS = 4;

function element(name, attributes, ...children) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function html(name, text) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  return made;
}

function number(x) {
  return String(Number(x.toPrecision(3)));
}

// Round numbers within [low, high].
function ticks(low, high) {
  const rough = (high - low) / TICKS, power = 10 ** Math.floor(Math.log10(rough));
  const size = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough) || 10 * power;
  const found = [];
  for (let i = Math.ceil(low / size); i * size <= high && found.length < 50; i++) found.push(i * size);
  return found;
}

function extent(values, symmetric) {
  let low = Infinity, high = -Infinity;
  for (const x of values) {
    if (Number.isFinite(x)) {
      low = Math.min(low, x);
      high = Math.max(high, x);
    }
  }
  if (!(low <= high)) [low, high] = [-1, 1];
  if (symmetric) [low, high] = [-Math.max(-low, high), Math.max(-low, high)];
  const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
  return [low - room, high + room];
}

let clips = 0;

// Curves {x, y, colour, dash, name} in a box; xs and ys are the ranges shown.
function plot(place, curves, xs, ys, xName, yName, said) {
  const W = 440, H = 360, L = 62, R = 10, T = 12, B = 44;
  const x = (v) => L + ((v - xs[0]) / (xs[1] - xs[0])) * (W - L - R);
  const y = (v) => H - B - ((v - ys[0]) / (ys[1] - ys[0])) * (H - T - B);
  const root = element("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": said });
  for (const v of ticks(...xs)) {
    root.append(element("line", { class: "grid", x1: x(v), x2: x(v), y1: T, y2: H - B }));
    root.append(element("text", { x: x(v), y: H - B + 17, "text-anchor": "middle" }, number(v)));
  }
  for (const v of ticks(...ys)) {
    root.append(element("line", { class: "grid", x1: L, x2: W - R, y1: y(v), y2: y(v) }));
    root.append(element("text", { x: L - 6, y: y(v) + 4, "text-anchor": "end" }, number(v)));
  }
  const clip = `clip${clips++}`, box = { x: L, y: T, width: W - L - R, height: H - T - B };
  root.append(element("clipPath", { id: clip }, element("rect", box)), element("rect", { class: "frame", ...box }));
  root.append(element("text", { x: (L + W - R) / 2, y: H - 8, "text-anchor": "middle" }, xName));
  const side = { transform: `translate(14 ${(T + H - B) / 2}) rotate(-90)`, "text-anchor": "middle" };
  root.append(element("text", side, yName));
  const inside = element("g", { "clip-path": `url(#${clip})` });
  // beyond this an SVG's numbers are none; the clip hides it
  const kept = (v) => Math.max(-1e5, Math.min(1e5, v)).toFixed(2);
  for (const curve of curves) {
    let path = "";
    for (let i = 0; i < curve.x.length; i++) {
      if (!Number.isFinite(curve.x[i]) || !Number.isFinite(curve.y[i])) break;
      path += `${i ? "L" : "M"}${kept(x(curve.x[i]))} ${kept(y(curve.y[i]))}`;
    }
    const drawn = stroked(path, curve);
    drawn.append(element("title", {}, curve.name));
    inside.append(drawn);
  }
  root.append(inside);
  place.replaceChildren(root);
}

// Of curves' largest numbers those that set the scale: an explosion does not.
function shown(sizes) {
  const sorted = sizes.filter(Number.isFinite).sort((a, b) => a - b);
  const most = 8 * (sorted[Math.floor((sorted.length - 1) / 2)] || 0);
  return sizes.map((size) => size <= most);
}

function largest(values) {
  return values.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
}

function flat(lists) {
  return [].concat(...lists);
}

function beyond(names) {
  return names.length ? ` Beyond the picture: ${names.join(", ")}.` : "";
}

// One colour for one scheme everywhere in the page.
const SCHEMES = [...new Set(
  ["explicit-euler", "semi-implicit-euler", "implicit-euler", "velocity-verlet"].concat(DATA.runs.map((run) => run.scheme)),
)];

function colourOf(scheme) {
  return COLOURS[SCHEMES.indexOf(scheme) % COLOURS.length];
}

// A line in its colour; on paper, where all are black, by another dash for each scheme.
function stroked(d, { colour, dash, printed }) {
  const line = element("path", { class: "curve", d, "stroke-dasharray": dash });
  line.style.stroke = colour;
  line.style.setProperty("--printed", printed || "none");
  return line;
}

function sample(look) {
  const line = stroked("M0 5H30", look);
  return element("svg", { width: 30, height: 10, "aria-hidden": "true" }, line);
}

function legend() {
  const place = document.getElementById("methods");
  const seen = new Map();
  DATA.runs.forEach((run) => {
    const count = seen.get(run.scheme) || 0;
    seen.set(run.scheme, count + 1);
    const which = SCHEMES.indexOf(run.scheme);
    run.colour = colourOf(run.scheme);
    run.dash = DASHES[(count + Math.floor(which / COLOURS.length)) % DASHES.length];
    run.printed = DASHES[(which + count) % DASHES.length];
    run.on = count === 0;
    const label = html("label"), box = html("input");
    box.type = "checkbox";
    box.checked = run.on;
    box.addEventListener("change", () => {
      run.on = box.checked;
      draw();
    });
    label.title = run.title;
    label.append(box, sample(run), run.label);
    place.append(label);
  });
}

function draw() {
  const runs = DATA.runs.filter((run) => run.on);
  const names = runs.map((run) => run.label).join(", ") || "nothing";
  const curve = (run, x, y) => ({ x, y, colour: run.colour, dash: run.dash, printed: run.printed, name: `${run.label}: ${run.title}` });
  const fits = shown(runs.map((run) => Math.max(largest(run.q), largest(run.p))));
  const base = runs.filter((_, i) => fits[i]);
  plot(
    document.getElementById("phase"), runs.map((run) => curve(run, run.q, run.p)),
    extent(flat(base.map((run) => run.q))), extent(flat(base.map((run) => run.p))),
    "q", "p", `Phase portrait of ${names}`,
  );
  const far = (flags, list) => beyond(list.filter((_, i) => !flags[i]).map((run) => run.label));
  document.getElementById("phase-note").textContent = far(fits, runs);
  const kept = runs.filter((run) => run.energy);
  for (const run of kept) {
    const start = run.energy[0];
    run.change = run.energy.map((e) => (e - start) / (Math.abs(start) || 1));
  }
  // of energies the one that grows is what is to be seen: only what has left all the others is cut off
  const fine = kept.map((run) => largest(run.change) < 20);
  const scale = kept.filter((_, i) => fine[i]);
  plot(
    document.getElementById("energy"), kept.map((run) => curve(run, run.t, run.change)),
    extent(flat(kept.map((run) => run.t))), extent(flat(scale.map((run) => run.change))),
    "t", "(H - H\u2080) / |H\u2080|", `Change of energy over time of ${names}`,
  );
  document.getElementById("energy-note").textContent = far(fine, kept);
}

function selfCheck() {
  const place = document.getElementById("selfcheck");
  if (!DATA.spring) return;
  const engine = (run) => run.label.split(":")[0];
  const mine = DATA.runs.filter((run) => Object.hasOwn(LOOPS, run.label));
  const tried = mine.filter((run) => !DATA.spring.converted.includes(engine(run)));
  const list = html("ul");
  let wrong = 0;
  for (const run of tried) {
    const found = firstDifference(run, DATA.spring);
    wrong += found ? 1 : 0;
    list.append(html("li", found
      ? `${run.label} differs first in frame ${found.frame}, t = ${found.t}: `
        + `here q = ${found.q}, p = ${found.p}; in the file q = ${found.fileQ}, p = ${found.fileP}`
      : `${run.label}: ${run.t.length} frames, each q and p the same double`));
  }
  const others = DATA.runs.length - tried.length;
  if (others) list.append(html("li", `${others} other methods are not computed again here`));
  const head = html("p", !tried.length ? "None of these methods is computed again here."
    : wrong ? "Your browser and this file differ:" : "Your browser = this file, to the last bit.");
  head.className = !tried.length ? "" : wrong ? "bad" : "good";
  place.dataset.result = !tried.length ? "none" : wrong ? "differs" : "equal";
  place.replaceChildren(head, list);
}

const TRIED = [
  ["explicit Euler", euler, colourOf("explicit-euler"), ""],
  ["semi-implicit Euler", semiImplicitEuler, colourOf("semi-implicit-euler"), "7 4"],
  ["velocity Verlet", velocityVerlet, colourOf("velocity-verlet"), "2 3"],
];
const RANGE = 200;

function live() {
  if (!DATA.spring) return;
  const own = DATA.spring, now = { ...own };
  document.getElementById("live").hidden = false;
  const omega = Math.sqrt(Math.abs(own.k) / own.m) || 1;
  const sign = Math.sign(own.h);
  const most = Math.max(3 / omega, 2 * Math.abs(own.h)), least = Math.min(0.01 / omega, Math.abs(own.h) / 2);
  const start = Math.abs(own.p) || Math.abs(own.q - own.at) * own.m * omega || 1;
  const log = (low, high, s) => (u) => s * low * (high / low) ** u;
  const sliders = {
    h: log(least, most, sign),
    k: log(Math.abs(own.k) / 10 || 0.1, Math.abs(own.k) * 10 || 10, Math.sign(own.k) || 1),
    m: log(own.m / 10, own.m * 10, 1),
    p: (u) => (2 * u - 1) * 3 * start,
  };
  const inputs = {};
  const put = (name) => {
    // where the slider stands for the scene's own number
    let best = 0;
    for (let i = 0; i <= RANGE; i++) {
      if (Math.abs(sliders[name](i / RANGE) - own[name]) < Math.abs(sliders[name](best / RANGE) - own[name])) best = i;
    }
    inputs[name].value = best;
    now[name] = own[name];
  };
  for (const name of Object.keys(sliders)) {
    const input = document.getElementById(`slide-${name}`);
    Object.assign(input, { min: 0, max: RANGE, step: 1 });
    inputs[name] = input;
    put(name);
    input.addEventListener("input", () => {
      now[name] = sliders[name](Number(input.value) / RANGE);
      orbit(now, inputs);
    });
  }
  document.getElementById("reset").addEventListener("click", () => {
    Object.keys(sliders).forEach(put);
    orbit(now, inputs);
  });
  for (const [name, , colour, dash] of [...TRIED, ["true motion", null, "var(--soft)", "1 5"]]) {
    const one = html("span");
    one.append(sample({ colour, dash, printed: dash }), name);
    document.getElementById("orbit-legend").append(one);
  }
  orbit(now, inputs);
}

function orbit(s, inputs) {
  for (const [name, input] of Object.entries(inputs)) {
    document.getElementById(`show-${name}`).textContent = number(s[name]);
    input.setAttribute("aria-valuetext", number(s[name]));
  }
  const energy = (s.p * s.p) / (2 * s.m) + (s.k * (s.q - s.at) ** 2) / 2;
  const bound = s.k > 0 && energy > 0;
  const a = bound ? Math.sqrt((2 * energy) / s.k) : 1, b = bound ? Math.sqrt(2 * energy * s.m) : 1;
  const angles = Array.from({ length: 181 }, (_, i) => (i * Math.PI) / 90);
  const curves = bound ? [{
    x: angles.map((u) => s.at + a * Math.cos(u)), y: angles.map((u) => b * Math.sin(u)),
    colour: "var(--soft)", dash: "1 5", printed: "1 5", name: "true motion",
  }] : [];
  const far = [];
  for (const [name, loop, colour, dash] of TRIED) {
    const step = loop(), x = [s.q], y = [s.p];
    let q = s.q, p = s.p;
    for (let i = 0; i < Math.min(DATA.steps, 1000); i++) {
      [q, p] = step(s, q, p);
      x.push(q);
      y.push(p);
    }
    if (!(Math.abs(q - s.at) <= 4 * a) || !(Math.abs(p) <= 4 * b)) far.push(name);
    curves.push({ x, y, colour, dash, printed: dash, name });
  }
  const range = (at, size) => [at - 4 * size, at + 4 * size];
  plot(document.getElementById("orbit"), curves, range(s.at, a), range(0, b), "q", "p",
    "Orbits of explicit Euler, semi-implicit Euler and velocity Verlet beside the true one");
  document.getElementById("orbit-note").textContent = beyond(far);
  const size = s.k > 0 ? Math.abs(s.h) * Math.sqrt(s.k / s.m) : NaN;
  document.getElementById("live-said").textContent = Number.isNaN(size)
    ? "No restoring force: the true motion leaves as well."
    : `h \u03c9 = ${number(size)}: ` + (size < 2 ? "explicit Euler spirals out, the two others stay"
      : size > 2 ? "beyond 2, all three explode" : "the limit itself");
  gauge(size);
}

// h omega on a line from 0 to 3, with the limit at 2.
function gauge(size) {
  const W = 440, at = (v) => 10 + (Math.min(v, 3) / 3) * (W - 20);
  const root = element("svg", { viewBox: `0 0 ${W} 44`, role: "img", "aria-label": `h omega = ${number(size)}, limit 2` });
  root.append(element("rect", { class: "bar", x: at(0), y: 8, width: W - 20, height: 12 }));
  root.append(element("line", { class: "limit", x1: at(2), x2: at(2), y1: 2, y2: 26 }));
  for (const v of [0, 1, 2, 3]) {
    root.append(element("text", { x: at(v), y: 40, "text-anchor": "middle" }, v === 2 ? "limit h \u03c9 = 2" : String(v)));
  }
  if (Number.isFinite(size)) root.append(element("circle", { class: "here", cx: at(size), cy: 14, r: 7 }));
  document.getElementById("gauge").replaceChildren(root);
}

legend();
draw();
selfCheck();
live();
