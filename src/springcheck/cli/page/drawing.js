"use strict";
// What charts are made of: elements of SVG, colours and dashes, ticks, ranges.

const SVG = "http://www.w3.org/2000/svg";
const DARK = matchMedia("(prefers-color-scheme: dark)");
// in the order of the lines of springcheck/figures/looks.py
const DASHES = ["", "7 4", "2 3", "9 3 2 3", "14 4", "9 3 2 3 2 3", "2 6"];
const SHAPES = [
  (x, y) => `M${x - 3} ${y}a3 3 0 1 0 6 0a3 3 0 1 0-6 0`,
  (x, y) => `M${x - 3} ${y - 3}h6v6h-6z`,
  (x, y) => `M${x} ${y - 4}l4 7h-8z`,
  (x, y) => `M${x} ${y - 4}l4 4l-4 4l-4-4z`,
  (x, y) => `M${x - 3} ${y - 3}l6 6m0-6l-6 6`,
];
const TICKS = 5;
const CLOSE = 40; // pixels within which a pointer reads a point

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

function number(x, digits = 3) {
  return String(Number(x.toPrecision(Math.min(17, Math.max(1, digits)))));
}

// Schemes in the order in which they are drawn: on paper, where all are black, their dashes differ by it.
const GROUPS = [];

function groupOf(name) {
  if (!GROUPS.includes(name)) GROUPS.push(name);
  return GROUPS.indexOf(name);
}

// Dashes of what is no scheme's.
const PLAIN_LOOKS = { exact: "1 5", separatrix: "3 3", guide: "", beginning: "" };

// Colour, dash, mark and dash on paper of the count-th curve of a group; colour and dash are those of figures.
function lookOf(group, count) {
  if (group in PLAIN_LOOKS) return { shape: SHAPES[4], colour: "var(--soft)", dash: PLAIN_LOOKS[group], printed: PLAIN_LOOKS[group] };
  const which = groupOf(group), [light, dark, line] = DATA.looks[group];
  return {
    colour: DARK.matches ? dark : light,
    dash: DASHES[(line + count) % DASHES.length],
    printed: DASHES[(which + count) % DASHES.length],
    shape: SHAPES[(which + count) % SHAPES.length],
  };
}

function stroked(d, { colour, dash, printed }) {
  const line = element("path", { class: "curve", d, "stroke-dasharray": dash });
  line.style.stroke = colour;
  line.style.setProperty("--printed", printed || "none");
  return line;
}

function marked(d, { colour }) {
  const marks = element("path", { class: "marks", d });
  marks.style.stroke = colour;
  return marks;
}

// A tile of a kind: a shade of the style sheet, or a colour.
function tile(name, shade, attributes) {
  const made = element(name, { class: "tile", ...attributes });
  made.style.fill = shade[0] === "#" ? shade : `var(--${/^s\d/.test(shade) ? "" : "t-"}${shade})`;
  return made;
}

function sample(look, { line = true, marks = false } = {}) {
  const root = element("svg", { width: 30, height: 12, "aria-hidden": "true" });
  if (line) root.append(stroked("M0 6H30", look));
  if (marks) root.append(marked(look.shape(15, 6), look));
  return root;
}

// Round numbers within [low, high], and their distance.
function rounds(low, high) {
  const rough = (high - low) / TICKS, power = 10 ** Math.floor(Math.log10(rough));
  const size = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= rough) || 10 * power;
  const found = [];
  for (let i = Math.ceil(low / size); i * size <= high && found.length < 50; i++) found.push(i * size);
  return [found, size];
}

function powerOfTen(exponent) {
  return "10" + [...String(exponent)].map((c) => (c === "-" ? "\u207b" : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[c])).join("");
}

// Marks of an axis between low and high, as it draws: [place, text].
function ticks(scale, low, high) {
  const { values, log } = scale;
  if (values.length) {
    if (scale.named) return values.map((text, i) => [i, text]).filter(([i]) => i >= low && i <= high);
    const first = Math.max(0, Math.ceil(low)), last = Math.min(values.length - 1, Math.floor(high));
    const every = Math.max(1, Math.ceil((last - first + 1) / 8)), found = [];
    // many values in even ratios: a logarithmic axis, marked at powers of ten
    const ratio = Math.log10(values[1] / values[0]), most = values.length - 1;
    const even = Math.abs(Math.log10(values[most] / values[0]) / (most * ratio) - 1) < 1e-6;
    if (even && last - first > 40) {
      const start = Math.log10(values[0]);
      return ticks({ values: [], log: true }, start + low * ratio, start + high * ratio).map(([v, text]) => [(v - start) / ratio, text]);
    }
    for (let i = first; i <= last; i += every) found.push([i, number(values[i])]);
    return found;
  }
  if (log && high - low > 1) {
    const step = Math.ceil((high - low) / 7), found = [];
    for (let e = Math.ceil(low); e <= high; e++) if (e % step === 0) found.push([e, powerOfTen(e)]);
    return found;
  }
  const [a, b] = log ? [10 ** low, 10 ** high] : [low, high];
  const [found, size] = rounds(a, b);
  const digits = 1 + Math.ceil(Math.log10(Math.max(Math.abs(a), Math.abs(b)) / size) + 1e-9);
  return found.map((v) => [log ? Math.log10(v) : v, number(v, Math.max(3, digits))]);
}

// The part of a line from (a, b) to (c, d) inside a box around the picture; null where there is none.
function clipped(a, b, c, d, most) {
  let from = 0, to = 1;
  for (const [start, way] of [[a, c - a], [b, d - b]]) {
    if (way === 0) {
      if (Math.abs(start) > most) return null;
      continue;
    }
    const [u, v] = [(-most - start) / way, (most - start) / way];
    from = Math.max(from, Math.min(u, v));
    to = Math.min(to, Math.max(u, v));
  }
  return from < to ? [a + from * (c - a), b + from * (d - b), a + to * (c - a), b + to * (d - b)] : null;
}
