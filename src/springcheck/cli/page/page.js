"use strict";
// The stored motion, the loops of loops.js on opening and by the sliders, and the charts of the studies.

// rows of numbers stand once: [rows, data], and {"#": i} for the i-th of them, {"$": i} where it is text
const [ROWS, GIVEN] = JSON.parse(document.getElementById("data").textContent);

function whole(x) {
  if (!x || typeof x !== "object") return x;
  if (Array.isArray(x)) return x.map(whole);
  // infinities and not-a-numbers are words in JSON
  if ("$" in x) return ROWS[x.$];
  if ("#" in x) return ROWS[x["#"]].map(Number);
  return Object.fromEntries(Object.entries(x).map(([name, value]) => [name, whole(value)]));
}

const DATA = whole(GIVEN);
for (const run of DATA.runs) for (const name of ["t", "q", "p"]) run[name] = run[name].map(Number);
const PLAIN = { log: false, values: [], shown: null, factor: 1 };

// A chart of curves on linear axes.
function plain(title, x, y, curves, more) {
  return { title, x: { ...PLAIN, name: x }, y: { ...PLAIN, name: y }, curves, tiles: null, rules: [], labels: [], note: "", ...more };
}

function curveOf(name, group, x, y, more) {
  return { name, group, x, y, line: true, marks: false, notes: null, title: "", ...more };
}

// Of the run and of the studies, as they come.
function banks() {
  const numbers = (values) => values.map(Number);
  for (const [name, bank] of Object.entries(DATA.banks)) {
    for (const chart of bank.charts) {
      for (const curve of chart.curves) Object.assign(curve, { x: numbers(curve.x), y: numbers(curve.y), title: curve.title || curve.group });
      if (chart.tiles) for (const scale of [chart.x, chart.y]) if (!scale.named) scale.values = numbers(scale.values);
    }
    new Bank(document.getElementById(name), bank);
  }
}

function selfCheck() {
  const place = document.getElementById("selfcheck");
  if (!place) return;
  const list = html("ul"), say = (text) => list.append(html("li", text));
  const said = { equal: [], near: [], not: [] };
  let wrong = counted();
  if (wrong) say(wrong);
  for (const run of DATA.linear ? DATA.runs : []) {
    const law = DATA.laws[run.scheme];
    if (DATA.spring && Object.hasOwn(LOOPS, run.label) && !DATA.spring.converted.includes(run.label.split(":")[0])) {
      const found = firstDifference(run, DATA.spring);
      if (!found) said.equal.push(run.label);
      else {
        say(`${run.label} differs first in frame ${found.frame}, t = ${found.t}: `
          + `here q = ${found.q}, p = ${found.p}; in the file q = ${found.fileQ}, p = ${found.fileP}`);
        wrong = true;
      }
    } else if (law) {
      const { share, frame } = departure(run, DATA.linear, law), far = share > 1;
      if (!far) said.near.push(run.label);
      else {
        say(`${run.label} is not ${run.title} here: in frame ${frame}, t = ${run.t[frame]}, it is ${number(share, 2)} times as far off as `
          + `rounding allows${run.failed ? ", and its verdicts say so" : ""}`);
        wrong = wrong || !run.failed;
      }
    } else said.not.push(run.label);
  }
  const frames = DATA.runs.length ? ` (${DATA.runs[0].t.length} frames)` : "";
  if (said.equal.length) say(`each q and p the same double${frames}: ${said.equal.join(", ")}`);
  if (said.near.length) say(`the scheme's motion to rounding, or the exact one to tolerance: ${said.near.join(", ")}`);
  if (said.not.length) say(`not computed again here: ${said.not.join(", ")}`);
  const tried = said.equal.length + said.near.length;
  const head = html("p", wrong ? "Your browser and this file differ:" : !tried ? "None of these methods is computed again here."
    : `Your browser = this file: ${said.equal.length} of ${DATA.runs.length} methods to the last bit, ${said.near.length} to rounding or tolerance.`);
  place.dataset.result = wrong ? "differs" : tried ? "equal" : "none";
  head.className = { differs: "bad", equal: "good", none: "" }[place.dataset.result];
  place.replaceChildren(head, list);
}

// What is wrong with the counts of verdicts in this page, by its tables; "" where they agree.
function counted() {
  let [judged, failed, apart] = [0, 0, ""];
  for (const one of document.querySelectorAll("details.method")) {
    const rows = [...one.querySelectorAll("tbody tr")].filter((row) => !row.classList.contains("dim")).map((row) => row.children);
    const bad = rows.filter((cells) => cells[1].textContent === "FAILED").length, label = one.querySelector("b").textContent;
    const beyond = rows.filter((cells) => parseFloat(cells[2].textContent) > 1.01 * parseFloat(cells[3].textContent)).length;
    const text = one.querySelector("summary span").textContent;
    judged += rows.length;
    failed += bad;
    const passed = text.startsWith("not judged") || text.includes(` ${rows.length - bad} passed`);
    if (beyond > bad || !passed || text.includes("FAILED") !== bad > 0) apart = apart || `the verdicts on ${label} are not those of their table`;
  }
  const head = document.getElementById("counts").textContent;
  const right = failed ? head.startsWith(`${failed} of ${judged} failed`) : head.startsWith(`${judged} verdict`);
  return apart || (right ? "" : `the head says "${head}", and the tables have ${failed} failed of ${judged}`);
}

