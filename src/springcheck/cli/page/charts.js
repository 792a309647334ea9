"use strict";
// Charts as SVG: curves or tiles in a box, read by pointer or arrow keys, zoomed by dragging or + and -.
// A bank is charts with one legend.  What is drawn is described in springcheck/figures/charts.py.

let clips = 0;

class Chart {
  // spec: {title, x, y, curves, tiles, rules, labels, note, equal}; `looks` of its curves by name, `isOn` of a name
  constructor(place, spec, looks, isOn) {
    Object.assign(this, { spec, looks, isOn, view: null, at: null, dots: [] });
    const figure = html("figure"), caption = html("figcaption", spec.title), tools = html("div");
    this.box = html("div");
    this.box.className = "plot";
    this.box.tabIndex = 0;
    this.box.setAttribute("role", "application");
    this.box.setAttribute("aria-roledescription", "chart");
    this.note = html("span");
    caption.append(this.note);
    this.said = html("output", "\u00a0");
    this.said.className = "reading";
    tools.className = "tools";
    for (const [sign, name, act] of [
      ["+", "zoom in", () => this.zoom(0.5)], ["\u2212", "zoom out", () => this.zoom(2)], ["\u25a1", "the whole picture", () => this.look(null)],
    ]) {
      const button = html("button", sign);
      button.type = "button";
      button.title = name;
      button.setAttribute("aria-label", `${name}: ${spec.title}`);
      button.addEventListener("click", act);
      tools.append(button);
    }
    tools.append(this.said);
    figure.append(this.box, tools, caption);
    place.append(figure);
    this.figure = figure;
    this.prepare();
    this.listen();
    new ResizeObserver(() => {
      if (Math.abs(this.box.clientWidth - this.W) > 8) this.draw();
    }).observe(this.box);
  }

  show(spec) {
    this.spec = spec;
    this.prepare();
    this.draw();
  }

  prepare() {
    const way = ({ log, factor }) => (log ? (v) => (v > 0 ? Math.log10(v * factor) : NaN) : (v) => v * factor);
    const [toX, toY] = [way(this.spec.x), way(this.spec.y)];
    this.points = new Map(this.spec.curves.map((curve) => [curve, [curve.x.map(toX), curve.y.map(toY)]]));
  }

  seen() {
    return this.spec.curves.filter((curve) => this.isOn(curve.name));
  }

  // The picture that is shown at first, as the axes draw.
  whole() {
    const { x, y, tiles } = this.spec;
    if (tiles) return [-0.5, x.values.length - 0.5, -0.5, y.values.length - 0.5];
    const span = (which, { shown, log, factor, named, values }) => {
      if (named) return [-0.5, values.length - 0.5];
      if (shown) return shown.map((v) => (log ? Math.log10(v * factor) : v * factor));
      let [low, high] = [Infinity, -Infinity];
      for (const curve of this.seen()) {
        for (const v of this.points.get(curve)[which]) {
          if (Number.isFinite(v)) [low, high] = [Math.min(low, v), Math.max(high, v)];
        }
      }
      if (!(low <= high)) [low, high] = [-1, 1];
      const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
      return [low - room, high + room];
    };
    return [...span(0, x), ...span(1, y)];
  }

  look(view) {
    this.view = view;
    this.draw();
  }

  zoom(factor) {
    const [a, b, c, d] = this.view || this.whole();
    const at = this.at && this.at.x >= a && this.at.x <= b && this.at.y >= c && this.at.y <= d ? this.at : { x: (a + b) / 2, y: (c + d) / 2 };
    const view = [at.x + (a - at.x) * factor, at.x + (b - at.x) * factor, at.y + (c - at.y) * factor, at.y + (d - at.y) * factor];
    // beyond 12 digits doubles have no neighbours to show
    if (view[1] - view[0] > 1e-12 * Math.max(1, Math.abs(view[0])) && view[3] - view[2] > 1e-12 * Math.max(1e-3, Math.abs(view[2]))) this.look(view);
  }

