/* The picture of an experiment: a heat map over two parameters, or curves over one. Python sends `picture`; its `cells`
   are point by point, the last axis fastest: estimate, low, high, text, runs with a value, runs done, runs that failed.
   Before this text stands the constant PALETTE, see `script` in viewing/palette.py. */

const FONT = "system-ui, sans-serif";
const PAPER = { width: 1000, height: 620, scale: 2 };
const MOST_LINES = 8;

/** Return a number with the decimals that a distance between ticks needs. */
function withDecimals(value, step) {
  const digits = Math.min(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), 8);
  if (Math.abs(value) >= 1e6 || digits === 8) return String(+value.toPrecision(3));
  return value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

function luminance(colour) {
  const parts = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255);
  const [red, green, blue] = parts.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

/** The ink of the light or of the dark theme, whichever is read more easily on a colour. */
const inkOn = (colour) => PALETTE[luminance(colour) > 0.179 ? "light" : "dark"].ink;

/** The cells of a picture with their places, and how they are drawn on a canvas. */
class Plot {
  #about; #colours; #context; #asLines;

  constructor(about, asLines, context, colours) {
    [this.#about, this.#asLines, this.#context, this.#colours] = [about, asLines, context, colours];
    // Centres of points, or rectangles of cells, in the order of the cells.
    this.places = [];
  }

  get #first() { return this.#about.axes[0]; }
  get #second() { return this.#about.axes[1] ?? { name: "", labels: [""], numbers: null }; }

  #cell(i, j) { return this.#about.cells[i * this.#second.labels.length + j]; }

  #text(text, x, y, { align = "center", base = "middle", size = 12, colour = this.#colours.soft, bold = false } = {}) {
    const context = this.#context;
    context.font = `${bold ? "600 " : ""}${size}px ${FONT}`;
    Object.assign(context, { textAlign: align, textBaseline: base, fillStyle: colour });
    context.fillText(text, x, y);
  }

  #widest(texts, size = 12) {
    this.#context.font = `${size}px ${FONT}`;
    return Math.max(0, ...texts.map((text) => this.#context.measureText(text).width));
  }

  /** The name of an axis, and what it is with its unit if there is room for that. */
  #named({ name, help = "" }, x, y, room, upwards = false) {
    const context = this.#context, size = 12;
    context.save();
    context.translate(x, y);
    if (upwards) context.rotate(-Math.PI / 2);
    context.font = `600 ${size}px ${FONT}`;
    const width = context.measureText(name).width, more = help && help !== name ? `  ${help}` : "", both = width + this.#widest([more]);
    const start = -(more && both <= room ? both : width) / 2;
    this.#text(name, start, 0, { align: "left", colour: this.#colours.ink, bold: true });
    if (more && both <= room) this.#text(more, start + width, 0, { align: "left" });
    context.restore();
  }

