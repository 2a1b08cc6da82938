/* Plays a recording on a Stage. Frames come in chunks (see viewing/frame_bytes.py), out of the page itself or from
   `mesa-swarm replay`; the page's element "about" has which of the two. Put behind canvas.js and
   elements.js. `window.mesaSwarmReplay` is for tests. */

import { Stage, TRAIL_STEPS, fillLegend, sameIds, togglesOf } from "./canvas.js";

const FRAMES_A_SECOND = 30;
const MOST_DECODED = 12;
const MOST_EVENTS = 1000;
const FASTEST = 31;
const BUDGET = 11;
const READINGS_EVERY = 100;
const PREDICTED = { pose: 2, loads: 2 };
const MARKS = { "fire out": "fire", "collision burst": "burst", merge: "merge" };
const find = (id) => document.getElementById(id);

/** Reads unsigned numbers that were written as differences, see `_coded` in viewing/frame_bytes.py. */
class Tracks {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  ints(count) { return this.#view(Int32Array, count); }
  floats(count) { return this.#view(Float32Array, count); }
  align() { this.at += -this.at & 3; }

  track(rows, values, size, order) {
    const { bytes, at } = this, count = rows * values, table = size === 2 ? new Uint16Array(count) : new Uint8Array(count);
    for (let j = 0; j < values; j++) {
      let value = 0, slope = 0;
      for (let t = 0, k = at + j * rows; t < rows; t++, k++) {
        const change = size === 2 ? bytes[k] | (bytes[k + count] << 8) : bytes[k];
        slope = order === 2 ? slope + change : change;
        value += slope;
        table[t * values + j] = value;
      }
    }
    this.at += count * size;
    return table;
  }

  #view(type, count) {
    const view = new type(this.bytes.buffer, this.bytes.byteOffset + this.at, count);
    this.at += 4 * count;
    return view;
  }
}

/** Rows within which no robot, fire or load is added or removed. */
class Segment {
  constructor(source, world) {
    const [rows, robots, sensors, fires, loads, contacts] = source.ints(6);
    this.world = world;
    this.rows = rows;
    this.counts = { robots, sensors, fires, loads };
    this.pictures = (world.fields ?? []).map(() => source.ints(2));
    this.steps = source.ints(rows);
    this.ids = source.ints(robots);
    this.indices = source.ints(loads);
    this.met = source.ints(contacts);
    this.shown = this.#ends(source.ints(world.parts ? rows : 0));
    this.discs = source.floats(3 * fires);
    this.peaks = source.floats(rows * this.pictures.length);
    this.parts = source.floats(4 * this.shown[this.shown.length - 1]);
    this.tracks = this.#tracks(source);
    this.contacts = this.#ends(source.track(rows, 1, 2, 1));
    this.azimuths = source.track(contacts, 1, 1, 1);
    this.fields = this.pictures.map(([high, wide]) => source.track(rows, high * wide, 1, 1));
    source.align();
  }

  frame(row) {
    const { robots, sensors } = this.counts, { world, tracks } = this;
    const of = (name, width) => tracks[name] && tracks[name].subarray(row * robots * width, (row + 1) * robots * width);
    const scaled = (part, scale) => part && Float32Array.from(part, scale);
    const signed = (part) => part && new Int8Array(part.buffer, part.byteOffset, part.length);
    const contacts = this.#contactsAt(row);
    return {
      step: this.steps[row],
      counts: { ...this.counts, contacts: contacts.length / 2 },
      ids: this.ids,
      pose: this.#poses(of("pose", 3)),
      distance: scaled(of("distance", sensors), (v) => (v === 255 ? -1 : (v / 254) * world.reach)),
      command: scaled(of("command", 2), (v) => ((v - 128) / 127) * world.fastest),
      heat: scaled(of("heat", 1), (v) => v / 200),
      heard: this.#places(of("heard", 2)),
      kind: signed(of("kind", sensors)),
      layer: signed(of("layer", 1)),
      design: signed(of("design", 1)),
      hot: signed(of("hot", 1)),
      value: signed(of("value", 1)),
      label: of("label", 12),
      fires: this.#firesAt(row),
      loads: this.#loadsAt(row),
      contacts,
      fields: this.fields.length ? this.#fieldsAt(row) : undefined,
      shown: this.world.parts ? this.parts.subarray(4 * this.shown[row], 4 * this.shown[row + 1]) : undefined,
    };
  }