  draw() {
    const { spec } = this, wordy = (scale) => (scale.named ? Math.max(...scale.values.map((v) => v.length)) : 0);
    // names are written in full: at the left, and upwards below
    const L = 62 + 6.8 * Math.max(0, wordy(spec.y) - 5), R = 12, T = 12, B = 46 + 7.4 * Math.max(0, wordy(spec.x) - 2);
    const W = (this.W = Math.max(280, this.box.clientWidth || 440));
    const tall = spec.y.named ? spec.y.values.length * 14 + T + B : Math.min(420, Math.max(260, Math.round(W * 0.72)));
    const H = (this.H = tall);
    let [x0, x1, y0, y1] = this.view || this.whole();
    let sx = (W - L - R) / (x1 - x0), sy = (H - T - B) / (y1 - y0);
    if (spec.equal) {
      const both = Math.min(sx, sy), wide = (W - L - R) / both, high = (H - T - B) / both;
      [x0, x1, y0, y1] = [(x0 + x1 - wide) / 2, (x0 + x1 + wide) / 2, (y0 + y1 - high) / 2, (y0 + y1 + high) / 2];
      sx = sy = both;
    }
    const x = (v) => L + (v - x0) * sx, y = (v) => H - B - (v - y0) * sy;
    Object.assign(this, { px: x, py: y, fromX: (v) => x0 + (v - L) / sx, fromY: (v) => y0 + (H - B - v) / sy });
    const root = element("svg", { viewBox: `0 0 ${W} ${H}`, "aria-hidden": "true" });
    for (const [v, text] of ticks(spec.x, x0, x1)) {
      if (!spec.tiles) root.append(element("line", { class: "grid", x1: x(v), x2: x(v), y1: T, y2: H - B }));
      const under = { x: x(v), y: H - B + 17, "text-anchor": "middle" };
      const upright = { transform: `translate(${x(v) + 4} ${H - B + 6}) rotate(-90)`, "text-anchor": "end" };
      root.append(element("text", spec.x.named ? upright : under, text));
    }
    for (const [v, text] of ticks(spec.y, y0, y1)) {
      if (!spec.tiles) root.append(element("line", { class: "grid", x1: L, x2: W - R, y1: y(v), y2: y(v) }));
      root.append(element("text", { x: L - 6, y: y(v) + 4, "text-anchor": "end" }, text));
    }
    const clip = `clip${clips++}`, box = { x: L, y: T, width: W - L - R, height: H - T - B };
    root.append(element("clipPath", { id: clip }, element("rect", box)));
    const inside = element("g", { "clip-path": `url(#${clip})` });
    if (spec.tiles) this.tiles(inside, x, y);
    for (const { axis, at, name, look } of spec.rules) {
      const v = spec[axis].log ? Math.log10(at * spec[axis].factor) : at * spec[axis].factor;
      const ends = axis === "x" ? { x1: x(v), x2: x(v), y1: T, y2: H - B } : { x1: L, x2: W - R, y1: y(v), y2: y(v) };
      inside.append(element("line", { class: look || "limit", ...ends }));
      inside.append(element("text", axis === "x" ? { x: x(v) + 5, y: T + 14 } : { x: W - R - 5, y: y(v) - 5, "text-anchor": "end" }, name));
    }
    for (const curve of this.seen()) this.curve(inside, curve, x, y);
    const groups = new Set(this.seen().map((curve) => curve.group)), [a, b, c, d] = this.whole();
    for (const { text, group, x: u, y: v } of spec.labels.filter((one) => groups.has(one.group))) {
      const place = { x: x(a + u * (b - a)) + (u > 0.6 ? -4 : 4), y: y(c + v * (d - c)) - 4, "text-anchor": u > 0.6 ? "end" : "start" };
      const name = element("text", { class: "name", ...place }, text);
      name.style.fill = lookOf(group, 0).colour;
      inside.append(name);
    }
    this.ring = element("circle", { class: "ring", r: 6, cx: -99, cy: -99 });
    this.frame = element("rect", { class: "drag", width: 0, height: 0 });
    inside.append(this.ring, this.frame);
    root.append(inside, element("rect", { class: "frame", ...box }));
    // a long name stays inside
    root.append(element("text", { x: Math.min((L + W - R) / 2, W - 3.6 * spec.x.name.length), y: H - 8, "text-anchor": "middle" }, spec.x.name));
    root.append(element("text", { transform: `translate(14 ${(T + H - B) / 2}) rotate(-90)`, "text-anchor": "middle" }, spec.y.name));
    this.box.replaceChildren(root);
    const names = spec.tiles ? "" : ` Shown: ${this.seen().map((curve) => curve.name).join(", ") || "nothing"}.`;
    this.box.setAttribute("aria-label", `${spec.title} ${spec.y.name} over ${spec.x.name}.${names} Arrow keys read it, plus and minus zoom, 0 shows all.`);
    this.note.textContent = spec.note ? ` ${spec.note}.` : "";
  }