const TRIED = [
  ["explicit Euler", "explicit-euler"], ["semi-implicit Euler", "semi-implicit-euler"], ["velocity Verlet", "velocity-verlet"],
];
const EXACT = "exact";
const RANGE = 200;

function live() {
  if (!DATA.spring) return;
  const own = { ...DATA.spring, c: 0 }, now = { ...own }, by = (id) => document.getElementById(id);
  by("live").hidden = false;
  const omega = Math.sqrt(Math.abs(own.k) / own.m) || 1;
  const most = Math.max(3 / omega, 2 * Math.abs(own.h)), least = Math.min(0.01 / omega, Math.abs(own.h) / 2);
  const start = Math.abs(own.p) || Math.abs(own.q - own.at) * own.m * omega || 1;
  const log = (low, high, s) => (u) => s * low * (high / low) ** u;
  const sliders = {
    h: log(least, most, Math.sign(own.h)),
    k: log(Math.abs(own.k) / 10 || 0.1, Math.abs(own.k) * 10 || 10, Math.sign(own.k) || 1),
    m: log(own.m / 10, own.m * 10, 1),
    p: (u) => (2 * u - 1) * 3 * start,
    c: (u) => u * 3 * own.m * omega,
  };
  const right = { h: (v) => v !== 0, m: (v) => v > 0, c: (v) => v >= 0 };
  // the slider stands where it is nearest
  const put = (name, value) => {
    if (!Number.isFinite(value) || (right[name] && !right[name](value))) return;
    const places = Array.from({ length: RANGE + 1 }, (_, i) => Math.abs(sliders[name](i / RANGE) - value));
    by(`slide-${name}`).value = places.indexOf(Math.min(...places));
    now[name] = value;
  };
  const asked = new URLSearchParams(location.hash.slice(1));
  let charts = tried(now);
  const bank = new Bank(by("orbits"), { title: "Drawn", on: [...TRIED.map(([name]) => name), EXACT], charts });
  const show = () => {
    charts = tried(now);
    charts.forEach((chart, i) => bank.charts[i].show(chart));
    said(now, sliders);
    const changed = Object.keys(sliders).filter((name) => now[name] !== own[name]).map((name) => [name, now[name]]);
    if (changed.length || asked.size) history.replaceState(null, "", `#${new URLSearchParams(changed)}`);
    move();
  };
  const move = () => moving(now, bank.charts[0], Number(by("slide-t").value));
  for (const name of Object.keys(sliders)) {
    const input = by(`slide-${name}`), field = by(`show-${name}`);
    Object.assign(input, { min: 0, max: RANGE, step: 1 });
    put(name, own[name]);
    if (asked.has(name)) put(name, Number(asked.get(name)));
    input.addEventListener("input", () => {
      now[name] = sliders[name](Number(input.value) / RANGE);
      show();
    });
    field.addEventListener("change", () => {
      put(name, field.valueAsNumber);
      show();
    });
  }
  by("slide-t").max = charts[0].curves[1].x.length - 1;
  by("slide-t").addEventListener("input", move);
  by("play").addEventListener("click", () => {
    const began = performance.now(), from = Number(by("slide-t").value) % Number(by("slide-t").max);
    const next = (time) => {
      // twenty steps a second
      const step = Math.min(Number(by("slide-t").max), from + Math.round((time - began) / 50));
      by("slide-t").value = step;
      move();
      if (step < Number(by("slide-t").max)) requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  });
  by("reset").addEventListener("click", () => {
    for (const name of Object.keys(sliders)) put(name, own[name]);
    show();
  });
  show();
}

// Mass and spring by each scheme after a step, a row each, and their places on the orbits of the chart.
function moving(s, chart, step) {
  const drawn = chart.spec.curves.filter((curve) => curve.group !== EXACT), W = 720, row = 46, left = 14;
  const size = 1.5 * Math.max(...drawn.map(() => Math.hypot(s.q - s.at, s.p / Math.sqrt(Math.abs(s.k * s.m) || 1)))) || 1;
  const x = (q) => Math.max(left + 20, Math.min(W - 20, W / 2 + ((q - s.at) / size) * (W / 2 - 60)));
  const root = element("svg", { viewBox: `0 0 ${W} ${row * drawn.length}`, role: "img", "aria-label": `mass and spring after ${step} steps` });
  drawn.forEach((curve, j) => {
    const end = x(curve.x[step]), y = row * j + 30, look = lookOf(curve.group, 0);
    const turns = Array.from({ length: 13 }, (_, i) => `L${left + ((end - 9 - left) * (i + 0.5)) / 13} ${y + (i % 2 ? 6 : -6)}`);
    root.append(element("path", { class: "frame", d: `M${left} ${y - 12}V${y + 12}M${left} ${y}${turns.join("")}L${end - 9} ${y}` }));
    const mass = element("rect", { x: end - 9, y: y - 9, width: 18, height: 18 });
    mass.style.fill = look.colour;
    root.append(mass, element("text", { x: left + 4, y: y - 14 }, curve.name));
    const dot = chart.dots[j] || (chart.dots[j] = element("circle", { r: 5 }));
    dot.style.fill = look.colour;
    dot.setAttribute("cx", chart.px(curve.x[step]));
    dot.setAttribute("cy", chart.py(curve.y[step]));
    chart.ring.parentNode.append(dot);
  });
  document.getElementById("moving").replaceChildren(root);
  document.getElementById("show-t").textContent = `t = ${number(step * s.h)}`;
}

// The orbits by these numbers, and by what factor a step multiplies the motion at any h omega.
function tried(s) {
  const steps = Math.min(DATA.steps, 1000);
  const omega2 = s.k / s.m, energy = (s.p * s.p) / (2 * s.m) + (s.k * (s.q - s.at) ** 2) / 2;
  const bound = s.k > 0 && energy > 0;
  const a = bound ? Math.sqrt((2 * energy) / s.k) : 1, b = bound ? Math.sqrt(2 * energy * s.m) : 1;
  const times = Array.from({ length: 1001 }, (_, i) => (i / 1000) * Math.min(steps * Math.abs(s.h), 40 / Math.sqrt(omega2 || 1)));
  const exact = bound ? exactMotion(s, times) : [];
  const orbits = [curveOf(EXACT, EXACT, exact.map(([q]) => q), exact.map(([, p]) => p), { notes: times.map((t) => `t ${t}`) })];
  const far = [];
  for (const [name, group] of TRIED) {
    const step = stepper(THREE[group], s), x = [s.q], y = [s.p];
    let q = s.q, p = s.p;
    for (let i = 0; i < steps; i++) {
      [q, p] = step(q, p);
      x.push(q);
      y.push(p);
    }
    if (!(Math.abs(q - s.at) <= 4 * a) || !(Math.abs(p) <= 4 * b)) far.push(name);
    orbits.push(curveOf(name, group, x, y, { notes: x.map((_, i) => `step ${i}`) }));
  }
  const range = (at, size) => ({ ...PLAIN, shown: [at - 4 * size, at + 4 * size] });
  const zeta = s.k > 0 ? Math.sign(s.h) * s.c / (2 * Math.sqrt(s.k * s.m)) : 0;
  const ws = Array.from({ length: 301 }, (_, i) => i / 100);
  const radii = TRIED.map(([name, group]) => curveOf(name, group, ws, ws.map((w) => radius(THREE[group], w, zeta))));
  const here = s.k > 0 ? [{ axis: "x", at: Math.abs(s.h) * Math.sqrt(omega2), name: "here", look: "here" }] : [];
  return [
    plain(`Momentum over position, ${steps} steps.${far.length ? ` Beyond the picture: ${far.join(", ")}.` : ""}`, "q", "p", orbits, {
      x: { ...range(s.at, a), name: "q" }, y: { ...range(0, b), name: "p" }, equal: DATA.equal && a < 3 * b && b < 3 * a,
    }),
    plain("Factor by which one step multiplies the motion; above 1 it explodes.", "h \u03c9", "factor a step", radii, {
      x: { ...PLAIN, name: "h \u03c9", shown: [0, 3] }, y: { ...PLAIN, name: "factor a step", shown: [0, 3] },
      rules: [{ axis: "x", at: 2, name: "limit h \u03c9 = 2" }, { axis: "y", at: 1, name: "", look: "one" }, ...here],
    }),
  ];
}

function said(s, sliders) {
  for (const name of Object.keys(sliders)) {
    document.getElementById(`show-${name}`).value = number(s[name], 6);
    document.getElementById(`slide-${name}`).setAttribute("aria-valuetext", number(s[name]));
  }
  const size = s.k > 0 ? Math.abs(s.h) * Math.sqrt(s.k / s.m) : NaN;
  const place = document.getElementById("live-said");
  if (Number.isNaN(size)) place.textContent = "No restoring force: the exact motion leaves as well.";
  else if (!s.c) {
    place.textContent = `h \u03c9 = ${number(size)}: ` + (size < 2 ? "explicit Euler spirals out, the two others stay"
      : size > 2 ? "beyond 2, all three explode" : "the limit itself");
  } else {
    const zeta = s.c / (2 * Math.sqrt(s.k * s.m));
    const each = TRIED.map(([name, group]) => {
      const factor = radius(THREE[group], size, Math.sign(s.h) * zeta);
      return `${name} ${factor > 1 ? "explodes" : "decays"} by a factor ${number(factor, 4)} a step`;
    });
    place.textContent = `h \u03c9 = ${number(size)}, damping ratio ${number(zeta)}: ${each.join(", ")}`;
  }
}

selfCheck();
live();
banks();

// a link to what is folded opens it
addEventListener("hashchange", () => {
  const there = document.getElementById(location.hash.slice(1));
  if (there && there.tagName === "DETAILS") there.open = true;
});
