"use strict";
// The three loops, in the order of operations of the methods named: JavaScript's numbers are IEEE doubles.
// Each takes (q, p) one step on and returns it; `s` is {h, k, m, at}.

function euler() {
  return (s, q, p) => [q + (p / s.m) * s.h, p + (-s.k * (q - s.at)) * s.h];
}

function semiImplicitEuler() {
  return (s, q, p) => {
    const next = p + (-s.k * (q - s.at)) * s.h;
    return [q + (next / s.m) * s.h, next];
  };
}

function velocityVerlet() {
  return (s, q, p) => {
    const x = 0.5 * s.h;
    const half = p + (-s.k * (q - s.at)) * x;
    const moved = q + (half / s.m) * s.h;
    return [moved, half + (-s.k * (moved - s.at)) * x];
  };
}

// ASE multiplies by the step before it divides by the mass, and keeps a force for positions within 1e-15
function aseVelocityVerlet() {
  let where = NaN, force = NaN;
  const forceAt = (s, q) => {
    if (!(Math.abs(q - where) <= 1e-15)) {
      where = q;
      force = -s.k * (q - s.at);
    }
    return force;
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
