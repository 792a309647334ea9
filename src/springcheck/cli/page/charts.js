// Charts as SVG: curves or tiles in a box, read by pointer.
// A bank is charts with one legend.  springcheck/figures/charts.py describes what is drawn.

const LINE = 12; // pixels from one name to the next below it
const CLOSE = 40; // pixels within which a pointer reads a point
const FAR = 1e4; // pixels beyond which nothing is drawn
const MIDDLE = { "text-anchor": "middle" }, END = { "text-anchor": "end" };
let clips = 0;

class Chart {
  // spec: {title, x, y, curves, tiles, rules, labels, note, equal}; `on`: the names that are drawn
  constructor(place, spec, on) {
    this.on = on;
    const read = (event) => this.readAt(event);
    this.box = html("div", { class: "plot", role: "img", pointermove: read, pointerup: read });
    this.said = html("output", { class: "reading" });
    this.caption = html("figcaption", {});
    this.figure = html("figure", {}, this.box, this.said, this.caption);
    place.append(this.figure);
    this.show(spec);
    new ResizeObserver(() => Math.abs(this.box.clientWidth - this.W) > 8 && this.draw()).observe(this.box);
  }

  show(spec) {
    const way = ({ log, factor }) => (v) => (log ? Math.log10(v > 0 ? v * factor : NaN) : v * factor);
    const [toX, toY] = (this.ways = [way(spec.x), way(spec.y)]);
    this.spec = spec;
    this.points = new Map(spec.curves.map((curve) => [curve, [curve.x.map(toX), curve.y.map(toY)]]));
    this.caption.textContent = spec.title + (spec.note ? ` ${spec.note}.` : "");
    this.draw();
  }

  seen() {
    return this.spec.curves.filter((curve) => this.on.has(curve.name));
  }

