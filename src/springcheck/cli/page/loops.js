"use strict";
// The three loops, in the order of operations of the methods named: JavaScript's numbers are IEEE doubles.
// Each takes (q, p) one step on and returns it; `s` is {h, k, m, at} and, beside the stored runs, friction c.

function force(s, q, p) {
  const spring = -s.k * (q - s.at);
  return s.c ? spring - (s.c * p) / s.m : spring;
}

function euler() {
  return (s, q, p) => [q + (p / s.m) * s.h, p + force(s, q, p) * s.h];
}

function semiImplicitEuler() {
  return (s, q, p) => {
    const next = p + force(s, q, p) * s.h;
    return [q + (next / s.m) * s.h, next];
  };
}

function velocityVerlet() {
  return (s, q, p) => {
    const x = 0.5 * s.h;
    const half = p + force(s, q, p) * x;
    const moved = q + (half / s.m) * s.h;
    return [moved, half + force(s, moved, half) * x];
  };
}

// ASE multiplies by the step before it divides by the mass, and keeps a force for positions within 1e-15
function aseVelocityVerlet() {
  let where = NaN, kept = NaN;
  const forceAt = (s, q) => {
    if (!(Math.abs(q - where) <= 1e-15)) {
      where = q;
      kept = -s.k * (q - s.at);
    }
    return kept;
  };
  return (s, q, p) => {
    const x = 0.5 * s.h;
    const half = p + x * forceAt(s, q);
    const moved = q + (s.h * half) / s.m;
    return [moved, half + x * forceAt(s, moved)];
  };
}

const LOOPS = {
  "own:euler": euler,
  "own:semi-implicit-euler": semiImplicitEuler,
  "own:velocity-verlet": velocityVerlet,
  "ase:velocity-verlet": aseVelocityVerlet,
};

// The first frame in which a stored run is not what its loop gives here, to the last bit; null where none is.
function firstDifference(run, spring) {
  const step = LOOPS[run.label](), s = { ...spring, h: run.step };
  let q = spring.q, p = spring.p;
  for (let i = 0; i < run.t.length; i++) {
    if (i > 0) {
      for (let j = 0; j < run.every; j++) [q, p] = step(s, q, p);
    }
    if (!Object.is(q, run.q[i]) || !Object.is(p, run.p[i])) {
      return { frame: i, t: run.t[i], q, p, fileQ: run.q[i], fileP: run.p[i] };
    }
  }
  return null;
}

// Spectral radius of a loop's one-step matrix at h omega = w and damping ratio c / (2 sqrt(k m)) = zeta.
function radius(loop, w, zeta) {
  const s = { h: w, k: 1, m: 1, at: 0, c: 2 * zeta };
  const [a, c] = loop()(s, 1, 0), [b, d] = loop()(s, 0, 1);
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