  /** Least and greatest estimate, and with `limits` those of the intervals. */
  #range(limits) {
    const numbers = this.#about.cells.flatMap(([mean, low, high]) => (limits ? [mean, low, high] : [mean])).filter((one) => one !== null);
    return numbers.length ? [Math.min(...numbers), Math.max(...numbers)] : null;
  }

  draw(box) {
    if (this.#asLines) this.#lines(box);
    else this.#map(box);
  }

  #hatched(x, y, width, height) {
    const context = this.#context, gap = 7;
    context.save();
    context.beginPath();
    context.rect(x, y, width, height);
    context.clip();
    context.strokeStyle = this.#colours.line;
    context.lineWidth = 1;
    context.beginPath();
    for (let k = Math.floor((x - y - height) / gap) * gap; k < x + width - y; k += gap) {
      context.moveTo(k + y, y);
      context.lineTo(k + y + height, y + height);
    }
    context.stroke();
    context.strokeRect(x + 0.5, y + 0.5, width - 1, height - 1);
    context.restore();
  }

  #map({ x, y, width, height }) {
    const columns = this.#first.labels.length, rows = this.#second.labels.length, context = this.#context;
    const widest = this.#widest(this.#second.labels), from = x + 30 + widest, right = x + width - 100, top = y + 6, bottom = y + height - 46;
    const across = Math.min((right - from) / columns, 340), down = Math.min((bottom - top) / rows, 300);
    const left = from + (right - from - across * columns) / 2;
    const end = top + down * rows, { values } = this.#colours;
    const range = this.#about.share && this.#range(false) ? [0, 100] : this.#range(false);
    const colourOf = (mean) => values[range[0] === range[1] ? values.length >> 1 : Math.floor(((mean - range[0]) / (range[1] - range[0])) * (values.length - 1) + 0.5)];
    const gap = across > 14 && down > 14 ? 1 : 0;
    const size = down > 34 && across > 60 ? 13 : 11;
    const [, part] = range ? roundNumbers(range[0], range[1] === range[0] ? range[0] + 1 : range[1], 100) : [[], 1];
    const short = this.#about.cells.map(([mean]) => (mean === null ? "–" : withDecimals(mean, part)));
    const hasRoom = down >= size + 4 && this.#widest(short, size) <= across - 6;
    for (let i = 0; i < columns; i++) {
      for (let j = 0; j < rows; j++) {
        const place = { x: left + i * across, y: this.#second.numbers ? end - (j + 1) * down : top + j * down, width: across - gap, height: down - gap };
        const k = i * rows + j, [mean, , , , , done, failed] = this.#cell(i, j), middle = [place.x + place.width / 2, place.y + place.height / 2];
        this.places[k] = place;
        if (mean !== null) {
          context.fillStyle = colourOf(mean);
          context.fillRect(place.x, place.y, place.width, place.height);
        } else if (failed && failed === done) {
          context.fillStyle = this.#colours.bad_paper;
          context.fillRect(place.x, place.y, place.width, place.height);
          context.strokeStyle = this.#colours.bad;
          context.strokeRect(place.x + 0.5, place.y + 0.5, place.width - 1, place.height - 1);
          if (down >= 14) this.#text(across > 46 ? "error" : "!", ...middle, { colour: this.#colours.bad, size });
        } else if (done) {
          context.fillStyle = this.#colours.band;
          context.fillRect(place.x, place.y, place.width, place.height);
        } else {
          this.#hatched(place.x, place.y, place.width, place.height);
        }
        if (hasRoom && (mean !== null || (done && failed < done))) {
          this.#text(short[k], ...middle, { colour: mean === null ? this.#colours.soft : inkOn(colourOf(mean)), size });
        }
      }
    }
    this.#ticksBelow(this.#first.labels.map((label, i) => [label, left + (i + 0.5) * across]), end, left, left + across * columns);
    const every = Math.ceil(15 / down);
    this.#second.labels.forEach((label, j) => {
      const place = this.places[j];
      if (j % every === 0) this.#text(label, left - 7, place.y + place.height / 2, { align: "right" });
    });
    this.#named(this.#second, left - widest - 20, (top + end) / 2, end - top, true);
    if (range) this.#bar(left + across * columns + 16, top, end - top, range);
  }

  /** Labels below an axis, as many as there is room for, and its name. */
  #ticksBelow(labels, y, left, right) {
    const distance = labels.length > 1 ? Math.abs(labels[1][1] - labels[0][1]) : Infinity;
    const every = Math.max(1, Math.ceil((this.#widest(labels.map(([label]) => label)) + 8) / distance));
    labels.forEach(([label, x], i) => i % every === 0 && this.#text(label, x, y + 14));
    this.#named(this.#first, (left + right) / 2, y + 35, right - left);
  }

  #bar(x, y, height, [low, high]) {
    const context = this.#context, { values } = this.#colours;
    if (low === high) [low, high] = [low - 0.5, high + 0.5];
    const [marks, step] = roundNumbers(low, high, Math.max(2, height / 50)), part = height / values.length;
    values.forEach((colour, k) => {
      context.fillStyle = colour;
      context.fillRect(x, y + height - (k + 1) * part, 14, part + 0.5);
    });
    for (const mark of marks) {
      const place = y + height - ((mark - low) / (high - low)) * height;
      context.fillStyle = this.#colours.soft;
      context.fillRect(x + 14, place - 0.5, 4, 1);
      this.#text(withDecimals(mark, step), x + 21, place, { align: "left" });
    }
    const widest = this.#widest(marks.map((mark) => withDecimals(mark, step)));
    this.#named({ name: this.#about.measure }, x + 36 + widest, y + height / 2, height, true);
  }

  #lines({ x, y, width, height }) {
    const { series } = this.#colours, context = this.#context, rows = this.#second.labels.length, labels = this.#first.labels;
    const range = this.#about.share ? [0, 100] : this.#range(true);
    let [low, high] = range ?? [0, 1];
    if (low >= 0 && low < high * 0.6) low = 0;
    if (low === high) [low, high] = [low - (low ? 0.5 : 0), high + 0.5];
    const beyond = (high - low) * 0.03;
    [low, high] = [low && low - beyond, this.#about.share ? high : high + beyond];
    const [marks, step] = range ? roundNumbers(low, high, Math.max(2, height / 70)) : [[], 1], texts = marks.map((mark) => withDecimals(mark, step));
    const named = rows > 1 ? 24 : 0, left = x + 34 + this.#widest(texts), right = x + width - 16, top = y + 10 + named, bottom = y + height - 48;
    const numbers = labels.length > 1 ? this.#first.numbers : null, [from, to] = numbers ? [Math.min(...numbers), Math.max(...numbers)] : [0, 0];
    const inset = numbers ? 14 : 0, slot = (right - left) / labels.length;
    const across = (i) => (numbers ? left + inset + ((numbers[i] - from) / (to - from)) * (right - left - 2 * inset) : left + (i + 0.5) * slot);
    const up = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    context.lineWidth = 1;
    marks.forEach((mark, k) => {
      context.fillStyle = this.#colours.line;
      context.fillRect(left, Math.round(up(mark)) - 0.5, right - left, 1);
      this.#text(texts[k], left - 7, up(mark), { align: "right" });
    });
    this.#named({ name: this.#about.measure }, x + 10, (top + bottom) / 2, bottom - top, true);
    const order = labels.map((_, i) => i).sort((a, b) => across(a) - across(b));
    this.#ticksBelow(order.map((i) => [labels[i], across(i)]), bottom, left, right);
    let edge = left;
    for (let j = 0; j < rows; j++) {
      const colour = series[j % series.length], aside = (j - (rows - 1) / 2) * Math.min(numbers ? 5 : 18, slot / (rows + 1));
      const points = order.map((i) => [across(i) + aside, this.#cell(i, j), i]);
      this.#line(points.filter(([, cell]) => cell[0] !== null), up, colour, { joined: Boolean(numbers), banded: rows === 1 });
      for (const [px, cell, i] of points) this.places[i * rows + j] = this.#point(px, cell, up, colour, bottom, top);
      if (named) {
        const label = `${this.#second.name} ${this.#second.labels[j]}`;
        context.fillStyle = colour;
        context.fillRect(edge, y + 11, 16, 3);
        this.#text(label, edge + 21, y + 12, { align: "left" });
        edge += 40 + this.#widest([label]);
      }
    }
  }

  #line(points, up, colour, { joined, banded }) {
    const context = this.#context, known = points.filter(([, [, low]]) => low !== null);
    if (joined && banded && known.length > 1) {
      context.beginPath();
      known.forEach(([x, [, low]]) => context.lineTo(x, up(low)));
      known.toReversed().forEach(([x, [, , high]]) => context.lineTo(x, up(high)));
      context.closePath();
      context.fillStyle = `${colour}26`;
      context.fill();
    }
    if (joined) {
      context.beginPath();
      points.forEach(([x, [mean]]) => context.lineTo(x, up(mean)));
      Object.assign(context, { strokeStyle: colour, lineWidth: 1.8 });
      context.stroke();
    }
  }

  /** Draw a point with its interval; return where it is. */
  #point(x, [mean, low, high, , , done, failed], up, colour, bottom, top) {
    const context = this.#context;
    Object.assign(context, { strokeStyle: colour, fillStyle: colour, lineWidth: 1.4 });
    if (mean === null) {
      if (failed) this.#text("!", x, bottom - 10, { colour: this.#colours.bad, bold: true });
      else if (done) this.#text("–", x, bottom - 10);
      else this.#hatched(x - 5, top, 10, bottom - top);
      return { x: x - 12, y: top, width: 24, height: bottom - top };
    }
    if (low !== null) {
      context.beginPath();
      for (const end of [low, high]) {
        context.moveTo(x - 4, up(end));
        context.lineTo(x + 4, up(end));
      }
      context.moveTo(x, up(low));
      context.lineTo(x, up(high));
      context.stroke();
    }
    context.beginPath();
    context.arc(x, up(mean), 3.6, 0, 2 * Math.PI);
    context.fill();
    return { x: x - 12, y: up(mean) - 14, width: 24, height: 28 };
  }
}

class ExperimentView extends View {
  #asLines = false; #places = []; #pointed = -1; #filled = null;

  constructor(model, root) {
    super(model, root, "swarm-experiment");
    this.#build();
    const draw = () => this.#draw(), sizes = new ResizeObserver(draw);
    sizes.observe(this.plot);
    this.listen(model, "change:picture", draw);
    this.receive();
    this.atEnd(() => sizes.disconnect());
    this.atEnd(watchTheme(root, draw));
  }

  get #about() { return this.model.get("picture"); }
  get #isMap() { return this.#about.axes.length > 1 && !this.#asLines; }

  #build() {
    const button = (label, title, act) => make("button", { type: "button", title, click: act }, label);
    this.title = make("h2");
    this.of = make("p", { class: "swarm-hint" });
    this.stale = make("p", { class: "swarm-stale", role: "status", hidden: true });
    this.canvas = make("canvas", {
      tabindex: 0, role: "img",
      pointermove: (event) => this.#point(this.#at(event)), pointerleave: () => this.#point(-1),
      click: (event) => this.#watch(this.#at(event)), keydown: (event) => this.#key(event), blur: () => this.#point(-1),
    });
    this.tip = make("div", { class: "swarm-tip", "aria-live": "polite", hidden: true });
    this.plot = make("div", { class: "swarm-plot" }, this.canvas, this.tip);
    this.note = make("p", { class: "swarm-hint" });
    this.fault = make("p", { class: "swarm-fault", role: "alert", hidden: true });
    this.kind = button("Curves", "Show curves instead of the map, or the map", () => ((this.#asLines = !this.#asLines), this.#draw()));
    this.csv = button("All runs as CSV", "One line for each run", () => this.send({ do: "csv" }));
    this.png = button("Picture as PNG", "On white paper", () => this.#savePicture());
    this.job = button("Job file", "Repeats the experiment from the command line", () => this.send({ do: "job" }));
    this.command = make("code");
    const files = make("div", { class: "swarm-files" }, this.kind, this.csv, this.png, this.job, this.command);
    this.table = make("table");
    this.details = make("details", { toggle: () => this.#fill() }, make("summary", {}, "Table"), make("div", { class: "swarm-scroll" }, this.table));
    this.root.append(make("header", {}, this.title, this.of, this.stale), this.plot, this.note, this.fault, files, this.details);
  }

  #draw() {
    const about = this.#about;
    if (!about.axes) return;
    this.title.textContent = about.title;
    this.of.textContent = about.about;
    showText(this.stale, about.stale);
    showText(this.fault, about.fault);
    this.note.textContent = about.note;
    const lines = about.axes[1]?.labels.length ?? 0;
    this.kind.hidden = lines < 2 || lines > MOST_LINES;
    if (lines > MOST_LINES) this.#asLines = false;
    this.kind.textContent = this.#asLines ? "Heat map" : "Curves";
    this.csv.disabled = this.png.disabled = !about.runs;
    this.job.textContent = about.packed ? "Job file and maps" : "Job file";
    this.command.textContent = about.command;
    this.root.dataset.runs = about.runs;
    this.canvas.setAttribute("aria-label", `${about.title}: ${this.#isMap ? "heat map" : "curves"} of ${about.cells.length} settings; arrows point, Enter opens a setting on Watch; the table below has all numbers`);
    this.#onScreen();
    if (this.details.open) this.#fill();
    this.#point(this.#pointed);
  }

  #onScreen() {
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (!width || !height) return;
    const context = sizedContext(this.canvas, width, height), colours = PALETTE[themeAround(this.root)];
    this.#places = this.#drawInto(context, colours, { x: 0, y: 0, width, height });
    const place = this.#places[this.#pointed];
    if (!place || (!this.#isMap && this.#pointed < 0)) return;
    context.strokeStyle = colours.focus;
    context.lineWidth = 2;
    context.strokeRect(place.x + 1, place.y + 1, place.width - 2, place.height - 2);
  }

  #drawInto(context, colours, box) {
    const plot = new Plot(this.#about, !this.#isMap, context, colours);
    plot.draw(box);
    return plot.places;
  }

  /** The index of the cell at the pointer, -1 for none, also where CSS zooms the page. */
  #at(event) {
    const { left, top, width } = this.canvas.getBoundingClientRect(), zoom = width / this.plot.clientWidth;
    const [x, y] = [(event.clientX - left) / zoom, (event.clientY - top) / zoom];
    return this.#places.findIndex((one) => one && x >= one.x && x <= one.x + one.width && y >= one.y && y <= one.y + one.height);
  }

  #point(index) {
    const changed = index !== this.#pointed;
    this.#pointed = index;
    if (changed) this.#onScreen();
    const place = this.#places[index];
    this.canvas.style.cursor = place ? "pointer" : "default";
    this.tip.hidden = !place;
    if (!place) return;
    const lines = this.#words(index);
    this.tip.replaceChildren(...lines.map((line, k) => make(k ? "span" : "b", {}, line)));
    const { clientWidth: width, clientHeight: height } = this.plot, right = place.x + place.width + 8;
    const x = right + this.tip.offsetWidth > width ? place.x - this.tip.offsetWidth - 8 : right;
    this.tip.style.left = `${Math.max(0, x)}px`;
    this.tip.style.top = `${Math.max(0, Math.min(place.y, height - this.tip.offsetHeight))}px`;
  }

  #setting(index) {
    const { axes } = this.#about, rows = axes[1]?.labels.length ?? 1;
    return axes.map((axis, k) => `${axis.name} ${axis.labels[k ? index % rows : Math.floor(index / rows)]}`).join(", ");
  }

  #words(index) {
    const { cells, errors, measure, interval, seeds, runs } = this.#about, [mean, , , text, counted, done, failed] = cells[index];
    const lines = [this.#setting(index)];
    if (mean !== null) lines.push(`${measure}: ${text}`);
    if (cells[index][1] !== null) lines.push(interval);
    lines.push(`n = ${counted}: ${done} of ${seeds} runs done`);
    if (done - failed - counted > 0) lines.push(`in ${done - failed - counted} without a value`);
    if (failed) lines.push(`${failed} ended in an error: ${errors[index] ?? ""}`);
    if (runs) lines.push("press to open on Watch");
    return lines;
  }

  #key(event) {
    const rows = this.#about.axes[1]?.labels.length ?? 1, up = this.#about.axes[1]?.numbers ? 1 : -1;
    const move = { ArrowRight: rows, ArrowLeft: -rows, ArrowUp: up, ArrowDown: -up }[event.key];
    if (event.key === "Enter") this.#watch(this.#pointed);
    if (event.key === "Escape") this.#point(-1);
    if (!move) return;
    event.preventDefault();
    const next = this.#pointed < 0 ? 0 : this.#pointed + move;
    if (next >= 0 && next < this.#about.cells.length) this.#point(next);
  }

  #watch(index) {
    if (index >= 0 && this.#about.runs) this.send({ do: "watch", value: index });
  }

  #fill() {
    const about = this.#about;
    if (!this.details.open || this.#filled === about) return;
    this.#filled = about;
    const head = [...about.axes.map((axis) => axis.name), `${about.measure} [95 %]`, "n", "runs", "open"];
    const rows = about.cells.map(([, , , text, counted, done, failed], index) => {
      const rowsOf = about.axes[1]?.labels.length ?? 1, error = failed ? ` (${failed} failed: ${about.errors[index] ?? ""})` : "";
      const names = about.axes.map((axis, k) => make("th", { scope: "row" }, axis.labels[k ? index % rowsOf : Math.floor(index / rowsOf)]));
      const open = make("button", { type: "button", "aria-label": `Open ${this.#setting(index)} on Watch`, click: () => this.#watch(index) }, "Watch");
      return make("tr", {}, ...names, make("td", {}, text || "–"), make("td", {}, String(counted)), make("td", {}, `${done}${error}`), make("td", {}, about.runs ? open : ""));
    });
    const cells = head.map((text) => make("th", { scope: "col" }, text));
    this.table.replaceChildren(make("caption", {}, about.title), make("thead", {}, make("tr", {}, ...cells)), make("tbody", {}, ...rows));
  }

  #savePicture() {
    const { width, height, scale } = PAPER, canvas = make("canvas", { width: width * scale, height: height * scale });
    const context = canvas.getContext("2d"), colours = PALETTE.light, about = this.#about;
    context.scale(scale, scale);
    context.fillStyle = colours.field;
    context.fillRect(0, 0, width, height);
    Object.assign(context, { textAlign: "left", textBaseline: "top" });
    for (const [text, y, font, colour] of [[about.title, 16, "600 17px", colours.ink], [about.about, 41, "12px", colours.soft], [about.note, height - 26, "12px", colours.soft]]) {
      Object.assign(context, { font: `${font} ${FONT}`, fillStyle: colour });
      context.fillText(text, 20, y, width - 40);
    }
    this.#drawInto(context, colours, { x: 16, y: 66, width: width - 32, height: height - 104 });
    const name = about.command.split(" ").at(-1).replace(/\.toml$/, ".png");
    canvas.toBlob((blob) => save(name, blob), "image/png");
  }
}

export default shownBy(ExperimentView);
