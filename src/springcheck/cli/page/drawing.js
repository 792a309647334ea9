// What charts are made of: elements, lines, marks, ticks.  Looks come with the data.

const DARK = matchMedia("(prefers-color-scheme: dark)");

// An element with attributes, listeners (functions) and properties of style, and what stands in it.
function made(node, { style = {}, ...attributes }, ...children) {
  for (const [name, value] of Object.entries(style)) node.style.setProperty(name, value);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name, value);
    else node.setAttribute(name, value);
  }
  node.append(...children);
  return node;
}

const html = (name, attributes, ...children) => made(document.createElement(name), attributes, ...children);
const element = (name, attributes, ...children) =>
  made(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, ...children);
const by = (id) => document.getElementById(id);
const number = (x, digits = 3) => String(Number(x.toPrecision(Math.min(17, Math.max(1, digits)))));
const colourOf = (look) => look.colours[Number(DARK.matches)];
const shaped = (kind, d, look, more) =>
  element("path", { class: kind, d, style: { stroke: colourOf(look) }, ...more });
const marked = (d, look) => shaped("marks", d, look);
const stroked = (d, look) => shaped("curve", d, look, { "stroke-dasharray": look.dash });

// A tile of a kind: a shade of the style sheet, or a colour.
function tile(name, shade, attributes) {
  const fill = shade[0] === "#" ? shade : `var(--${/^s\d/.test(shade) ? "" : "t-"}${shade})`;
  return element(name, { class: "tile", ...attributes, style: { fill } });
}

const raised = (n) => String(n).replace("-", "\u207b").replace(/\d/g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]);

// Marks of an axis between low and high, as it draws: [place, text].
function ticks({ values, named, powers, log }, low, high) {
  const first = Math.max(0, Math.ceil(low)), last = Math.min(values.length - 1, Math.floor(high)), found = [];
  const within = ([v]) => v >= low && v <= high;
  if (powers.length && last - first > 40) return powers.filter(within).map(([v, e]) => [v, `10${raised(e)}`]);
  if (values.length) {
    const every = named ? 1 : Math.max(1, Math.ceil((last - first + 1) / 8));
    for (let i = first; i <= last; i += every) found.push([i, named ? values[i] : number(values[i])]);
  } else if (log && high - low > 1) {
    const step = Math.ceil((high - low) / 7);
    for (let e = step * Math.ceil(low / step); e <= high; e += step) found.push([e, `10${raised(e)}`]);
  } else {
    const [a, b] = log ? [10 ** low, 10 ** high] : [low, high], rough = (b - a) / 5;
    const power = 10 ** Math.floor(Math.log10(rough));
    const size = power * [1, 2, 5, 10, 20].find((f) => f * power >= rough);
    const digits = 1 + Math.ceil(Math.log10(Math.max(Math.abs(a), Math.abs(b)) / size) + 1e-9);
    for (let i = Math.ceil(a / size); i * size <= b && found.length < 50; i++) {
      found.push([log ? Math.log10(i * size) : i * size, number(i * size, Math.max(3, digits))]);
    }
  }
  return found;
}

// The part of a line from (a, b) to (c, d) inside a box around the picture; null where there is none.
function clipped(a, b, c, d, most) {
  let [from, to] = [0, 1];
  for (const [start, way] of [[a, c - a], [b, d - b]]) {
    if (!way && Math.abs(start) > most) return null;
    const ends = way ? [(-most - start) / way, (most - start) / way] : [0, 1];
    [from, to] = [Math.max(from, Math.min(...ends)), Math.min(to, Math.max(...ends))];
  }
  return from < to ? [a + from * (c - a), b + from * (d - b), a + to * (c - a), b + to * (d - b)] : null;
}