  /** Return where robots were in a row: a point of a trail. */
  point(row) {
    const { robots } = this.counts;
    return { step: this.steps[row], ids: this.ids, values: this.#poses(this.tracks.pose.subarray(3 * row * robots, 3 * (row + 1) * robots)), stride: 3 };
  }

  #tracks(source) {
    const { robots, sensors, fires, loads } = this.counts, found = {};
    const widths = { command: 2, heard: 2, distance: sensors, kind: sensors, label: 12 };
    found.pose = source.track(this.rows, 3 * robots, 2, PREDICTED.pose);
    for (const { name, table, type } of this.world.columns) {
      if (table !== "robots" || name === "pose" || name === "ids") continue;
      const size = name === "heard" ? 2 : 1;
      found[name] = source.track(this.rows, robots * (widths[name] ?? 1), size, 1);
      if (type === "i1") found[name] = new Uint8Array(found[name]);
    }
    found.fires = source.track(this.rows, 3 * fires, 1, 1);
    found.loads = source.track(this.rows, 3 * loads, 2, PREDICTED.loads);
    return found;
  }

  #ends(counts) {
    const ends = new Int32Array(counts.length + 1);
    counts.forEach((count, row) => (ends[row + 1] = ends[row] + count));
    return ends;
  }

  #contactsAt(row) {
    const begin = this.contacts[row], count = this.contacts[row + 1] - begin, table = new Float32Array(2 * count);
    for (let k = 0; k < count; k++) {
      table[2 * k] = this.met[begin + k];
      table[2 * k + 1] = (this.azimuths[begin + k] / 256) * 2 * Math.PI;
    }
    return table;
  }

  #poses(part) {
    const [x0, y0, x1, y1] = this.world.bounds, poses = new Float32Array(part.length);
    for (let k = 0; k < part.length; k += 3) {
      poses[k] = x0 + (part[k] / 65535) * (x1 - x0);
      poses[k + 1] = y0 + (part[k + 1] / 65535) * (y1 - y0);
      poses[k + 2] = (part[k + 2] / 65536) * 2 * Math.PI;
    }
    return poses;
  }

  #places(part) {
    if (!part) return part;
    const [x0, y0, x1, y1] = this.world.bounds, low = [x0, y0], size = [x1 - x0, y1 - y0];
    return Float32Array.from(part, (v, k) => (v === 65535 ? NaN : low[k % 2] + (v / 65534) * size[k % 2]));
  }

  #fieldsAt(row) {
    return this.pictures.map(([rows, columns], k) => {
      const size = rows * columns, levels = this.fields[k].subarray(row * size, (row + 1) * size);
      return { rows, columns, peak: this.peaks[row * this.pictures.length + k], levels };
    });
  }

  #firesAt(row) {
    const count = this.counts.fires, table = new Float32Array(6 * count);
    for (let i = 0; i < count; i++) {
      const at = 3 * (row * count + i), [temperature, robots, out] = this.tracks.fires.subarray(at, at + 3);
      table.set(this.discs.subarray(3 * i, 3 * i + 3), 6 * i);
      table.set([temperature / 255, robots, out], 6 * i + 3);
    }
    return table;
  }

  #loadsAt(row) {
    const count = this.counts.loads, table = new Float32Array(4 * count);
    const poses = this.#poses(this.tracks.loads.subarray(3 * row * count, 3 * (row + 1) * count));
    for (let i = 0; i < count; i++) table.set([this.indices[i], ...poses.subarray(3 * i, 3 * i + 3)], 4 * i);
    return table;
  }
}

/** The frames of a recording by row; chunks are decoded on request, and the last few stay in memory. */
class Film {
  #decoded = new Map();
  #asked = new Map();

  constructor(about, load) {
    this.about = about;
    this.load = load;
  }

