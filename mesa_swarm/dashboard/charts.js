/* Charts beside the canvas. Python sends the list (charts), the chosen ones (shown), and numbers as
   { kind: "curves", charts, looked_at, seconds } with a float32 buffer each: steps, means, and of groups of rows
   the least and the greatest of each; seconds are those of a step, null if they are not known. Numbers are acknowledged when drawn, and sent only while the page is visible.
   Before this text stands the constant PALETTE, see `script` in viewing/palette.py. */

const DASHED = [[], [5, 3], [1.5, 2.5]];
const MARGIN = { left: 38, right: 8, top: 7, bottom: 17 };

/** Round numbers that divide a range into about this number of parts. */
function ticks(low, high, parts) {
  const rough = (high - low) / parts, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough * 0.999);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9) ; k * step <= high + step * 1e-9; k++) found.push(k * step + 0);
  return found;
}

function short(value) {
  if (Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`;
  if (size >= 1e4) return `${+(value / 1e3).toPrecision(3)}k`;
  return size >= 100 || Number.isInteger(value) ? Math.round(value).toLocaleString("en") : String(+value.toPrecision(3));
}

/** One chart: its canvas, its key, what is drawn in it. */
class ChartView {
  #canvas; #values; #news = null; #data = null; #lookedAt = null; #seconds = null; #pointed = null; #fresh = true;

  constructor(title, ask) {
    const button = (kind) => make("button", { type: "button", title: `Download ${title} as ${kind.toUpperCase()}`, "aria-label": `Download ${title} as ${kind.toUpperCase()}`, click: () => ask(kind) }, kind.toUpperCase());
    this.#canvas = make("canvas", { role: "img", "aria-label": title });
    this.#values = make("ul");
    this.name = make("span", {}, title);
    const head = make("figcaption", {}, this.name, button("png"), button("csv"));
    this.element = make("figure", { class: "swarm-chart" }, head, this.#canvas, this.#values);
    this.#canvas.addEventListener("pointermove", (event) => this.#point(this.#place(event)));
    this.#canvas.addEventListener("pointerleave", () => this.#point(null));
  }

  take(news, data, lookedAt, seconds) {
    if (!this.#news || this.#news.names.join() !== news.names.join()) this.#fresh = true;
    [this.#news, this.#data, this.#lookedAt, this.#seconds] = [news, data, lookedAt, seconds ?? null];
    this.element.dataset.points = news.points;
    this.name.textContent = news.unit && news.unit !== news.title ? `${news.title}, ${news.unit}` : news.title;
    this.draw();
  }

  /** The colours of curves: of layers those of rings around robots, the last one without a layer. */
  #colours({ layers, no_layer, series }) {
    const { key, names } = this.#news;
    if (key !== "layers") return series;
    return names.map((_, k) => (k === names.length - 1 ? no_layer : layers[k % layers.length]));
  }

  #row(part, k) {
    const { points, names } = this.#news;
    const first = part === "steps" ? 0 : 1 + { mean: 0, low: 1, high: 2 }[part] * names.length + k;
    return this.#data.subarray(first * points, (first + 1) * points);
  }

  /** Return the x position in the chart, also where CSS zooms the page. */
  #place(event) {
    const { left, width } = this.#canvas.getBoundingClientRect();
    return ((event.clientX - left) * this.#canvas.clientWidth) / width;
  }

  #point(x) {
    this.#pointed = x;
    this.draw();
  }

  draw() {
    const news = this.#news, width = this.#canvas.clientWidth, height = this.#canvas.clientHeight;
    if (!news || !width) return;
    const palette = PALETTE[themeAround(this.element)], colours = this.#colours(palette);
    const ratio = (devicePixelRatio || 1) * (this.#canvas.currentCSSZoom ?? 1), context = this.#canvas.getContext("2d");
    this.#canvas.width = width * ratio;
    this.#canvas.height = height * ratio;
    context.scale(ratio, ratio);
    context.font = "11px system-ui, sans-serif";
    const place = this.#axes(context, width, height, palette);
    if (!place) return this.#showValues(colours, -1);
    news.names.forEach((_, k) => this.#curve(context, place, k, colours));
    this.#showValues(colours, this.#marks(context, place, palette));
  }

  #range() {
    const { banded, points, names } = this.#news;
    if (!points) return null;
    const steps = this.#row("steps", 0), [from, to] = banded ? ["low", "high"] : ["mean", "mean"];
    let low = Infinity, high = -Infinity;
    const few = names.length <= 3;
    names.forEach((_, k) => {
      for (const value of this.#row(few ? from : "mean", k)) if (value < low) low = value;
      for (const value of this.#row(few ? to : "mean", k)) if (value > high) high = value;
    });
    if (low > high) return null;
    if (low >= 0) low = 0;
    if (high === low) high = low + 1;
    return { x0: Math.min(steps[0], 1) - 1, x1: Math.max(steps[points - 1], 1), y0: low, y1: high };
  }

  #axes(context, width, height, palette) {
    const range = this.#range(), { left, right, top, bottom } = MARGIN;
    context.fillStyle = palette.soft;
    context.strokeStyle = palette.line;
    context.lineWidth = 1;
    if (!range) {
      context.fillText("no numbers yet", left, height / 2);
      return null;
    }
    const { x0, x1, y0 } = range, marks = ticks(y0, range.y1, 3), step = marks[1] - marks[0] || 1;
    const y1 = Math.max(range.y1, y0 + step * Math.ceil((range.y1 - y0) / step - 0.25));
    const place = {
      x: (step) => left + ((step - x0) / (x1 - x0)) * (width - left - right),
      y: (value) => height - bottom - ((value - y0) / (y1 - y0)) * (height - top - bottom),
      width, height,
    };
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.beginPath();
    for (const value of ticks(y0, y1, 3)) {
      const y = Math.round(place.y(value)) + 0.5;
      context.moveTo(left, y);
      context.lineTo(width - right, y);
      context.fillText(short(value), left - 5, y);
    }
    context.stroke();
    context.textBaseline = "alphabetic";
    const seconds = this.#seconds ?? 1;
    for (const value of ticks(x0 * seconds, x1 * seconds, 4)) {
      if (this.#seconds === null && !Number.isInteger(value)) continue;
      const text = this.#seconds === null ? short(value) : `${short(value)} s`, half = context.measureText(text).width / 2;
      context.textAlign = "center";
      context.fillText(text, Math.min(place.x(value / seconds), width - half - 1), height - 4);
    }
    return place;
  }

  #curve(context, place, k, colours) {
    const { points, names, banded } = this.#news, steps = this.#row("steps", 0), mean = this.#row("mean", k);
    const colour = colours[k % colours.length];
    if (banded && names.length <= 3) {
      const low = this.#row("low", k), high = this.#row("high", k);
      context.globalAlpha = 0.22;
      context.fillStyle = colour;
      context.beginPath();
      for (let i = 0; i < points; i++) if (!Number.isNaN(high[i])) context.lineTo(place.x(steps[i]), place.y(high[i]));
      for (let i = points - 1; i >= 0; i--) if (!Number.isNaN(low[i])) context.lineTo(place.x(steps[i]), place.y(low[i]));
      context.fill();
      context.globalAlpha = 1;
    }
    context.strokeStyle = colour;
    context.lineWidth = 1.6;
    context.setLineDash(DASHED[Math.floor(k / colours.length) % DASHED.length]);
    context.beginPath();
    let drawn = false;
    for (let i = 0; i < points; i++) {
      const known = !Number.isNaN(mean[i]);
      if (known && drawn) context.lineTo(place.x(steps[i]), place.y(mean[i]));
      else if (known) context.moveTo(points === 1 ? place.x(steps[i]) - 3 : place.x(steps[i]), place.y(mean[i]));
      if (known && points === 1) context.lineTo(place.x(steps[i]), place.y(mean[i]));
      drawn = known;
    }
    context.stroke();
    context.setLineDash([]);
  }

  /** Draw a line at the displayed step, and at the one under the pointer; return the row whose numbers are shown. */
  #marks(context, place, palette) {
    const steps = this.#row("steps", 0), line = (step, colour) => {
      const x = Math.round(place.x(step)) + 0.5;
      context.strokeStyle = colour;
      context.beginPath();
      context.moveTo(x, MARGIN.top);
      context.lineTo(x, place.height - MARGIN.bottom);
      context.stroke();
      return x;
    };
    context.lineWidth = 1.5;
    let row = steps.length - 1;
    if (this.#lookedAt !== null) {
      const x = line(this.#lookedAt, palette.selection), text = `step ${this.#lookedAt.toLocaleString("en")}`;
      context.fillStyle = palette.selection;
      context.textAlign = x > place.width / 2 ? "right" : "left";
      context.fillText(text, x + (x > place.width / 2 ? -4 : 4), MARGIN.top + 9);
      row = this.#nearest(this.#lookedAt);
    }
    if (this.#pointed !== null) {
      const inner = place.width - MARGIN.left - MARGIN.right, first = steps[0] - 1;
      const wanted = first + ((this.#pointed - MARGIN.left) / inner) * (steps[steps.length - 1] - first);
      row = this.#nearest(wanted);
      line(steps[row], palette.faint);
    }
    return row;
  }

  #nearest(step) {
    const steps = this.#row("steps", 0), after = steps.findIndex((one) => one >= step);
    return after < 0 ? steps.length - 1 : after;
  }

  /** Show the numbers of one row beside the names. */
  #showValues(colours, row) {
    const { names, points } = this.#news;
    if (this.#fresh) {
      this.#values.replaceChildren(...names.map((name) => make("li", {}, make("i"), make("span", {}, name), make("b"))));
      this.#fresh = false;
    }
    const at = row >= 0 && points ? this.#row("steps", 0)[row] : null;
    names.forEach((_, k) => {
      const item = this.#values.children[k], colour = colours[k % colours.length];
      const dash = Math.floor(k / colours.length) % DASHED.length;
      item.firstChild.style.borderTop = `3px ${["solid", "dashed", "dotted"][dash]} ${colour}`;
      item.lastChild.textContent = at === null ? "–" : short(this.#row("mean", k)[row]);
    });
    const when = at === null ? "" : `step ${at.toLocaleString("en")}${this.#seconds === null ? "" : `, ${short(at * this.#seconds)} s`}`;
    this.#values.title = at === null ? "" : `at ${when}`;
    this.#canvas.setAttribute("aria-label", at === null ? this.name.textContent
      : `${this.name.textContent}, up to ${when}: ${names.map((name, k) => `${name} ${short(this.#row("mean", k)[row])}`).join(", ")}`);
  }
}

/** All charts of a board, and the list to choose from. */
class BoardView {
  #model; #root; #views = new Map(); #choice; #stack; #downloads; #leave = [];

  constructor(model, root) {
    this.#model = model;
    this.#root = root;
    this.#downloads = new ReceivedFiles(model);
    root.classList.add("swarm-charts");
    this.#choice = make("div", {});
    this.#stack = make("div", {});
    const list = make("details", { class: "swarm-choice" }, make("summary", {}, "Choose charts"), this.#choice);
    root.append(make("div", { class: "swarm-head" }, make("h2", {}, "Charts"), list), this.#stack);
    this.#follow("charts", () => this.#build());
    this.#follow("shown", () => this.#build());
    const receive = (message, buffers) => this.#receive(message, buffers);
    model.on("msg:custom", receive);
    this.#leave.push(() => model.off("msg:custom", receive));
    const close = (event) => list.contains(event.target) || (list.open = false);
    document.addEventListener("pointerdown", close);
    this.#leave.push(() => document.removeEventListener("pointerdown", close));
    const sized = new ResizeObserver(() => this.#redraw()), seen = () => this.#look();
    sized.observe(root);
    this.#leave.push(watchTheme(root, () => this.#redraw()));
    document.addEventListener("visibilitychange", seen);
    this.#leave.push(() => (sized.disconnect(), document.removeEventListener("visibilitychange", seen)));
    this.#build();
    seen();
  }

  destroy() {
    this.#leave.forEach((leave) => leave());
  }

  #look() {
    try {
      this.#send({ do: "look", value: !document.hidden });
    } catch {
      // The page is being closed: the connection has ended.
    }
  }

  #send(message) {
    this.#model.send(message);
  }

  #follow(name, act) {
    this.#model.on(`change:${name}`, act);
    this.#leave.push(() => this.#model.off(`change:${name}`, act));
  }

  #build() {
    const charts = this.#model.get("charts"), shown = this.#model.get("shown");
    const boxes = charts.map(({ key, title }) => {
      const choose = () => this.#send({ do: "choose", value: charts.map((one) => one.key).filter((one) => (one === key ? box.checked : shown.includes(one))) });
      const box = make("input", { type: "checkbox", change: choose });
      box.checked = shown.includes(key);
      return make("label", {}, box, title);
    });
    const at = [...this.#choice.querySelectorAll("input")].indexOf(document.activeElement);
    this.#choice.replaceChildren(...boxes);
    this.#choice.querySelectorAll("input")[at]?.focus();
    const before = this.#views;
    const order = charts.filter(({ key }) => shown.includes(key));
    this.#views = new Map(order.map(({ key, title }) => [key, before.get(key) ?? new ChartView(title, (kind) => this.#send({ do: kind, value: key }))]));
    this.#stack.replaceChildren(...[...this.#views.values()].map((one) => one.element));
    if (!order.length) this.#stack.append(make("p", { class: "swarm-hint" }, "No chart is chosen."));
    this.#redraw();
  }

  #redraw() {
    this.#views.forEach((view) => view.draw());
  }

  #receive(message, buffers) {
    if (this.#downloads.receive(message, buffers) || message.kind !== "curves") return;
    message.charts.forEach((news, k) => {
      const bytes = buffers[k], data = new Uint8Array(bytes.buffer ?? bytes, bytes.byteOffset ?? 0, bytes.byteLength).slice();
      this.#views.get(news.key)?.take(news, new Float32Array(data.buffer), message.looked_at, message.seconds);
    });
    this.#root.dataset.drawn = Number(this.#root.dataset.drawn ?? 0) + 1;
    this.#send({ do: "drawn" });
  }
}

export default {
  render({ model, el }) {
    const view = new BoardView(model, el);
    return () => view.destroy();
  },
};