  // The picture that is shown at first, as the axes draw.
  whole() {
    return [this.spec.x, this.spec.y].flatMap(({ shown, named, values }, which) => {
      if (this.spec.tiles || (named && !shown)) return [-0.5, values.length - 0.5];
      if (shown) return shown.map(this.ways[which]);
      const found = this.seen().flatMap((curve) => this.points.get(curve)[which]).filter(Number.isFinite);
      const [low, high] = found.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [found[0], found[0]]);
      const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
      return found.length ? [low - room, high + room] : [-1, 1];
    });
  }

  draw() {
    const { spec } = this, R = 12, T = 12, W = Math.max(280, this.box.clientWidth || 440);
    // names and numbers are written in full: at the left, and names upwards below
    const all = this.whole(), beyond = (texts, n) => Math.max(0, ...texts.map((text) => text.length - n));
    const L = 62 + 7 * beyond(ticks(spec.y, ...all.slice(2)).map(([, text]) => text), 4);
    const B = 46 + 7.4 * beyond(spec.x.named ? spec.x.values : [], 2);
    const usual = Math.min(420, Math.max(260, Math.round(W * 0.72)));
    const H = spec.y.named ? (all[3] - all[2]) * 14 + T + B : usual;
    const across = W - L - R, up = H - T - B;
    let [x0, x1, y0, y1] = all, [sx, sy] = [across / (x1 - x0), up / (y1 - y0)];
    if (spec.equal) {
      sx = sy = Math.min(sx, sy);
      [x0, y0] = [(x0 + x1 - across / sx) / 2, (y0 + y1 - up / sy) / 2];
      [x1, y1] = [x0 + across / sx, y0 + up / sy];
    }
    const x = (this.px = (v) => L + (v - x0) * sx), y = (this.py = (v) => H - B - (v - y0) * sy);
    Object.assign(this, { W, H, fromX: (v) => x0 + (v - L) / sx, fromY: (v) => y0 + (H - B - v) / sy });
    const clip = `clip${clips++}`, box = { x: L, y: T, width: across, height: up };
    const root = element("svg", { viewBox: `0 0 ${W} ${H}`, "aria-hidden": "true" });
    const inside = element("g", { "clip-path": `url(#${clip})` });
    const [down, over] = [(v) => `M${x(v)} ${T}V${H - B}`, (v) => `M${L} ${y(v)}H${W - R}`];
    const line = (axis, v, look) => element("path", { class: look, d: axis === "x" ? down(v) : over(v) });
    const under = (v) => (!spec.x.named ? { x: x(v), y: H - B + 17, ...MIDDLE }
      : { transform: `translate(${x(v) + 4} ${H - B + 6}) rotate(-90)`, ...END });
    const beside = (v) => ({ x: L - 6, y: y(v) + 4, ...END });
    for (const [axis, low, high, place] of [["x", x0, x1, under], ["y", y0, y1, beside]]) {
      for (const [v, text] of ticks(spec[axis], low, high)) {
        if (!spec.tiles) root.prepend(line(axis, v, "grid"));
        root.append(element("text", place(v), text));
      }
    }
    root.append(element("clipPath", { id: clip }, element("rect", box)));
    if (spec.tiles) this.tiles(inside, x, y);
    let [beneath, above, texts] = [T + 11, -99, []];
    for (const { axis, at, name, look } of spec.rules) {
      const v = this.ways["xy".indexOf(axis)](at), [left, more] = look === "one" ? [L + 5] : [W - R - 5, END];
      const high = y(v) + (y(v) < T + 16 ? 14 : -5);
      const place = axis === "x" ? { x: x(v) + 5, y: beneath } : { x: left, y: high, ...more };
      if (axis === "x") beneath = T + 11 + ((beneath - T - 11 + LINE) % (4 * LINE));
      inside.append(line(axis, v, look || "limit"));
      texts.push(element("text", place, name));
    }
    for (const curve of this.seen()) this.curve(inside, curve, x, y);
    inside.append(...texts);
    const fills = new Map(this.seen().map(({ group, look }) => [group, colourOf(look)])), [a, b, c, d] = all;
    for (const one of spec.labels.filter(({ group }) => fills.has(group)).sort((p, q) => q.y - p.y)) {
      const style = { "--of": fills.get(one.group) }, [off, more] = one.x > 0.6 ? [-4, END] : [4, {}];
      // those beside the axes are pushed down from the edge, each below the one above it
      above = Math.max(T + 9, y(c + one.y * (d - c)) - 4, one.x === 1 ? above + LINE : 0);
      const place = { x: x(a + one.x * (b - a)) + off, y: above };
      inside.append(element("text", { class: "name", ...place, ...more, style }, one.text));
    }
    this.ring = element("circle", { class: "ring", r: 6, cx: -99, cy: -99 });
    inside.append(this.ring);
    const below = { x: (L + W - R) / 2, y: H - 8, ...MIDDLE };
    root.append(inside, element("rect", { class: "frame", ...box }), element("text", below, spec.x.name),
      element("text", { transform: `translate(14 ${(T + H - B) / 2}) rotate(-90)`, ...MIDDLE }, spec.y.name));
    this.box.replaceChildren(root);
    // what is written stays inside, that of a line at the edge too
    for (const text of root.querySelectorAll("text:not([transform])")) {
      const at = text.getBBox(), [low, high] = inside.contains(text) ? [L, W - R] : [0, W];
      const off = Math.max(0, low - at.x) + Math.min(0, high - at.x - at.width);
      if (at.x < high + 6 && at.x + at.width > low) made(text, { x: Number(text.getAttribute("x")) + off });
    }
    const names = spec.tiles ? "all tiles" : this.seen().map((curve) => curve.name).join(", ") || "nothing";
    this.box.setAttribute("aria-label", `${spec.title} ${spec.y.name} over ${spec.x.name}. Shown: ${names}.`);
  }

  curve(inside, curve, x, y) {
    const [us, vs] = this.points.get(curve), n = us.length;
    // of a line some points have marks, of dots all
    const all = curve.dots || (curve.marks && (!curve.line || n < 60));
    const every = all ? 1 : curve.marks ? Math.ceil(n / 14) : Infinity;
    let [path, marks, last, ended] = ["", "", null, null];
    for (let i = 0; i < n; i++) {
      const here = Number.isFinite(us[i]) && Number.isFinite(vs[i]) ? [x(us[i]), y(vs[i])] : null;
      const part = here && last && curve.line && clipped(...last, ...here, FAR);
      if (part) {
        const [a, b, c, d] = part.map((v) => v.toFixed(2));
        path += `${ended === `${a} ${b}` ? "" : `M${a} ${b}`}L${c} ${d}`;
        ended = `${c} ${d}`;
      }
      const near = here && every < Infinity && i % every === 0 && Math.max(...here.map(Math.abs)) < FAR;
      if (near) marks += `M${here.map((v) => v.toFixed(2)).join(" ")}${curve.look.mark}`;
      last = here;
    }
    if (path) inside.append(stroked(path, curve.look));
    if (marks) inside.append(marked(marks, curve.look));
  }

  tiles(inside, x, y) {
    const { rows, kinds } = this.spec.tiles, paths = kinds.map(() => "");
    const wide = x(1) - x(0), high = y(0) - y(1);
    rows.forEach((row, j) => {
      let i = 0;
      for (const [count, kind] of row) {
        const [left, top, size] = [x(i) - wide / 2, y(j) - high / 2, count * wide].map((v) => v.toFixed(2));
        if (kind >= 0) paths[kind] += `M${left} ${top}h${size}v${high.toFixed(2)}h-${size}z`;
        i += count;
      }
    });
    const crisp = { "shape-rendering": "crispEdges" };
    inside.append(...kinds.map(([, shade], kind) => tile("path", shade, { ...crisp, d: paths[kind] })));
  }

  say(text, x, y) {
    this.said.textContent = text;
    made(this.ring, { cx: text ? this.px(x) : -99, cy: text ? this.py(y) : -99 });
  }

  readPoint(curve, i) {
    const { x, y } = this.spec, [us, vs] = this.points.get(curve);
    const note = curve.notes && curve.notes[i] ? `; ${curve.notes[i]}` : "";
    const value = y.named ? y.values[curve.y[i]] : curve.y[i] * y.factor;
    this.say(`${curve.name}: ${x.name} ${curve.x[i] * x.factor}, ${y.name} ${value}${note}`, us[i], vs[i]);
  }

  readTile(i, j) {
    const { x, y, tiles } = this.spec;
    if (!(i >= 0 && i < x.values.length && j >= 0 && j < y.values.length)) return this.say("");
    let left = i;
    const [, kind] = tiles.rows[j].find(([count]) => (left -= count) < 0) || [0, -1];
    const note = tiles.texts[tiles.notes.length ? tiles.notes[j][i] : -1];
    const said = [kind < 0 ? "not tried" : tiles.kinds[kind][0], ...(note ? [note] : [])].join("; ");
    this.say(`${x.name} ${x.values[i]}, ${y.name} ${y.values[j]}: ${said}`, i, j);
  }

  read(u, v) {
    if (this.spec.tiles) return this.readTile(Math.round(this.fromX(u)), Math.round(this.fromY(v)));
    let [best, found] = [CLOSE, null];
    for (const curve of this.seen()) {
      const [us, vs] = this.points.get(curve);
      for (let i = 0; i < us.length; i++) {
        const d = Math.hypot(this.px(us[i]) - u, this.py(vs[i]) - v);
        if (d < best) [best, found] = [d, [curve, i]];
      }
    }
    if (found) this.readPoint(...found);
    else this.say("");
  }

  readAt({ clientX, clientY }) {
    const { left, top, width, height } = this.box.getBoundingClientRect();
    this.read(((clientX - left) * this.W) / width, ((clientY - top) * this.H) / height);
  }
}

