/* Charts beside the canvas. Python sends what can be shown (choices) and what is shown (shown), and numbers as
   { kind: "curves", charts, looked_at, seconds }, for each chart with a float64 buffer of arrays of the given lengths:
   over time   first and last steps of groups of rows, their means, and of groups the least and greatest numbers;
   histogram   edges and counts;
   phase plot  steps, and the places of points on both axes.
   A chart's `row` is the exact row of the last or displayed step; seconds are those of a step, null if they are not
   known. Numbers are acknowledged when drawn, and sent only while the page is visible.
   Before this text stands the constant PALETTE, see `script` in viewing/palette.py. */

const DASHED = [[], [5, 3], [1.5, 2.5]];
const MARGIN = { left: 40, right: 9, top: 22 };
// Below: numbers, and in charts of long names these in a line of their own.
const BOTTOM = { "over time": 17, histogram: 31, "phase plot": 31 };
const KINDS = ["over time", "histogram", "phase plot"];
const LOG_AXES = { "over time": ["y"], histogram: ["x"], "phase plot": ["x", "y"] };
// Of values at the pointer; others are in the key.
const MOST_READ = 8;

/** Powers of ten, where there are few of them also 2 and 5 times as much, at most six in all. */
function logTicks(low, high) {
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high)), found = [];
  const factors = last - first > 2 ? [1] : [1, 2, 5], skip = Math.max(1, Math.ceil((last - first) / 6));
  for (let k = first; k <= last; k += skip) for (const factor of factors) found.push(factor * 10 ** k);
  return found.filter((one) => one >= low * 0.999 && one <= high * 1.001);
}