  curve(inside, curve, x, y) {
    const [us, vs] = this.points.get(curve), look = this.looks(curve.name);
    // of a line some points have marks, of dots all
    const apart = curve.dots || (curve.marks && (!curve.line || us.length < 60)) ? 1 : curve.marks ? Math.ceil(us.length / 14) : Infinity;
    let path = "", marks = "", last = null, ended = null;
    for (let i = 0; i < us.length; i++) {
      const here = Number.isFinite(us[i]) && Number.isFinite(vs[i]) ? [x(us[i]), y(vs[i])] : null;
      if (here && last && curve.line) {
        const part = clipped(...last, ...here, 1e4);
        if (part) {
          const [a, b, c, d] = part.map((v) => v.toFixed(2));
          path += `${ended === `${a} ${b}` ? "" : `M${a} ${b}`}L${c} ${d}`;
          ended = `${c} ${d}`;
        }
      }
      if (here && i % apart === 0 && Math.abs(here[0]) < 1e4 && Math.abs(here[1]) < 1e4) marks += look.shape(here[0], here[1]);
      last = here;
    }
    if (path) inside.append(stroked(path, look));
    if (marks) inside.append(marked(marks, look));
  }

  tiles(inside, x, y) {
    const { rows, kinds } = this.spec.tiles;
    const wide = x(1) - x(0), high = y(0) - y(1);
    const paths = kinds.map(() => "");
    rows.forEach((row, j) => {
      let i = 0;
      for (const [count, kind] of row) {
        if (kind >= 0) paths[kind] += `M${(x(i) - wide / 2).toFixed(2)} ${(y(j) - high / 2).toFixed(2)}h${(count * wide).toFixed(2)}v${high.toFixed(2)}h${(-count * wide).toFixed(2)}z`;
        i += count;
      }
    });
    kinds.forEach(([, shade], kind) => {
      if (paths[kind]) inside.append(tile("path", shade, { d: paths[kind], "shape-rendering": "crispEdges" }));
    });
  }

  // reading

  say(text, x, y) {
    this.said.textContent = text || "\u00a0";
    this.at = text ? { x, y } : null;
    this.ring.setAttribute("cx", text ? this.px(x) : -99);
    this.ring.setAttribute("cy", text ? this.py(y) : -99);
  }

  readPoint(curve, i) {
    const { x, y } = this.spec, [us, vs] = this.points.get(curve);
    this.where = { curve, i };
    const note = curve.notes && curve.notes[i] ? `; ${curve.notes[i]}` : "";
    this.say(`${curve.name}: ${x.name} ${curve.x[i] * x.factor}, ${y.name} ${y.named ? y.values[curve.y[i]] : curve.y[i] * y.factor}${note}`, us[i], vs[i]);
  }

  readTile(i, j) {
    const { x, y, tiles } = this.spec;
    if (!(i >= 0 && i < x.values.length && j >= 0 && j < y.values.length)) return this.say("");
    let left = i, kind = -1;
    for (const [count, what] of tiles.rows[j]) {
      if (left < count) {
        kind = what;
        break;
      }
      left -= count;
    }
    this.where = { i, j };
    const note = tiles.notes.length ? tiles.notes[j][i] : -1;
    const more = note >= 0 ? `; ${tiles.texts[note]}` : "";
    this.say(`${x.name} ${x.values[i]}, ${y.name} ${y.values[j]}: ${kind < 0 ? "not tried" : tiles.kinds[kind][0]}${more}`, i, j);
  }

  read(u, v) {
    if (this.spec.tiles) return this.readTile(Math.round(this.fromX(u)), Math.round(this.fromY(v)));
    let best = CLOSE ** 2, found = null;
    for (const curve of this.seen()) {
      const [us, vs] = this.points.get(curve);
      for (let i = 0; i < us.length; i++) {
        const d = (this.px(us[i]) - u) ** 2 + (this.py(vs[i]) - v) ** 2;
        if (d < best) [best, found] = [d, [curve, i]];
      }
    }
    if (found) this.readPoint(...found);
    else this.say("");
  }

  step(dx, dy) {
    if (this.spec.tiles) {
      const { i, j } = this.where || { i: 0, j: 0 };
      return this.readTile(
        Math.min(this.spec.x.values.length - 1, Math.max(0, i + dx)),
        Math.min(this.spec.y.values.length - 1, Math.max(0, j + dy)),
      );
    }
    const curves = this.seen();
    if (!curves.length) return;
    let { curve, i } = this.where || { curve: curves[0], i: -1 };
    if (!curves.includes(curve)) curve = curves[0];
    curve = curves[(curves.indexOf(curve) - dy + curves.length) % curves.length];
    const last = curve.x.length - 1;
    do {
      i += dx || 1;
    } while (dx && i > 0 && i < last && !Number.isFinite(this.points.get(curve)[1][i]));
    if (!dx) i -= 1;
    this.readPoint(curve, Math.min(last, Math.max(0, i)));
  }