  /** Return the frame of a row if its chunk is at hand, else null. */
  at(row) { return this.#found(row, (segment, place) => segment.frame(place)); }

  /** Return the same of where robots were, as a point of a trail. */
  pointAt(row) { return this.#found(row, (segment, place) => segment.point(place)); }

  #found(row, read) {
    const place = Math.floor(row / this.about.chunk_rows), segments = this.#decoded.get(place);
    if (!segments) return null;
    this.#decoded.delete(place);
    this.#decoded.set(place, segments);
    let left = row - place * this.about.chunk_rows;
    for (const segment of segments) {
      if (left < segment.rows) return read(segment, left);
      left -= segment.rows;
    }
    return null;
  }

  /** Promise that the chunk of a row is at hand. */
  ready(row) {
    const place = Math.floor(row / this.about.chunk_rows);
    if (row < 0 || row >= this.about.rows || this.#decoded.has(place)) return Promise.resolve();
    if (!this.#asked.has(place)) this.#asked.set(place, this.#fetch(place).finally(() => this.#asked.delete(place)));
    return this.#asked.get(place);
  }

  async #fetch(place) {
    const source = new Tracks(await inflated(await this.load(place))), segments = [];
    while (source.at < source.bytes.length) segments.push(new Segment(source, this.about.world));
    this.#decoded.set(place, segments);
    if (this.#decoded.size > MOST_DECODED) this.#decoded.delete(this.#decoded.keys().next().value);
  }
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Return what loads chunks: out of the page, or from the server that it came from. */
function loader(about) {
  if (!about.embedded) {
    return async (place) => {
      const answer = await fetch(`chunk/${place}`);
      if (!answer.ok) throw new Error(await answer.text());
      return new Uint8Array(await answer.arrayBuffer());
    };
  }
  return async (place) => Uint8Array.from(atob(find(`chunk-${place}`).textContent), (c) => c.charCodeAt(0));
}

class Player {
  row = 0;
  playing = false;
  /** Whether playing begins again at the end. */
  repeats = false;
  events = [];
  #wanted = 0;
  #due = 0;
  #then = 0;
  #shown = [];
  #read = 0;
  // The row up to which the stage has trails.
  #traced = null;

  constructor(about) {
    this.about = about;
    this.film = new Film(about, loader(about));
    this.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    this.worlds = [about.world, ...about.later.map(({ step, ...own }) => ({ ...about.world, ...own }))];
    this.stage = new Stage(find("world"), about.world, {
      theme: this.theme,
      onSelect: () => this.report(true),
      onFollow: () => this.report(true),
    });
    this.describe();
    this.listen();
    this.setTheme(this.theme);
    this.setSpeed(Number(find("speed").value));
  }

  get last() { return this.about.rows - 1; }
  /** The row last requested; keys go on from there, although it may not be at hand yet. */
  get wanted() { return this.#wanted; }
  get step() { return this.about.first + this.row * this.about.every; }
  rowOf(step) { return Math.round((step - this.about.first) / this.about.every); }

  /** Show a row; promises that it is shown, or that another was wanted since. */
  async goTo(row) {
    const wanted = (this.#wanted = Math.min(Math.max(Math.round(row), 0), this.last));
    if (this.last < 0) return;
    try {
      await Promise.all([this.film.ready(wanted), this.stage.toggles.trails && this.film.ready(Math.max(0, wanted - this.#trailRows))]);
    } catch (error) {
      this.complain(error);
      return;
    }
    if (wanted === this.#wanted) this.showRow(wanted);
  }

  showRow(row) {
    const frame = this.film.at(row);
    if (!frame) return false;
    const from = this.enter(this.worlds[this.about.later.findLastIndex(({ step }) => step <= frame.step) + 1]) ? null : this.#traced;
    this.row = this.#wanted = row;
    frame.trail = this.stage.toggles.trails ? this.#trail(row, from) : undefined;
    this.#traced = frame.trail ? row : null;
    this.stage.show(frame);
    this.film.ready(row + this.about.chunk_rows).catch((error) => this.complain(error));
    this.report(!this.playing);
    return true;
  }

  /** Draw from now on a world in which other things stand, or other layers drive; return whether it is another. */
  enter(world) {
    if (world === this.stage.world) return false;
    this.stage.world = world;
    this.describeLayers();
    return true;
  }

  /** How many rows a trail reaches back. */
  get #trailRows() { return Math.ceil(TRAIL_STEPS / this.about.every); }

  /** Return the trail of a row: what goes on from the row that was drawn before, or all of it. */
  #trail(row, from) {
    const rows = this.#trailRows, more = from !== null && from <= row && row - from < rows, points = [];
    const { ids } = this.film.pointAt(row);
    for (let at = row; at >= Math.max(0, more ? from : row - rows); at--) {
      const point = this.film.pointAt(at);
      if (!point || !sameIds(point.ids, ids)) break;
      points.unshift(point);
    }
    return { more, points };
  }

  play() {
    if (this.playing || this.last < 1) return;
    this.playing = true;
    if (this.row >= this.last) this.goTo(0);
    this.#due = 0;
    this.#shown = [];
    this.#then = performance.now();
    this.showState();
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.playing = false;
    this.showState();
    this.report(true);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  stepBy(rows) {
    this.pause();
    return this.goTo(this.wanted + rows);
  }

  /** Go to the next event after this row, or the last before it. */
  jump(direction) {
    const rows = this.events.map((event) => this.rowOf(event.step));
    const there = direction > 0 ? rows.find((row) => row > this.wanted) : rows.findLast((row) => row < this.wanted);
    return there === undefined ? Promise.resolve() : this.goTo(there);
  }

  tick(now) {
    if (!this.playing) return;
    const elapsed = Math.min((now - this.#then) / 1000, 0.25);
    this.#then = now;
    if (this.speed === Infinity) this.playAll();
    else this.playRegulated(elapsed);
    if (this.row >= this.last && !this.repeats) {
      this.pause();
      return;
    }
    if (this.row >= this.last) this.goTo(0);
    requestAnimationFrame((next) => this.tick(next));
  }

  playRegulated(elapsed) {
    this.#due += elapsed * FRAMES_A_SECOND * this.speed;
    const rows = Math.floor(this.#due + 1e-6);
    if (rows > 0 && this.advance(Math.min(this.row + rows, this.last))) this.#due -= rows;
    this.#due = Math.min(this.#due, Math.max(1, 0.1 * FRAMES_A_SECOND * this.speed));
  }

  playAll() {
    const began = performance.now();
    while (this.row < this.last && performance.now() - began < BUDGET && this.advance(this.row + 1));
  }

  advance(row) {
    const before = this.row;
    if (!this.showRow(row)) {
      this.film.ready(row).catch((error) => this.complain(error));
      return false;
    }
    this.#shown.push([performance.now(), row - before]);
    return true;
  }

  complain(error) {
    this.pause();
    this.note(`What was recorded cannot be read here: ${error.message}`);
  }

  note(text) {
    if (![...find("notes").children].some((child) => child.textContent === text)) find("notes").append(make("p", {}, text));
  }

  setSpeed(value) {
    this.speed = value >= FASTEST ? Infinity : 10 ** (value / 10 - 1);
    const steps = FRAMES_A_SECOND * this.speed * this.about.every;
    const times = this.speed >= 10 ? Math.round(this.speed) : Number(this.speed.toPrecision(2));
    const text = this.speed === Infinity ? "as fast as it goes" : `${times}×, ${Number(steps.toPrecision(2))} steps/s`;
    find("speed-text").textContent = text;
    find("speed").setAttribute("aria-valuetext", text);
    this.#due = 0;
  }

  setTheme(theme) {
    this.theme = document.documentElement.dataset.theme = theme;
    this.stage.theme = theme;
    find("theme").setAttribute("aria-pressed", String(theme === "dark"));
    this.describeLayers();
  }

  /** The time that has passed in the model, behind its step, if it has a scale. */
  get simulated() {
    const { scale } = this.about.world, seconds = scale ? this.step * scale[1] : 0;
    if (!scale) return "";
    return seconds < 60 ? `, ${Number(seconds.toPrecision(3))} s` : `, ${clock(seconds)} min`;
  }

  /** Show the progress, at once or now and then. */
  report(now) {
    const scrub = find("scrub"), shown = `${this.step.toLocaleString("en")}${this.simulated}`, text = `step ${shown}`;
    scrub.value = String(this.row);
    scrub.style.setProperty("--done", `${this.last > 0 ? (100 * this.row) / this.last : 0}%`);
    find("step").textContent = shown;
    const time = performance.now();
    if (!now && time - this.#read < READINGS_EVERY) return;
    this.#read = time;
    scrub.setAttribute("aria-valuetext", text);
    find("time").textContent = `${clock(this.row / FRAMES_A_SECOND)} of ${clock(Math.max(this.last, 0) / FRAMES_A_SECOND)}`;
    this.#shown = this.#shown.filter(([then]) => time - then < 1000);
    const rows = this.#shown.reduce((sum, [, count]) => sum + count, 0), since = time - (this.#shown[0]?.[0] ?? time);
    const rate = since > 250 ? ((rows - this.#shown[0][1]) * this.about.every * 1000) / since : 0;
    find("rate").textContent = this.playing && rate ? `${rate < 10 ? rate.toFixed(1) : Math.round(rate)} steps/s` : "–";
    this.showLayers();
    this.showRobot();
    this.showEvent();
  }

  showState() {
    const label = this.playing ? "Pause" : "Play";
    find("play").dataset.icon = label.toLowerCase();
    find("play").setAttribute("aria-label", label);
    find("play").title = `${label} (space)`;
  }

  showLayers() {
    const { layer } = this.stage.frame ?? {}, counts = this.stage.world.layers.map(() => 0);
    this.describeLayers();
    if (!layer) return;
    for (const index of layer) if (index >= 0) counts[index] += 1;
    document.querySelectorAll("#layers li b").forEach((cell, index) => (cell.textContent = String(counts[index])));
  }

  showRobot() {
    const { frame, selected: id, followed } = this.stage, row = id === null || !frame ? -1 : frame.ids.indexOf(id);
    find("robot").hidden = row < 0;
    if (row < 0) return;
    const [x, y, heading] = frame.pose.subarray(3 * row, 3 * row + 3), degrees = (heading * 180) / Math.PI;
    find("robot-name").textContent = `Robot ${id}`;
    const facts = { position: `${x.toFixed(1)}, ${y.toFixed(1)}`, heading: `${Math.round(degrees + 360) % 360}°` };
    if (frame.layer) facts.layer = this.stage.world.layers[frame.layer[row]] ?? (frame.layer[row] < 0 ? "none" : frame.layer[row]);
    if (frame.heat && frame.counts.fires) facts.heat = `${Math.round(100 * frame.heat[row])} %`;
    if (frame.distance) facts.nearest = nearest(frame, row, this.stage.world.kinds);
    fill(find("robot-facts"), facts);
    find("follow").setAttribute("aria-pressed", String(followed === id));
  }

  showEvent() {
    const rows = this.events.map((event) => this.rowOf(event.step)), now = rows.findLastIndex((row) => row <= this.row);
    document.querySelectorAll("#events button").forEach((button, index) => {
      if (index === now) button.setAttribute("aria-current", "true");
      else button.removeAttribute("aria-current");
    });
  }

  /** Write down once what the recording is of. */
  describe() {
    const { about } = this, { world } = about;
    document.title = `${about.model}: replay`;
    find("model").textContent = spaced(about.model);
    fill(find("facts"), { map: world.map, seed: about.seed, steps: `${about.first} to ${about.first + this.last * about.every}` });
    fill(find("parameters"), about.parameters);
    find("parameters-title").hidden = !Object.keys(about.parameters).length;
    find("scrub").max = String(Math.max(this.last, 0));
    find("world").setAttribute("aria-label", `The world of ${spaced(about.model)}, drawn to scale`);
    about.notes.forEach((text) => this.note(text));
    if (this.last < 0) this.note("Not one whole step was recorded.");
    this.describeLayers();
    const known = new Set(world.columns.map((column) => column.name));
    const needs = { sectors: "distance", perceived: "kind", layers: "layer", heat: "heat", messages: "heard" };
    for (const { name, label, on } of togglesOf(world)) {
      if (!needs[name] || known.has(needs[name])) find("toggles").append(this.toggleItem(name, label, on));
    }
  }

  describeLayers() {
    fillLegend(find("layers"), this.stage.layers());
    fillLegend(find("colours"), this.stage.legend().filter(({ form }) => form !== "layer" && form !== "disc"));
    for (const name of ["layers", "colours"]) find(name).parentElement.hidden = !find(name).children.length;
  }

  /** Take away the switches of what this world has none of. */
  hideIdleToggles() {
    const { counts } = this.stage.frame ?? { counts: {} };
    const idle = [...(counts.fires ? [] : ["heat", "labels"]), ...(counts.sensors ? [] : ["sectors", "perceived"])];
    for (const name of idle) document.querySelector(`#toggles [name="${name}"]`)?.parentElement.remove();
  }

  toggleItem(name, label, on) {
    const change = ({ target }) => {
      this.stage.set(name, target.checked);
      if (name === "trails") this.goTo(this.row);
      this.describeLayers();
    };
    const box = make("input", { type: "checkbox", name, checked: on, change });
    return make("label", { title: label, class: name.startsWith("fields.") && "wide" }, box, make("span", {}, label));
  }

  showEvents(events) {
    this.events = events;
    find("events-title").textContent = events.length ? `Events (${events.length})` : "No events";
    for (const event of events.slice(0, MOST_EVENTS)) {
      const kind = MARKS[event.kind] ?? "", row = this.rowOf(event.step), place = make("span", {}, event.step.toLocaleString("en"));
      const button = make("button", { type: "button", class: kind, click: () => this.goTo(row) }, place, event.text);
      const mark = make("i", { class: kind, title: `step ${event.step}: ${event.text}` });
      mark.style.left = `${this.last > 0 ? (100 * row) / this.last : 0}%`;
      find("events").append(make("li", {}, button));
      find("marks").append(mark);
    }
    if (events.length > MOST_EVENTS) this.note(`Of ${events.length} events the first ${MOST_EVENTS} are listed.`);
    this.showEvent();
  }

  listen() {
    const actions = {
      play: () => this.toggle(),
      back: () => this.stepBy(-1),
      forth: () => this.stepBy(1),
      first: () => this.goTo(0),
      last: () => this.goTo(this.last),
      previous: () => this.jump(-1),
      next: () => this.jump(1),
      fit: () => this.fit(),
      closer: () => this.stage.zoom(1.5),
      farther: () => this.stage.zoom(1 / 1.5),
      theme: () => this.setTheme(this.theme === "dark" ? "light" : "dark"),
      follow: () => this.stage.follow(this.stage.followed === this.stage.selected ? null : this.stage.selected),
      full: () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()),
      fold: () => find("fold").setAttribute("aria-expanded", String(find("fold").getAttribute("aria-expanded") !== "true")),
    };
    for (const [id, act] of Object.entries(actions)) find(id).addEventListener("click", act);
    find("full").hidden = !document.fullscreenEnabled;
    find("scrub").addEventListener("input", (event) => this.goTo(Number(event.target.value)));
    find("speed").addEventListener("input", (event) => this.setSpeed(Number(event.target.value)));
    // After a click the keys are the player's again; with the keyboard the focus stays on the button.
    document.addEventListener("click", (event) => event.detail && event.target.closest?.("button, label")?.blur());
    const keys = {
      " ": "play", ArrowLeft: "back", ArrowRight: "forth", Home: "first", End: "last", n: "next", p: "previous",
      f: "fit", "+": "closer", "-": "farther",
    };
    document.addEventListener("keydown", (event) => {
      const { target, key } = event, name = keys[key.length === 1 ? key.toLowerCase() : key];
      const slides = target.matches("#speed") && /^(Arrow|Home$|End$)/.test(key);
      const own = slides || (key === " " && target.matches("button, summary, input[type=checkbox]"));
      if (!name || own || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      if (event.shiftKey && /^Arrow/.test(key)) this.stepBy(name === "back" ? -10 : 10);
      else actions[name]();
    });
  }

  fit() {
    this.stage.follow(null);
    this.stage.fit();
  }
}

function fill(list, facts) {
  const rows = Object.entries(facts).map(([name, value]) => [make("dt", {}, name.replaceAll("_", " ")), make("dd", {}, String(value))]);
  list.replaceChildren(...rows.flat());
}

function nearest({ distance, kind, counts }, row, kinds) {
  const readings = [...distance.subarray(row * counts.sensors, (row + 1) * counts.sensors)];
  const least = readings.reduce((best, read, s) => (read >= 0 && (best < 0 || read < readings[best]) ? s : best), -1);
  const names = kinds ?? ["obstacle", "robot", "fire", "load"];
  return least < 0 ? "nothing in sight" : `${names[kind[row * counts.sensors + least]] ?? "something"} at ${readings[least].toFixed(1)}`;
}

function clock(seconds) {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function spaced(name) {
  return name.replace(/(?<=[a-z0-9])(?=[A-Z])/g, " ");
}

/** In a frame of another page the world is shown with few buttons, and plays until it is paused, unless the system requests less motion. */
function embed(player) {
  document.documentElement.dataset.embedded = "true";
  find("whole").hidden = false;
  player.repeats = true;
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
}

async function start() {
  const about = JSON.parse(find("about").textContent), player = new Player(about);
  player.showState();
  globalThis.mesaSwarmReplay = player;
  await player.goTo(0);
  player.hideIdleToggles();
  player.showEvents(about.embedded ? about.events : await (await fetch("events")).json());
  if (self !== top || location.hash === "#embedded") embed(player);
  document.documentElement.dataset.ready = "true";
}

start();
