"use strict";
// Steps in the order of operations of the methods named: JavaScript's numbers are IEEE doubles.  `s` is
// {h, k, m, c} and the force f - k q - c p/m, or -k (q - at) - c p/m of a wall spring.

const THREE = {
  "explicit-euler": { a: [[]], b: [1] },
  "semi-implicit-euler": [["kick", 1], ["drift", 1]],
  "velocity-verlet": [["kick", 0.5], ["drift", 1], ["kick", 0.5]],
};

// ASE multiplies by the step before it divides by the mass, and keeps a force for positions within 1e-15
function aseVelocityVerlet(s) {
  let where = NaN, kept = NaN;
  const forceAt = (q) => {
    if (!(Math.abs(q - where) <= 1e-15)) {
      where = q;
      kept = -s.k * (q - s.at);
    }
    return kept;
  };
  return (q, p) => {
    const x = 0.5 * s.h;
    const half = p + x * forceAt(q);
    const moved = q + (s.h * half) / s.m;
    return [moved, half + x * forceAt(moved)];
  };
}

const LOOPS = {
  "own:euler": (s) => stepper(THREE["explicit-euler"], s),
  "own:semi-implicit-euler": (s) => stepper(THREE["semi-implicit-euler"], s),
  "own:velocity-verlet": (s) => stepper(THREE["velocity-verlet"], s),
  "ase:velocity-verlet": aseVelocityVerlet,
};

// The first frame in which a stored run is not what its loop gives here, to the last bit; null where none is.
function firstDifference(run, spring) {
  const step = LOOPS[run.label]({ ...spring, h: run.step });
  let q = spring.q, p = spring.p;
  for (let i = 0; i < run.t.length; i++) {
    if (i > 0) {
      for (let j = 0; j < run.every; j++) [q, p] = step(q, p);
    }
    if (!Object.is(q, run.q[i]) || !Object.is(p, run.p[i])) {
      return { frame: i, t: run.t[i], q, p, fileQ: run.q[i], fileP: run.p[i] };
    }
  }
  return null;
}

// Spectral radius of a scheme's one-step matrix at h omega = w and damping ratio c / (2 sqrt(k m)) = zeta.
function radius(law, w, zeta) {
  const step = stepper(law, { h: w, k: 1, m: 1, at: 0, c: 2 * zeta });
  const [a, c] = step(1, 0), [b, d] = step(0, 1);
  const half = (a + d) / 2, rest = half * half - (a * d - b * c);
  return rest < 0 ? Math.sqrt(a * d - b * c) : Math.abs(half) + Math.sqrt(rest);
}

// The exact motion of the spring of `s` after each of `times`, [q, p].
function exactMotion(s, times) {
  const g = (s.c || 0) / (2 * s.m), w2 = s.k / s.m - g * g, w = Math.sqrt(Math.abs(w2));
  const x0 = s.q - s.at, v0 = s.p / s.m;
  return times.map((t) => {
    const even = w2 > 0 ? Math.cos(w * t) : Math.cosh(w * t);
    const odd = w === 0 ? t : (w2 > 0 ? Math.sin(w * t) : Math.sinh(w * t)) / w;
    const decay = Math.exp(-g * t);
    const x = decay * (x0 * even + (v0 + g * x0) * odd);
    return [s.at + x, s.m * decay * (v0 * even - (g * v0 + (s.k / s.m) * x0) * odd)];
  });
}

// One step of any scheme that the data describes, for one particle.
function stepper(law, s) {
  const { h, k, f, c, m, at } = s, pull = (q) => (at === undefined ? f - k * q : -k * (q - at));
  const force = (q, p) => (c ? pull(q) - (c * p) / m : pull(q));
  if (Array.isArray(law)) {
    return (q, p) => {
      let last = 0;
      for (const [kind, part] of law) {
        const x = part * h;
        if (kind === "drift") q += (p / m) * x;
        else if (kind === "friction") p *= Math.exp((-x * c) / m);
        else if (kind === "implicit-friction") p /= 1 + (x * c) / m;
        else p += x * (last = kind === "held" ? last : kind === "pull" ? pull(q) : force(q, p));
      }
      return [q, p];
    };
  }
  const sum = (start, row, values) => values.reduce((total, v, i) => (row[i] ? total + row[i] * h * v : total), start);
  return (q, p) => {
    const forces = [], speeds = [];
    law.a.forEach((row, i) => {
      let [Q, P] = [sum(q, row, speeds), sum(p, row, forces)];
      const x = (row[i] || 0) * h;
      // an implicit stage: Q = q + x P/m, P = p + x F(Q, P)
      if (x) P = (P + x * pull(Q)) / (1 + (x * c) / m + (x * x * k) / m);
      Q += (x * P) / m;
      forces.push(force(Q, P));
      speeds.push(P / m);
    });
    return [sum(q, law.b, speeds), sum(p, law.b, forces)];
  };
}

// How far a stored run is from its scheme computed here, as a fraction of what rounding may do, and where most:
// an own rounding of either side in each of its steps, as far as the orbit is from a circle, or all its steps.
// Of an adaptive solver: from the exact motion, as a fraction of a thousand tolerances for each radian.
function departure(run, s, law) {
  const w = Math.sqrt(Math.abs(s.k) / s.m) || 1, own = { ...s, h: run.step };
  const step = law === "exact" ? null : stepper(law, own), plain = step && stepper(law, { ...own, f: 0 });
  let stretch = 1;
  if (step) {
    const [a, c] = plain(1, 0), [b, d] = plain(0, 1), half = Math.abs(c / (w * s.m) - b * w * s.m) / 2;
    const area = -((a - d) ** 2 / 4 + b * c);
    stretch = area > 0 ? (half + Math.sqrt(Math.max(half * half - area, 0))) / Math.sqrt(area) : run.t.length * run.every;
  }
  const at = s.k ? s.f / s.k : 0, exact = step ? null : exactMotion({ ...s, at }, run.t);
  let [q, p] = [s.q, s.p], size = 0, worst = { share: 0, frame: 0 };
  for (let i = 0; i < run.t.length; i++) {
    if (step && i) for (let j = 0; j < run.every; j++) [q, p] = step(q, p);
    if (exact) [q, p] = exact[i];
    size = Math.max(size, Math.hypot(w * q, p / s.m), Math.hypot(w * (q - at), p / s.m));
    const rounding = 256 * Math.max(run.roundoff, 2 ** -53) * (1 + i * run.every) * stretch;
    const allowed = size * (exact ? Math.max(1e3 * s.tolerance * (1 + w * Math.abs(run.t[i])), rounding) : rounding);
    const share = Math.hypot(w * (q - run.q[i]), (p - run.p[i]) / s.m) / allowed;
    // what is no number is not equal
    if (!(share <= worst.share)) worst = { share: Number.isNaN(share) ? Infinity : share, frame: i };
  }
  return worst;
}