  listen() {
    const place = (event) => {
      const box = this.box.getBoundingClientRect();
      return [((event.clientX - box.left) * this.W) / box.width, ((event.clientY - box.top) * this.H) / box.height];
    };
    let from = null;
    this.box.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "touch" || event.button) return;
      from = place(event);
      this.box.setPointerCapture(event.pointerId);
    });
    this.box.addEventListener("pointermove", (event) => {
      const [u, v] = place(event);
      if (!from) return this.read(u, v);
      const size = { x: Math.min(u, from[0]), y: Math.min(v, from[1]), width: Math.abs(u - from[0]), height: Math.abs(v - from[1]) };
      for (const [key, value] of Object.entries(size)) this.frame.setAttribute(key, value);
    });
    this.box.addEventListener("pointerup", (event) => {
      if (!from) return this.read(...place(event));
      const [a, b] = from, [c, d] = place(event);
      from = null;
      if (Math.abs(a - c) > 8 && Math.abs(b - d) > 8) {
        this.look([this.fromX(Math.min(a, c)), this.fromX(Math.max(a, c)), this.fromY(Math.max(b, d)), this.fromY(Math.min(b, d))]);
      } else this.draw();
    });
    this.box.addEventListener("pointercancel", () => (from = null));
    this.box.addEventListener("dblclick", () => this.look(null));
    this.box.addEventListener("keydown", (event) => {
      const acts = {
        ArrowRight: () => this.step(1, 0), ArrowLeft: () => this.step(-1, 0), ArrowUp: () => this.step(0, 1), ArrowDown: () => this.step(0, -1),
        "+": () => this.zoom(0.5), "=": () => this.zoom(0.5), "-": () => this.zoom(2), 0: () => this.look(null), Escape: () => this.look(null),
      };
      if (!Object.hasOwn(acts, event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      acts[event.key]();
    });
  }
}

// Charts with one legend: a box for each curve, or for each chart where charts are tiles.
class Bank {
  constructor(place, bank) {
    this.on = new Set(bank.on);
    this.looks = new Map();
    const counts = new Map(), kinds = new Map(), all = bank.charts.flatMap((chart) => chart.curves);
    const tiled = bank.charts.some((chart) => chart.tiles);
    for (const curve of all) {
      if (this.looks.has(curve.name)) continue;
      // a theory's line and the marks on it are of one look
      const key = `${curve.group} ${curve.line}`, count = counts.get(key) || 0;
      counts.set(key, count + 1);
      this.looks.set(curve.name, { ...lookOf(curve.group, count), line: curve.line, marks: curve.marks });
    }
    const legend = html("fieldset"), boxes = [];
    legend.append(html("legend", bank.title));
    const add = (name, drawn, title, act) => {
      const label = html("label"), box = html("input");
      box.type = "checkbox";
      box.checked = this.on.has(name);
      box.addEventListener("change", () => {
        this.on[box.checked ? "add" : "delete"](name);
        act(box.checked);
      });
      if (title) label.title = title;
      boxes.push(box);
      label.append(box, ...drawn, name);
      legend.append(label);
    };
    const grid = html("div");
    grid.className = bank.charts.length > 1 ? "pair" : "one";
    place.append(legend, grid);
    this.charts = bank.charts.map((chart) => new Chart(grid, chart, (name) => this.looks.get(name), (name) => this.on.has(name)));
    if (tiled) {
      this.charts.forEach((chart) => add(chart.spec.title, [], "", (on) => (chart.figure.hidden = !on)));
      this.charts.forEach((chart) => (chart.figure.hidden = !this.on.has(chart.spec.title)));
      for (const chart of bank.charts) for (const kind of chart.tiles.kinds) kinds.set(...kind);
      const key = html("div");
      key.className = "legend";
      for (const [name, shade] of kinds) {
        const one = html("span"), box = element("svg", { width: 16, height: 16, "aria-hidden": "true" });
        box.append(tile("rect", shade, { width: 16, height: 16 }));
        one.append(box, name);
        key.append(one);
      }
      place.insertBefore(key, grid);
    } else {
      const titles = new Map(all.map((curve) => [curve.name, curve.title]));
      for (const [name, look] of this.looks) add(name, [sample(look, look)], titles.get(name), () => this.draw());
    }
    if (boxes.length > 2) {
      for (const [text, on] of [["all", true], ["none", false]]) {
        const button = html("button", text);
        button.type = "button";
        button.addEventListener("click", () => {
          for (const box of boxes) {
            if (box.checked !== on) box.click();
          }
        });
        legend.append(button);
      }
    }
    this.draw();
  }

  draw() {
    for (const chart of this.charts) chart.draw();
  }
}
