"use strict";
// Splittings of a heat bath by the reader's own h, gamma and T: a step is z' = A z + G xi of z = (q, v) in
// units of thermal motion, its stationary covariance S = A S A' + G G'; held against Python's values first.

// <q q>, <q v>, <v v> of stages [kind, share] at h omega = x and gamma h = y; null where none is stationary.
function covariance(stages, x, y) {
  const step = (q, v, draw) => {
    let drawn = 0;
    for (const [kind, share] of stages) {
      if (kind === "kick") v -= share * x * q;
      else if (kind === "drift") q += share * x * v;
      else v = Math.exp(-share * y) * v + Math.sqrt(-Math.expm1(-2 * share * y)) * Number(draw === drawn++);
    }
    return [q, v];
  };
  const [a, c] = step(1, 0), [b, d] = step(0, 1), det = a * d - b * c;
  if (!(Math.abs(a + d) < 1 + det && det < 1)) return null;
  const G = stages.filter(([kind]) => kind === "exchange").map((_, i) => step(0, 0, i));
  const sum = (i, j) => G.reduce((total, g) => total + g[i] * g[j], 0);
  const [r, s, t] = [
    [1 - a * a, -2 * a * b, -b * b, sum(0, 0)], [-a * c, 1 - a * d - b * c, -b * d, sum(0, 1)],
    [-c * c, -2 * c * d, 1 - d * d, sum(1, 1)],
  ];
  const volume = (i, j, k) => r[i] * (s[j] * t[k] - s[k] * t[j]) - r[j] * (s[i] * t[k] - s[k] * t[i])
    + r[k] * (s[i] * t[j] - s[j] * t[i]);
  return [volume(3, 1, 2), volume(0, 3, 2), volume(0, 1, 3)].map((part) => part / volume(0, 1, 2));
}

function bath() {
  const { stages, own, w, sliders, values, live, unit } = DATA.bath, now = { ...own }, [chart] = live.charts;
  const of = (name, h, g) => covariance(stages[name], h * w, g * h);
  let off = 0;
  for (const [h, g, found] of values) {
    for (const [name, right] of Object.entries(found)) {
      const mine = of(name, h, g) || [], far = right.map((x, i) => Math.abs(x - mine[i]) / (1 + Math.abs(x)));
      off = Math.max(off, ...far.map((x) => (x >= 0 ? x : Infinity)));
    }
  }
  const [result, look, head] = off < 1e-9 ? ["equal", "good", "="] : ["differs", "bad", "is not"];
  made(by("bath-check"), { class: look, "data-result": result }, `Your browser ${head} Python: `
    + `${values.length * Object.keys(stages).length} covariances, ${number(off, 1)} apart at most.`);
  const drawn = () => chart.curves.map((curve) => {
    const S = curve.group === "exact" ? [1, 0, 1] : of(curve.group, now.h, now.g), [qq, qv, vv] = S || [];
    const turn = Array.from({ length: S ? 181 : 0 }, (_, i) => (i * Math.PI) / 90);
    const size = DATA.bath.q * Math.sqrt(now.T), side = qv / Math.sqrt(qq), up = Math.sqrt(vv - side * side);
    const y = turn.map((t) => w * size * (side * Math.cos(t) + up * Math.sin(t)));
    return { ...curve, x: turn.map((t) => size * Math.sqrt(qq) * Math.cos(t)), y, S };
  });
  const bank = new Bank(by("bath-chart"), { ...live, charts: [{ ...chart, curves: drawn() }] });
  const show = () => {
    const curves = drawn(), cell = (x) => html("td", { class: "number" }, x);
    bank.charts[0].show({ ...chart, curves });
    by("bath-said").replaceChildren(...curves.slice(1).map(({ name, S }) => html("tr", {},
      html("th", { scope: "row" }, name), ...(S ? [S[0], S[2]] : ["", ""]).map((x) =>
        cell(S ? `${number(x * now.T, 6)} ${unit}` : "none: unstable")))));
  };
  const [, tell] = sliding("bath-", sliders, now, (_, value) => value > 0, show);
  by("bath").hidden = false;
  tell();
}

bath();
