"use strict";
// Steps in the order of operations of the methods named: JavaScript's numbers are IEEE doubles.  `s` is
// {h, k, m, c} and the force f - k q - c p/m, or -k (q - at) - c p/m of a wall spring.

// The exact motion of the spring of `s` after each of `times`, [q, p].
function exactMotion(s, times) {
  const g = (s.c || 0) / (2 * s.m), w2 = s.k / s.m - g * g, w = Math.sqrt(Math.abs(w2));
  const x0 = s.q - s.at, v0 = s.p / s.m, [cos, sin] = w2 > 0 ? [Math.cos, Math.sin] : [Math.cosh, Math.sinh];
  return times.map((t) => {
    const decay = Math.exp(-g * t);
    let [even, odd] = [decay * cos(w * t), decay * (w === 0 ? t : sin(w * t) / w)];
    if (w2 < 0 && Math.abs(w * t) > 1) {
      // two exponentials, the slow one without cancellation: cosh leaves the range of doubles
      const [slow, fast] = [Math.exp((-(s.k / s.m) / (g + w)) * t), Math.exp(-(g + w) * t)];
      [even, odd] = [(slow + fast) / 2, (slow - fast) / (2 * w)];
    }
    const x = x0 * even + (v0 + g * x0) * odd;
    return [s.at + x, s.m * (v0 * even - (g * v0 + (s.k / s.m) * x0) * odd)];
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
  const sum = (first, row, values) => values.reduce((x, v, i) => (row[i] ? x + row[i] * h * v : x), first);
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

// How far a stored run is from its scheme computed here, in parts of what rounding may do, where most; its
// first frame that is not the same to the last bit.  Of an adaptive solver: from the exact motion, in parts
// of a thousand tolerances for each radian.
function departure(run, s, law) {
  const w = Math.sqrt(Math.abs(s.k) / s.m) || 1, own = { ...s, h: run.step }, at = s.at ?? (s.k && s.f / s.k);
  const motion = law === "exact" && exactMotion({ ...s, at }, run.t);
  const step = motion ? null : stepper(law, own);
  const found = { share: 0, frame: 0, first: null };
  let [q, p, size] = [s.q, s.p, 0];
  for (let i = 0; i < run.t.length; i++) {
    for (let j = 0; step && i && j < run.every; j++) [q, p] = step(q, p);
    if (motion) [q, p] = motion[i];
    if (!Object.is(q, run.q[i]) || !Object.is(p, run.p[i])) found.first ||= { i, q, p };
    size = Math.max(size, Math.hypot(w * q, p / s.m), Math.hypot(w * (q - at), p / s.m));
    const tolerance = motion ? 1e3 * s.tolerance * (1 + w * Math.abs(run.t[i])) : 0;
    const allowed = size * Math.max(tolerance, run.rounding * (1 + i * run.every));
    const share = Math.hypot(w * (q - run.q[i]), (p - run.p[i]) / s.m) / allowed;
    // what is no number is not equal
    if (!(share <= found.share)) [found.share, found.frame] = [Number.isNaN(share) ? Infinity : share, i];
  }
  return found;
}