function short(value) {
  if (value === null || Number.isNaN(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1e9) return value.toExponential(1);
  if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`;
  if (size >= 1e4) return `${+(value / 1e3).toPrecision(3)}k`;
  return size >= 100 || Number.isInteger(value) ? Math.round(value).toLocaleString("en") : String(+value.toPrecision(3));
}

const counted = (step) => step.toLocaleString("en");

/** Map a range of values to pixels, linearly or by logarithms. */
function scaleOf(low, high, log, from, to) {
  const along = log ? Math.log10 : (value) => value, begin = along(low), width = along(high) - begin || 1;
  return (value) => from + ((along(value) - begin) / width) * (to - from);
}

/** The range of numbers of some arrays, without NaN; null if there are none. */
function rangeOf(...arrays) {
  let low = Infinity, high = -Infinity;
  for (const values of arrays) for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low > high ? null : [low, high];
}

/** Widen a range for an axis: from 0 if it does not go below, and of at least some extent. */
function widened([low, high], log, { zero = false } = {}) {
  if (log) return low === high ? [low / 2, high * 2] : [low, high];
  if (zero && low >= 0) low = 0;
  return high === low ? [zero ? low : low - 0.5, high + (zero ? 1 : 0.5)] : [low, high];
}

/** What one kind of chart draws: ranges of its axes, its content, and what is at a place. */
class Content {
  constructor(news, arrays, lookedAt, seconds) {
    Object.assign(this, { news, arrays, lookedAt, seconds });
  }

  /** A step in words, with its time if that is known. */
  when(step) {
    return `step ${counted(step)}${this.seconds === null ? "" : `, ${short(step * this.seconds)} s`}`;
  }

  line(context, place, x, colour) {
    context.strokeStyle = colour;
    context.beginPath();
    context.moveTo(Math.round(x) + 0.5, MARGIN.top);
    context.lineTo(Math.round(x) + 0.5, place.bottom);
    context.stroke();
  }
}

class OverTime extends Content {
  get count() {
    return this.news.points;
  }

  #curves(part) {
    const { names, banded } = this.news, c = names.length, first = 2 + { mean: 0, low: c, high: 2 * c }[banded ? part : "mean"];
    return this.arrays.slice(first, first + c);
  }

  get ranges() {
    const few = this.news.names.length <= 3, found = this.count && rangeOf(...this.#curves(few ? "low" : "mean"), ...this.#curves(few ? "high" : "mean"));
    if (!found) return null;
    const steps = this.arrays[1], log = this.news.y.log;
    return { x: [Math.min(steps[0], 1) - 1, Math.max(steps[this.count - 1], 1)], y: widened(found, log, { zero: true }) };
  }

  /** Colours of curves: of layers those of rings around robots, the last one without a layer. */
  colours({ layers, no_layer, series }) {
    const { colours, names } = this.news;
    if (colours !== "layers") return names.map((_, k) => series[k % series.length]);
    return names.map((_, k) => (k === names.length - 1 ? no_layer : layers[k % layers.length]));
  }

  dash(k, palette) {
    const many = (this.news.colours === "layers" ? palette.layers : palette.series).length;
    return Math.floor(k / many) % DASHED.length;
  }

  draw(context, place, palette) {
    const { names, banded } = this.news, steps = this.arrays[1], colours = this.colours(palette);
    const means = this.#curves("mean"), lows = this.#curves("low"), highs = this.#curves("high");
    names.forEach((_, k) => {
      if (banded && names.length <= 3) this.#band(context, place, lows[k], highs[k], colours[k]);
      context.strokeStyle = colours[k];
      context.lineWidth = 1.6;
      context.setLineDash(DASHED[this.dash(k, palette)]);
      context.beginPath();
      let drawn = false;
      for (let i = 0; i < this.count; i++) {
        const known = !Number.isNaN(means[k][i]), x = place.x(steps[i]), y = place.y(means[k][i]);
        if (known && drawn) context.lineTo(x, y);
        else if (known) context.moveTo(this.count === 1 ? x - 3 : x, y);
        if (known && this.count === 1) context.lineTo(x, y);
        drawn = known;
      }
      context.stroke();
      context.setLineDash([]);
    });
  }

  #band(context, place, low, high, colour) {
    const steps = this.arrays[1];
    context.globalAlpha = 0.22;
    context.fillStyle = colour;
    context.beginPath();
    for (let i = 0; i < this.count; i++) if (!Number.isNaN(high[i])) context.lineTo(place.x(steps[i]), place.y(high[i]));
    for (let i = this.count - 1; i >= 0; i--) if (!Number.isNaN(low[i])) context.lineTo(place.x(steps[i]), place.y(low[i]));
    context.fill();
    context.globalAlpha = 1;
  }

  /** Draw lines at the displayed step, and at the place that is pointed at. */
  mark(context, place, palette, at) {
    context.lineWidth = 1.5;
    if (this.lookedAt !== null) this.line(context, place, place.x(this.lookedAt), palette.selection);
    if (at !== null) this.line(context, place, place.x(this.arrays[1][at]), palette.soft);
  }

  near(place, x) {
    const steps = this.arrays[1], after = steps.findIndex((one) => place.x(one) >= x);
    if (after <= 0) return after < 0 ? this.count - 1 : 0;
    return place.x(steps[after]) - x < x - place.x(steps[after - 1]) ? after : after - 1;
  }

  at(index, place) {
    return [place.x(this.arrays[1][index]), null];
  }

  /** What stands at a place: the exact step, or the steps whose mean it is; and the values there. */
  read(index) {
    const [firsts, steps] = this.arrays, first = firsts[index], last = steps[index], { every, names } = this.news;
    const mean = every === 1 ? `mean of steps ${counted(first)} to ${counted(last)}` : `mean of every ${counted(every)}th step, ${counted(first)} to ${counted(last)}`;
    const values = this.#curves("mean").map((one) => one[index]);
    return { when: first === last ? this.when(last) : mean, rows: names.map((name, k) => [name, short(values[k]), k]), values };
  }

  /** The exact values of the last or the displayed step. */
  present() {
    const { row } = this.news;
    return row === null ? { when: "", values: null } : { when: this.when(row.step), values: row.values };
  }
}

class Histogram extends Content {
  get count() {
    return this.news.robots ? this.news.points : 0;
  }

  get ranges() {
    const [edges, counts] = this.arrays;
    return this.count ? { x: [edges[0], edges[edges.length - 1]], y: [0, Math.max(1, ...counts)] } : null;
  }

  draw(context, place, palette, at) {
    const [edges, counts] = this.arrays, base = place.y(0);
    counts.forEach((count, k) => {
      const left = place.x(edges[k]), width = place.x(edges[k + 1]) - left;
      context.fillStyle = palette.series[0];
      context.globalAlpha = at === k ? 1 : 0.8;
      if (count) context.fillRect(left + Math.min(0.5, width / 4), place.y(count), Math.max(width - 1, width / 2), base - place.y(count));
    });
    context.globalAlpha = 1;
  }

  mark(context, place, palette, at) {
    if (at === null) return;
    const [edges] = this.arrays, left = place.x(edges[at]), width = place.x(edges[at + 1]) - left;
    context.strokeStyle = palette.soft;
    context.lineWidth = 1;
    context.strokeRect(left, MARGIN.top, width, place.bottom - MARGIN.top);
  }

  near(place, x) {
    const [edges] = this.arrays, after = edges.findIndex((one) => place.x(one) > x);
    return after < 0 ? this.count - 1 : Math.max(after - 1, 0);
  }

  at(index, place) {
    return [(place.x(this.arrays[0][index]) + place.x(this.arrays[0][index + 1])) / 2, null];
  }

  read(index) {
    const [edges, counts] = this.arrays, count = counts[index], whole = edges[index + 1] - edges[index] === 1 && edges[index] % 1 !== 0;
    const where = whole ? short(edges[index] + 0.5) : `${short(edges[index])} to ${short(edges[index + 1])}`;
    return { when: where, rows: [["", `${counted(count)} robot${count === 1 ? "" : "s"}`, null]] };
  }

  present() {
    return { when: this.when(this.news.step), values: null };
  }
}

class PhasePlot extends Content {
  get count() {
    return this.news.points;
  }

  get ranges() {
    const [, across, up] = this.arrays, x = this.count && rangeOf(across), y = this.count && rangeOf(up);
    return x && y ? { x: widened(x, this.news.x.log), y: widened(y, this.news.y.log) } : null;
  }

  draw(context, place, { values }) {
    const [, across, up] = this.arrays, colour = (i) => Math.min(Math.floor((i / Math.max(this.count - 1, 1)) * values.length), values.length - 1);
    context.lineWidth = 1.2;
    for (let k = 0, i = 0; k < values.length; k++) {
      context.strokeStyle = context.fillStyle = values[k];
      context.beginPath();
      for (; i < this.count && colour(i) === k; i++) {
        const x = place.x(across[i]), y = place.y(up[i]);
        if (Number.isNaN(x + y)) continue;
        if (i && !Number.isNaN(across[i - 1] + up[i - 1])) {
          context.moveTo(place.x(across[i - 1]), place.y(up[i - 1]));
          context.lineTo(x, y);
        }
        if (this.count <= 128) context.fillRect(x - 1.5, y - 1.5, 3, 3);
      }
      context.stroke();
    }
  }

  /** Draw a ring around the present or displayed point, and around the one that is pointed at. */
  mark(context, place, palette, at) {
    const [, across, up] = this.arrays, { row } = this.news;
    const ring = (x, y, colour, radius) => {
      context.strokeStyle = colour;
      context.lineWidth = 2;
      context.beginPath();
      context.arc(place.x(x), place.y(y), radius, 0, 2 * Math.PI);
      context.stroke();
    };
    if (row && row.values.every((value) => value !== null)) ring(...row.values, palette.selection, 5);
    if (at !== null) ring(across[at], up[at], palette.ink, 4);
  }

  near(place, x, y) {
    const [, across, up] = this.arrays;
    let best = 0, least = Infinity;
    for (let i = 0; i < this.count; i++) {
      const far = (place.x(across[i]) - x) ** 2 + (place.y(up[i]) - y) ** 2;
      if (far < least) [best, least] = [i, far];
    }
    return best;
  }

  at(index, place) {
    return [place.x(this.arrays[1][index]), place.y(this.arrays[2][index])];
  }

  read(index) {
    const [steps, across, up] = this.arrays, { x, y } = this.news;
    return { when: this.when(steps[index]), rows: [[x.label, short(across[index]), null], [y.label, short(up[index]), null]] };
  }

  present() {
    const { row } = this.news;
    return row ? { when: this.when(row.step), values: row.values } : { when: "", values: null };
  }
}

const CONTENTS = { "over time": OverTime, histogram: Histogram, "phase plot": PhasePlot };

/** One chart: its head with buttons, its canvas, what is at the pointer, its key. */
class ChartView {
  #parts = {}; #content = null; #place = null; #at = null; #made = "";

  constructor({ id, kind, title, log }, send) {
    const button = (text, name, request, more = {}) => make("button", { type: "button", title: name, "aria-label": name, click: () => send({ do: request, value: id, ...more }) }, text);
    const parts = this.#parts;
    parts.logs = LOG_AXES[kind].map((axis) => [axis, button(LOG_AXES[kind].length > 1 ? `log ${axis}` : "log", `Logarithmic ${axis} axis of ${title}`, "log", { axis })]);
    parts.canvas = make("canvas", { role: "img", tabindex: "0", "aria-label": title });
    parts.readout = make("div", { class: "swarm-readout", role: "status", hidden: true });
    parts.key = make("ul");
    parts.note = make("p", { class: "swarm-hint", hidden: true });
    const downloads = ["png", "csv"].map((one) => button(one.toUpperCase(), `Download ${title} as ${one.toUpperCase()}`, one));
    const head = make("figcaption", {}, make("span", {}, title), ...parts.logs.map(([, one]) => one), ...downloads, button("\u2715", `Remove ${title}`, "remove"));
    this.element = make("figure", { class: "swarm-chart", "data-kind": kind }, head, make("div", { class: "swarm-chart-area" }, parts.canvas, parts.readout), parts.key, parts.note);
    this.kind = kind;
    this.title = title;
    this.settle(log);
    this.#listen();
  }

  /** Show which axes are logarithmic. */
  settle(log) {
    for (const [axis, button] of this.#parts.logs) button.setAttribute("aria-pressed", log.includes(axis));
  }

  #listen() {
    const { canvas } = this.#parts;
    canvas.addEventListener("pointermove", (event) => this.#point(event));
    canvas.addEventListener("pointerdown", (event) => this.#point(event));
    canvas.addEventListener("pointerleave", () => this.#show(null));
    canvas.addEventListener("blur", () => this.#show(null));
    canvas.addEventListener("keydown", (event) => this.#press(event));
  }

  take(news, arrays, lookedAt, seconds) {
    this.#content = new CONTENTS[this.kind](news, arrays, lookedAt, seconds ?? null);
    this.element.dataset.points = news.points;
    showText(this.#parts.note, news.note);
    this.draw();
  }

  /** Find what is at the pointer, also where CSS zooms the page. */
  #point(event) {
    if (!this.#place || !this.#content.count) return;
    const { canvas } = this.#parts, { left, top, width } = canvas.getBoundingClientRect(), zoom = canvas.clientWidth / width;
    this.#show(this.#content.near(this.#place, (event.clientX - left) * zoom, (event.clientY - top) * zoom));
  }

  /** Go along the chart by keys, which do not reach the player meanwhile. */
  #press(event) {
    const last = (this.#content?.count ?? 0) - 1, far = Math.max(1, Math.round(last / 10)), from = this.#at ?? last + 1;
    const to = { ArrowLeft: from - 1, ArrowRight: this.#at === null ? 0 : from + 1, PageDown: from - far, PageUp: from + far, Home: 0, End: last, Escape: null }[event.key];
    if (to === undefined || last < 0) return;
    event.preventDefault();
    event.stopPropagation();
    this.#show(to === null ? null : Math.min(Math.max(to, 0), last), true);
  }

  #show(at, spoken = false) {
    this.#at = at;
    this.#parts.readout.setAttribute("aria-live", spoken ? "polite" : "off");
    this.draw();
  }

  draw() {
    const content = this.#content, { canvas } = this.#parts, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!content || !width) return;
    const palette = PALETTE[themeAround(this.element)], context = sizedContext(canvas, width, height);
    context.font = "11px system-ui, sans-serif";
    if (this.#at !== null && this.#at >= content.count) this.#at = content.count ? content.count - 1 : null;
    this.#place = this.#axes(context, width, height, palette);
    if (this.#place) {
      content.draw(context, this.#place, palette, this.#at);
      content.mark(context, this.#place, palette, this.#at);
    }
    this.#write(palette);
  }

  #axes(context, width, height, palette) {
    const content = this.#content, { x, y, degrees } = content.news, ranges = content.ranges, { left, right, top } = MARGIN, bottom = BOTTOM[this.kind];
    context.fillStyle = palette.soft;
    context.strokeStyle = palette.line;
    context.lineWidth = 1;
    context.textBaseline = "alphabetic";
    context.textAlign = "left";
    if (!ranges) {
      context.fillText(content.news.note ? "no values" : "no numbers yet", left, height / 2);
      return null;
    }
    const rises = y.log ? logTicks(...ranges.y) : roundNumbers(ranges.y[0], ranges.y[1], 3)[0], step = rises[1] - rises[0] || 1;
    const top1 = y.log || this.kind === "phase plot" ? ranges.y[1] : Math.max(ranges.y[1], ranges.y[0] + step * Math.ceil((ranges.y[1] - ranges.y[0]) / step - 0.25));
    const place = {
      x: scaleOf(...ranges.x, x.log, left, width - right),
      y: scaleOf(ranges.y[0], top1, y.log, height - bottom, top),
      width, height, bottom: height - bottom,
    };
    context.fillText(this.#cut(context, y.label, width - 10), 2, 11);
    const beside = this.kind === "over time", taken = beside ? width - context.measureText(x.label).width - 10 : width;
    context.textAlign = beside ? "right" : "center";
    context.fillText(this.#cut(context, x.label, width - left), beside ? width - 2 : (left + width - right) / 2, height - 4);
    context.textBaseline = "middle";
    context.beginPath();
    for (const value of y.log ? rises : roundNumbers(ranges.y[0], top1, 3)[0]) {
      if (this.kind === "histogram" && !Number.isInteger(value)) continue;
      const at = Math.round(place.y(value)) + 0.5;
      context.moveTo(left, at);
      context.lineTo(width - right, at);
      context.fillText(short(value), left - 5, at);
    }
    context.stroke();
    this.#marksBelow(context, place, ranges.x, { log: x.log, degrees, taken });
    return place;
  }

  /** Write the numbers of the x axis, as far as there is room beside its name. */
  #marksBelow(context, place, [low, high], { log, degrees, taken }) {
    const content = this.#content, over = this.kind === "over time", seconds = over ? content.seconds ?? 1 : 1;
    const fitting = (values) => {
      const found = [];
      let free = 0;
      for (const value of values) {
        if (over && content.seconds === null && !Number.isInteger(value)) continue;
        const text = short(value), half = context.measureText(text).width / 2, x = Math.max(place.x(value / seconds), half + 1);
        if (x - half < free || x + half > taken) continue;
        found.push([text, x]);
        free = x + half + 6;
      }
      return found;
    };
    context.textBaseline = "alphabetic";
    context.textAlign = "center";
    const even = (parts) => fitting(roundNumbers(low * seconds, high * seconds, parts)[0]), few = log || degrees ? [] : even(4);
    const found = log ? fitting(logTicks(low, high)) : degrees ? fitting([-180, -90, 0, 90, 180]) : few.length < 3 ? even(8) : few;
    for (const [text, x] of found) context.fillText(text, x, place.bottom + 13);
  }

  #cut(context, text, width) {
    let cut = text;
    while (cut.length > 1 && context.measureText(cut === text ? text : `${cut}…`).width > width) cut = cut.slice(0, -1);
    return cut === text ? text : `${cut}…`;
  }

  /** Show the numbers at the pointer, or else the exact ones of the last or displayed step, beside the names. */
  #write(palette) {
    const content = this.#content, { news } = content, at = this.#at !== null && this.#place ? content.read(this.#at) : null;
    const present = content.present(), values = at?.values ?? present.values;
    const names = this.kind === "over time" ? news.names : this.kind === "phase plot" ? [news.x.label, news.y.label] : [];
    this.#makeKey(names, palette);
    const items = [...this.#parts.key.querySelectorAll("li[data-k] b")];
    items.forEach((item, k) => (item.textContent = values ? short(values[k]) : "–"));
    const summary = this.#parts.key.querySelector(".swarm-summary"), looked = content.lookedAt === null ? "" : `at ${present.when}`;
    if (summary) summary.textContent = this.kind === "histogram" ? `${present.when}: ${news.summary}` : looked;
    this.#parts.key.title = at ? at.when : present.when && `at ${present.when}`;
    this.#read(at, palette);
    const rows = at ? at.rows.map(([name, value]) => `${name} ${value}`.trim()) : names.map((name, k) => `${name} ${values ? short(values[k]) : "–"}`);
    const when = at ? at.when : present.when, words = rows.length ? rows : [news.summary ?? ""];
    this.#parts.canvas.setAttribute("aria-label", when ? `${this.title}, ${when}: ${words.join(", ")}` : this.title);
  }

  #makeKey(names, palette) {
    const made = JSON.stringify([names, themeAround(this.element), this.#content.news.colours]);
    if (made === this.#made) return;
    this.#made = made;
    const content = this.#content, colours = content.colours?.(palette) ?? [];
    const items = names.map((name, k) => {
      const line = make("i");
      if (colours[k]) line.style.borderTop = `3px ${["solid", "dashed", "dotted"][content.dash(k, palette)]} ${colours[k]}`;
      return make("li", { "data-k": k }, ...(colours[k] ? [line] : []), make("span", {}, name), make("b"));
    });
    if (this.kind === "phase plot") {
      const ramp = make("i", { class: "swarm-ramp" });
      ramp.style.background = `linear-gradient(to right, ${palette.values.join(", ")})`;
      items.push(make("li", {}, make("span", {}, "first step"), ramp, make("span", {}, "last step")));
    }
    this.#parts.key.replaceChildren(...items, make("li", { class: "swarm-summary" }));
  }

  /** Show what is pointed at beside the pointer. */
  #read(at, palette) {
    const { readout, canvas } = this.#parts;
    readout.hidden = !at;
    if (!at) return;
    const content = this.#content, colours = content.colours?.(palette) ?? [], more = at.rows.length - MOST_READ;
    const rows = at.rows.slice(0, MOST_READ).map(([name, value, k]) => {
      const line = make("i");
      if (k !== null) line.style.background = colours[k];
      return make("div", {}, ...(k === null ? [] : [line]), make("span", {}, name), make("b", {}, value));
    });
    readout.replaceChildren(make("strong", {}, at.when), ...rows, ...(more > 0 ? [make("div", {}, make("span", {}, `and ${more} more below`))] : []));
    const [x, y] = content.at(this.#at, this.#place), width = canvas.clientWidth, left = x > width / 2;
    readout.style.left = left ? "auto" : `${x + 8}px`;
    readout.style.right = left ? `${width - x + 8}px` : "auto";
    readout.style.top = `${y === null ? 2 : Math.max(2, y - 50)}px`;
  }
}

/** The control that adds a chart: its kind, and what it shows. */
class AddChart {
  #model; #send; #parts = {};

  constructor(model, send) {
    this.#model = model;
    this.#send = send;
    const parts = this.#parts, field = (label, select) => make("label", {}, make("span", {}, label), select);
    parts.kind = make("select", { "aria-label": "Kind of chart", change: () => this.fill() }, ...KINDS.map((one) => make("option", { value: one }, one)));
    parts.what = make("select", { "aria-label": "What the chart shows" });
    parts.against = make("select", { "aria-label": "Against, on the x axis" });
    parts.name = make("span", {}, "what");
    parts.x = field("x", parts.against);
    const form = make("form", { submit: (event) => (event.preventDefault(), this.#request()) },
      field("kind", parts.kind), parts.x, make("label", {}, parts.name, parts.what), make("button", { type: "submit" }, "Add"));
    this.element = make("details", { class: "swarm-choice" }, make("summary", {}, "Add chart"), form);
    this.fill();
  }

  /** Offer what there is of the chosen kind. */
  fill() {
    const { kind, what, against, name, x } = this.#parts, known = this.#model.get("choices")[kind.value] ?? [];
    for (const [select, usual] of [[what, kind.value === "phase plot" ? 1 : 0], [against, 0]]) {
      const before = select.value, options = known.map(([value, text]) => make("option", { value }, text));
      if (JSON.stringify(known) === select.dataset.known) continue;
      select.dataset.known = JSON.stringify(known);
      select.replaceChildren(...options);
      select.value = known.some(([value]) => value === before) ? before : known[Math.min(usual, known.length - 1)]?.[0] ?? "";
    }
    x.hidden = kind.value !== "phase plot";
    name.textContent = x.hidden ? "what" : "y";
  }

  #request() {
    const { kind, what, against } = this.#parts;
    if (!what.value) return;
    this.#send({ do: "add", value: JSON.stringify([kind.value, what.value, kind.value === "phase plot" ? against.value : "", ""]) });
    this.element.open = false;
    this.element.querySelector("summary").focus();
  }
}

/** All charts of a board, and the control that adds one. */
class BoardView extends View {
  #views = new Map(); #adding; #stack; #fault;

  constructor(model, root) {
    super(model, root, "swarm-charts");
    this.#stack = make("div", {});
    this.#fault = make("p", { class: "swarm-fault", role: "alert", hidden: true });
    this.#adding = new AddChart(model, (message) => this.send(message));
    root.append(make("div", { class: "swarm-head" }, make("h2", {}, "Charts"), this.#adding.element), this.#fault, this.#stack);
    const fault = () => showText(this.#fault, model.get("fault"));
    this.follow({ choices: () => this.#adding.fill(), shown: () => this.#build(), fault });
    this.receive((message, buffers) => this.#take(message, buffers));
    this.listen(document, "pointerdown", (event) => this.#adding.element.contains(event.target) || (this.#adding.element.open = false));
    this.listen(document, "visibilitychange", () => this.#look());
    const sizes = new ResizeObserver(() => this.#redraw());
    sizes.observe(root);
    this.atEnd(() => sizes.disconnect());
    this.atEnd(watchTheme(root, () => this.#redraw()));
    this.#look();
  }

  #look() {
    try {
      this.send({ do: "look", value: !document.hidden });
    } catch {
      // The page is being closed: the connection has ended.
    }
  }

  #build() {
    const shown = this.model.get("shown"), before = this.#views;
    this.#views = new Map(shown.map((one) => [one.id, before.get(one.id) ?? new ChartView(one, (message) => this.send(message))]));
    for (const one of shown) this.#views.get(one.id).settle(one.log);
    const wanted = [...this.#views.values()].map((one) => one.element);
    for (const one of [...this.#stack.children]) if (!wanted.includes(one)) one.remove();
    // Those that stay are not moved: the one that has the focus would lose it.
    wanted.forEach((one, k) => this.#stack.children[k] === one || this.#stack.insertBefore(one, this.#stack.children[k] ?? null));
    if (!shown.length) this.#stack.append(make("p", { class: "swarm-hint" }, "No chart is shown."));
    this.#redraw();
  }

  #redraw() {
    this.#views.forEach((view) => view.draw());
  }

  #take(message, buffers) {
    if (message.kind !== "curves") return;
    message.charts.forEach((news, k) => {
      const numbers = new Float64Array(bytesOf(buffers[k]).buffer);
      let from = 0;
      const arrays = news.lengths.map((length) => numbers.subarray(from, (from += length)));
      this.#views.get(news.id)?.take(news, arrays, message.looked_at, message.seconds);
    });
    this.root.dataset.drawn = Number(this.root.dataset.drawn ?? 0) + 1;
    this.send({ do: "drawn" });
  }
}

export default shownBy(BoardView);