// Charts with one legend: a box for each curve, or for each chart of tiles.
class Bank {
  constructor(place, bank) {
    // columns that are named need the width of the page
    const wide = bank.charts.length === 1 || bank.charts.some((chart) => chart.x.named);
    const on = new Set(bank.on), grid = html("div", { class: wide ? "one" : "pair" });
    const legend = html("fieldset", {}, html("legend", {}, bank.title));
    const add = (name, drawn, title, change) => {
      const box = html("input", { type: "checkbox" });
      made(box, { change: () => change(on[box.checked ? "add" : "delete"](name)) });
      box.checked = on.has(name);
      legend.append(html("label", { title }, box, ...drawn, name));
    };
    place.append(legend, grid);
    this.charts = bank.charts.map((chart) => new Chart(grid, chart, on));
    const size = { width: 16, height: 16, "aria-hidden": "true" };
    const tiled = this.charts.filter((chart) => chart.spec.tiles);
    for (const { figure, spec } of tiled) {
      add(spec.title, [], "", () => (figure.hidden = !on.has(spec.title)));
      figure.hidden = !on.has(spec.title);
    }
    const kinds = new Map(tiled.flatMap((chart) => chart.spec.tiles.kinds));
    const key = ([name, shade]) => html("span", {}, element("svg", size, tile("rect", shade, size)), name);
    if (tiled.length) grid.before(html("div", { class: "legend" }, ...[...kinds].map(key)));
    const all = bank.charts.flatMap((chart) => chart.curves);
    const isFirst = (curve) => all.find(({ name }) => name === curve.name) === curve;
    for (const { name, look, line, marks, title, group } of all.filter(isFirst)) {
      const sample = element("svg", { ...size, width: 30, height: 12 });
      if (line) sample.append(stroked("M0 6H30", look));
      if (marks) sample.append(marked(`M15 6${look.mark}`, look));
      add(name, [sample], title || group, () => this.charts.forEach((chart) => chart.draw()));
    }
  }
}
