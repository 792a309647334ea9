// Which scheme made a file of states, where it is plain: one particle, each step, all digits of doubles, a
// linear force, no friction.  Of anything else the command is to be asked: what is named here, it names.

const ULP = 2 ** -53;
const DIGITS = 46; // units roundoff in half a unit of the 15th digit

// The columns t, q and x (p or v) of a table of one particle; why not, in words, where they are not that.
function columns(text) {
  const [head, ...rest] = text.split(/\r?\n/).map((line) => line.trim()).filter(Boolean);
  const cells = (line) => line.split(/[,;\t]/.test(head) ? /[,;\t]/ : /\s+/).map((cell) => cell.trim());
  const patterns = Object.entries(DATA.columns).map(([kind, names]) => [kind, `^(${names})[\\s_.]*\\d*$`]);
  const bare = (name) => name.replace(/^'(.*)'$/, "$1").replace(/["#]|\(.*?\)|\[.*?\]/g, "").trim();
  const kind = (name) => (patterns.find((one) => new RegExp(one[1], "i").test(bare(name))) || [""])[0];
  const kinds = cells((head || "").replace(/^#\s*/, "")).map(kind), held = [...kinds].sort().join("");
  if (!["qtv", "pqt"].includes(held)) return "Columns t, q and v, or t, q and p, of one particle are needed";
  const rows = rest.filter((line) => line[0] !== "#").map((line) => cells(line).map((x) => Number(x || NaN)));
  const whole = (row) => row.length === kinds.length && row.every(Number.isFinite);
  if (rows.length < 12 || !rows.every(whole)) return "Twelve or more rows of numbers with names are needed";
  const [p, q, t, v] = [..."pqtv"].map((one) => rows.map((row) => row[kinds.indexOf(one)]));
  return held === "pqt" ? { t, q, x: p, momenta: true } : { t, q, x: v, momenta: false };
}

// The affine map from a state to the next in units of their sizes, and what rounding leaves uncertain of it.
function mapOf({ t, q, x }) {
  const n = t.length - 1, T = (t[n] - t[0]) / n, most = Math.max(...t.map(Math.abs));
  const even = T > 0 && t.every((v, i) => !i || Math.abs(v - t[i - 1] - T) <= 4 * ULP * most);
  if (!even) return "The frames are not at even times";
  const mean = (v) => v.reduce((a, b) => a + b, 0) / v.length;
  // only what stays far from 0 is centred: of a motion that grows the small states keep their digits
  const [[q0, qs, Q], [v0, vs, V]] = [q, x].map((v) => {
    const far = mean(v), spread = (at) => Math.sqrt(mean(v.map((u) => (u - at) ** 2)));
    const at = Math.abs(far) > spread(far) ? far : 0, size = spread(at);
    return [at / size, size, v.map((u) => (u - at) / size)];
  });
  const away = Math.hypot(q0, v0), length = Q.map((u, i) => Math.hypot(u + q0, V[i] + v0));
  // least squares, each pair relative to its size
  const sum = (f) => length.reduce((s, u, i) => (i < n ? s + f(i) / Math.max(u, length[i + 1]) ** 2 : s), 0);
  const all = sum(() => 1), a = sum((i) => Q[i]) / all, b = sum((i) => V[i]) / all;
  const aa = sum((i) => (Q[i] - a) ** 2), bb = sum((i) => (V[i] - b) ** 2);
  const ab = sum((i) => (Q[i] - a) * (V[i] - b)), det = aa * bb - ab * ab;
  if (!(det > 1e-3 * aa * bb)) return "The states do not show the motion from all sides";
  const z = [Q, V], rows = [[0, 0, 0], [0, 0, 0]];
  const left = (k, i) => z[k][i + 1] - rows[k][2] - rows[k][0] * Q[i] - rows[k][1] * V[i];
  for (const k of [0, 1, 0, 1, 0, 1]) {
    const [r, u, v] = [() => 1, (i) => Q[i] - a, (i) => V[i] - b].map((f) => sum((i) => left(k, i) * f(i)));
    const [c, d] = [(u * bb - v * ab) / det, (v * aa - u * ab) / det];
    rows[k] = [rows[k][0] + c, rows[k][1] + d, rows[k][2] + r / all - c * a - d * b];
  }
  const [[A, B, e], [C, D, f]] = rows, error = ((64 + n) * ULP * (1 + away)) / Math.sqrt(det / aa / bb);
  // the roundings of a step: of the numbers in the file, of the products and of their sum
  const rounds = ([A, B], i) => Math.abs(A * (Q[i] + q0)) + Math.abs(B * (V[i] + v0));
  const miss = (k, i) => Math.abs(left(k, i)) / (Math.abs(z[k][i + 1] + [q0, v0][k]) + rounds(rows[k], i));
  const exact = t.every((_, i) => i === n || Math.max(miss(0, i), miss(1, i)) < DIGITS * ULP);
  const under = (1 - A) * (1 - D) - B * C;
  if (!exact) return "A step is not linear in the state to rounding: few digits, noise, or another force";
  const rests = Math.abs(v0 * under + C * e + (1 - A) * f) < error * (1 + away);
  return rests ? { entries: [A, B, C, D], ratio: (vs * T) / qs, error } : "No place is at rest";
}

const phaseOf = ([a, b, c, d]) => Math.atan2(Math.sqrt(-((a - d) ** 2) / 4 - b * c), (a + d) / 2);
const times = ([a, b, c, d], [e, f, g, h]) => [a * e + b * g, a * f + b * h, c * e + d * g, c * f + d * h];

// How far a map is from so many steps of a scheme at the h omega that comes nearest, and that h omega.
function nearest(law, steps, { entries, ratio }, momenta) {
  const at = (w) => {
    const one = matrixOf(law, { h: 1, k: w * w, m: 1, at: 0, c: 0 });
    return Array.from({ length: steps - 1 }).reduce((power) => times(power, one), one);
  };
  const off = (w) => phaseOf(at(w)) - phaseOf(entries);
  const first = phaseOf(entries) / steps;
  let [best, low] = [[Infinity, 0], first / 2];
  for (let w = low * 1.2; w < 4 * first; [low, w] = [w, w * 1.2]) {
    let [a, b, start] = [low, w, off(low)];
    if (!(start * off(w) <= 0)) continue;
    for (let i = 0; i < 60; i++) [a, b] = off((a + b) / 2) * start > 0 ? [(a + b) / 2, b] : [a, (a + b) / 2];
    const [A, B, C, D] = at(b), unit = momenta ? Math.sqrt((entries[1] * C) / (entries[2] * B)) : ratio;
    const miss = Math.max(...[A, B * unit, C / unit, D].map((x, i) => Math.abs(x - entries[i])));
    if (miss < best[0]) best = [miss, b];
  }
  return best;
}

// What is said of a file: a scheme and h omega, or why the command is to be asked.
function plainScheme(text) {
  const read = columns(text), map = typeof read === "string" ? read : mapOf(read);
  if (typeof map === "string") return { why: map };
  const held = (law, steps) => nearest(law, steps, map, read.momenta);
  const near = DATA.schemes.map(({ law }) => held(law, 1)), fits = ([miss]) => miss <= 64 * map.error;
  const which = near.findIndex(([miss]) => miss <= map.error);
  if (which < 0) return { why: "No scheme without friction takes these steps, one to a frame" };
  const others = DATA.schemes.filter(({ law }, i) => i !== which && law !== "exact");
  if (DATA.schemes[which].law === "exact" || near.filter(fits).length > 1
    || others.some(({ law }) => [2, 3, 4, 5, 6, 7, 8].some((steps) => fits(held(law, steps))))) {
    return { why: "Several schemes take these steps" };
  }
  return { ...DATA.schemes[which], turn: near[which][1], frames: read.t.length };
}

function drop() {
  const take = async (file) => {
    const { why, title, turn, frames } = plainScheme(await file.text());
    by("dropped").textContent = why ? `${why}. Use the command.`
      : `${title}, h \u03c9 = ${number(turn, 6)}: all ${frames} frames are its steps, to rounding.`;
    by("ask").textContent = `springcheck identify '${file.name.replaceAll("'", "'\\''")}'`;
  };
  const dropped = (event) => {
    event.preventDefault();
    if (event.type === "drop" && event.dataTransfer.files.length) take(event.dataTransfer.files[0]);
  };
  made(by("file"), { change: () => take(by("file").files[0]) });
  made(by("yours"), { dragover: dropped, drop: dropped });
}
