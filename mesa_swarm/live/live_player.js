/* Lets a model run on its page: drawn on a Stage, with buttons, sliders, readings and a chart. Put behind canvas.js,
   elements.js and live.js. `window.swarm` is for programs, see docs/live_pages.md. */

import { Stage, fillLegend, togglesOf } from "../viewing/canvas.js";
import { LiveModel, added, inflatedText } from "./live.js";

const FASTEST = 31;
const BUDGET = 12;
const READINGS_EVERY = 100;
const MOST_POINTS = 4000;
const MOST_NUMBERS = 4;
const MOST_LISTED_DISCS = 40;
// In a frame of another page the world is shown with few buttons, and plays, unless the system requests less motion.
const EMBEDDED = self !== top || location.hash.includes("embedded");
const find = (id) => document.getElementById(id);
const asText = (number) => (Number.isInteger(number) ? number.toLocaleString("en") : String(Number(number.toPrecision(4))));
const inWords = (name) => name.replaceAll("_", " ");

/** The typed arrays of a frame, made of the columns of a model. */
class Frames {
  #peaks = new Map();

  constructor(model, world) {
    this.model = model;
    this.world = world;
    const runs = world.robots, n = model.start.robots;
    this.ids = new Int32Array(n);
    this.design = new Int8Array(n);
    let row = 0;
    for (const [first, last, design] of runs) for (let id = first; id <= last && row < n; id++, row++) {
      this.ids[row] = id;
      this.design[row] = design;
    }
  }

  frame() {
    const { model, ids, design } = this, { columns, robots } = model.start, has = (name) => name in columns;
    const sensors = has("distance") ? columns.distance[2][1] : 0, fires = model.start.fires?.discs.length ?? 0;
    const single = (name) => (has(name) ? Float32Array.from(model.column(name)) : undefined);
    const small = (name) => (has(name) ? Int8Array.from(model.column(name)) : undefined);
    const heat = single("temperature");
    return {
      step: model.steps,
      counts: { robots, sensors, fires, loads: this.world.loads.length, contacts: 0 },
      ids, design,
      pose: this.#poses(),
      distance: sensors ? single("distance") : undefined,
      kind: sensors ? small("kind") : undefined,
      command: this.#command(),
      layer: small("layer"),
      hot: small("hot"),
      heat: heat?.map((number) => number / this.world.leave),
      heard: single("heard_from"),
      value: this.#values(),
      fires: this.#fires(fires),
      loads: this.#loads(),
      shown: this.model.start.shown.length ? this.model.shown : undefined,
      fields: this.world.fields?.map((name) => this.#picture(name)),
      contacts: new Float32Array(0),
    };
  }

  #poses() {
    const places = this.model.column("position"), headings = this.model.column("heading");
    const poses = new Float32Array(3 * headings.length);
    headings.forEach((heading, i) => poses.set([places[2 * i], places[2 * i + 1], heading], 3 * i));
    return poses;
  }

  #command() {
    const found = this.model.start.columns.command;
    if (!found) return undefined;
    const width = found[2][1], all = this.model.column("command");
    return Float32Array.from({ length: 2 * found[2][0] }, (_, k) => all[width * (k >> 1) + (k & 1)]);
  }

  /** The index of the colour of each robot, where the model's looks name a column. */
  #values() {
    const { look } = this.model.about, found = look && this.model.start.columns[look.name];
    if (!found) return undefined;
    const { low, high } = look, steps = this.world.looks.column.light.length - 1;
    return Int8Array.from(this.model.column(look.name), (number) => {
      const share = (number - low) / (high - low);
      return Number.isNaN(share) ? -1 : Math.floor(Math.min(Math.max(share, 0), 1) * steps + 0.5);
    });
  }

  #loads() {
    const table = new Float32Array(4 * this.world.loads.length);
    this.world.loads.forEach(({ id }, index) => table.set([index, ...(this.model.body(id) ?? [NaN, NaN, 0])], 4 * index));
    return table;
  }

  /** The values of a field as shares of its largest value so far, pale ones enhanced as in recordings. */
  #picture(name) {
    const found = this.model.start.columns[`fields.${name}`];
    if (!found) return { rows: 0, columns: 0, peak: 0, levels: new Uint8Array(0) }; // a picture that a part makes
    const [rows, columns] = found[2], values = this.model.column(`fields.${name}`);
    const peak = Math.max(this.#peaks.get(name) ?? 0, ...values);
    this.#peaks.set(name, peak);
    return { rows, columns, peak, levels: Uint8Array.from(values, (value) => (peak > 0 ? Math.round(255 * Math.sqrt(value / peak)) : 0)) };
  }

  #fires(count) {
    const table = new Float32Array(6 * count), { fires } = this.model.start;
    for (let i = 0; i < count; i++) {
      const [temperature, visitors, out] = this.model.fire(i);
      table.set([...fires.discs[i], temperature, visitors, out], 6 * i);
    }
    return table;
  }
}

class LivePlayer {
  playing = false;
  #due = 0;
  #then = 0;
  #read = 0;
  #taken = [];
  #points = [];
  #curve = 0;
  #changed;

  constructor(about, model, worlds) {
    this.about = about;
    this.model = model;
    this.worlds = worlds;
    this.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
    this.stage = new Stage(find("world"), this.world, {
      theme: this.theme,
      onSelect: () => this.report(true),
      onFollow: () => this.report(true),
    });
    this.frames = new Frames(model, this.world);
    this.describe();
    this.listen();
    this.setTheme(this.theme);
    find("speed").value = String(Math.min(Math.round(10 * Math.log10(about.speed)), FASTEST - 1));
    this.setSpeed(Number(find("speed").value));
    this.restore();
  }

  /** The world, with the discs that were added and without those taken away. */
  get world() { return this.#changed ?? this.worlds.get(this.model.key); }

  /** Begin anew. */
  reset(wanted = {}) {
    const before = this.world;
    this.model.reset(wanted);
    this.stage.tool?.cancel();
    this.#changed = undefined;
    if (this.world !== before) this.stage.world = this.world;
    this.frames = new Frames(this.model, this.world);
    this.describeFires();
    this.describeDiscs();
    this.#points = [];
    find("seed").value = String(this.model.seed);
    find("over").hidden = true;
    find("hash").textContent = "";
    this.remember();
    this.show(true);
  }

  /** Begin anew with another seed or another parameter of the beginning. */
  begin(wanted) {
    try {
      this.reset(wanted);
    } catch (error) {
      this.complain(error);
    }
    this.showSettings();
    find("seed").value = String(this.model.seed);
  }

  /** Take steps and draw them. */
  step(count = 1) {
    this.pause();
    this.advance(count);
    this.show(true);
  }

  advance(count) {
    let taken;
    try {
      taken = this.model.step(count);
    } catch (error) {
      this.complain(error);
      return 0;
    }
    if (this.stage.toggles.trails) this.#points.push({ step: this.model.steps, values: this.frames.frame().pose, stride: 3 });
    if (this.#points.length > 100) this.#points.splice(0, this.#points.length - 100);
    if (this.model.ended) this.end();
    return taken;
  }

  end() {
    const over = find("over"), text = `The run has ended at step ${this.model.steps.toLocaleString("en")}.`;
    over.replaceChildren(`${text} `, make("button", { type: "button", click: () => this.reset() }, "Again"));
    over.hidden = false;
    this.pause();
  }

  show(now) {
    const frame = this.frames.frame();
    frame.trail = this.stage.toggles.trails ? { more: false, points: this.#points } : undefined;
    this.stage.show(frame);
    this.report(now);
  }

  play() {
    if (this.playing) return;
    if (this.model.ended) this.reset();
    this.playing = true;
    this.#due = 0;
    this.#then = performance.now();
    this.#taken = [];
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

  tick(now) {
    if (!this.playing) return;
    const elapsed = Math.min((now - this.#then) / 1000, 0.25), before = this.model.steps;
    this.#then = now;
    this.#due = this.speed === Infinity ? 1e9 : this.#due + elapsed * this.speed;
    const began = performance.now(), single = this.stage.toggles.trails;
    while (this.playing && this.#due >= 1 && performance.now() - began < BUDGET) {
      const taken = this.advance(single ? 1 : Math.min(Math.floor(this.#due), 20));
      if (!taken) break;
      this.#due -= taken;
    }
    if (this.speed !== Infinity) this.#due = Math.min(this.#due, Math.max(1, 0.1 * this.speed));
    this.#taken.push([now, this.model.steps - before]);
    this.show(false);
    if (this.playing) requestAnimationFrame((next) => this.tick(next));
  }

  complain(error) {
    this.pause();
    if (![...find("notes").children].some((child) => child.textContent === error.message)) find("notes").append(make("p", {}, error.message));
  }

  setSpeed(value) {
    this.speed = value >= FASTEST ? Infinity : 10 ** (value / 10);
    const text = this.speed === Infinity ? "as fast as it goes" : `${asText(Number(this.speed.toPrecision(2)))} steps a second`;
    find("speed-text").textContent = text;
    find("speed").setAttribute("aria-valuetext", text);
    this.#due = 0;
  }

  setTheme(theme) {
    this.theme = document.documentElement.dataset.theme = theme;
    this.stage.theme = theme;
    find("theme").setAttribute("aria-pressed", String(theme === "dark"));
    this.describeLayers();
    this.drawChart();
  }

  /** Change a parameter, and show it beside its slider. */
  change(name, value) {
    try {
      this.model.set(name, value);
    } catch (error) {
      this.complain(error);
      return;
    }
    this.showSettings();
    this.remember();
    find("hash").textContent = "";
  }

  showSettings() {
    const now = this.model.parameters;
    for (const { name } of this.about.begins) find(`set-${name}`).value = String(now[name]);
    for (const { name } of this.about.parameters) {
      const value = this.model.value(name), control = find(`set-${name}`);
      control.value = String(value);
      const output = find(`now-${name}`);
      if (output) output.textContent = asText(value);
    }
  }

  /** Put the settings into the address, and take them from there. */
  remember() {
    if (EMBEDDED) return;
    const settings = new URLSearchParams();
    if (this.model.seed !== this.about.seed) settings.set("seed", this.model.seed);
    const now = this.model.parameters;
    for (const { name, value } of [...this.about.begins, ...this.about.parameters]) if (now[name] !== value) settings.set(name, now[name]);
    const text = settings.toString();
    try {
      history.replaceState(null, "", text ? `#${text}` : location.pathname + location.search);
    } catch { /* in a frame without an address of its own */ }
  }

  restore() {
    for (const [name, text] of new URLSearchParams(location.hash.slice(1))) {
      if (name === "embedded") continue;
      try {
        const begins = this.about.begins.find((one) => one.name === name);
        if (name === "seed") this.model.reset({ seed: Number(text) });
        else if (begins) this.model.reset({ [name]: typeof begins.value === "string" ? text : Number(text) });
        else this.model.set(name, this.about.parameters.find((one) => one.name === name)?.options ? text : Number(text));
      } catch (error) {
        this.complain(error);
      }
    }
    this.showSettings();
    this.reset();
  }

  /** Show the progress, at once or now and then. */
  report(now) {
    find("step").textContent = this.model.steps.toLocaleString("en");
    const time = performance.now();
    if (!now && time - this.#read < READINGS_EVERY) return;
    this.#read = time;
    this.#taken = this.#taken.filter(([then]) => time - then < 1000);
    const steps = this.#taken.reduce((sum, [, count]) => sum + count, 0), since = time - (this.#taken[0]?.[0] ?? time);
    find("rate").textContent = this.playing && since > 250 ? `${asText(Math.round((steps * 1000) / since))} steps/s` : "–";
    this.showLayers();
    this.showRobot();
    this.showReadings();
    this.showFires();
  }

  showState() {
    const label = this.playing ? "Pause" : "Play";
    find("play").dataset.icon = label.toLowerCase();
    find("play").setAttribute("aria-label", label);
    find("play").title = `${label} (space)`;
  }

  showReadings() {
    const { last: numbers } = this.model.series;
    document.querySelectorAll("#readings b").forEach((cell) => {
      const { row, event } = cell.dataset, last = event === undefined ? numbers[Number(row)] : this.model.events.counts[Number(event)];
      cell.textContent = last === undefined ? "–" : asText(last);
    });
    this.drawChart();
  }

  drawChart() {
    const canvas = find("chart"), values = this.model.series.values[this.#curve];
    if (!values) return;
    const context = canvas.getContext("2d"), { width, height } = canvas, { steps } = this.model.series;
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(`--swarm-${name}`).trim();
    const every = Math.max(1, Math.ceil(values.length / MOST_POINTS)), shown = values.filter((_, k) => k % every === 0);
    const finite = shown.filter(Number.isFinite), low = Math.min(0, ...finite), highest = Math.max(0, ...finite), high = highest > low ? highest : low + 1;
    const top = 30, left = 8, bottom = 26, x = (k) => left + ((width - 2 * left) * k) / Math.max(shown.length - 1, 1);
    const y = (value) => height - bottom - ((height - top - bottom) * (value - low)) / (high - low);
    context.clearRect(0, 0, width, height);
    context.strokeStyle = colour("line");
    context.beginPath();
    for (const value of [low, high]) { context.moveTo(left, y(value)); context.lineTo(width - left, y(value)); }
    context.stroke();
    context.strokeStyle = colour("accent");
    context.lineWidth = 2.5;
    context.beginPath();
    let down = false;
    shown.forEach((value, k) => {
      if (!Number.isFinite(value)) { down = false; return; }
      context[down ? "lineTo" : "moveTo"](x(k), y(value));
      down = true;
    });
    context.stroke();
    context.fillStyle = colour("soft");
    context.font = "20px system-ui, sans-serif";
    context.fillText(asText(high), left + 2, top - 8);
    context.fillText(`${asText(steps[0] ?? 0)} to ${asText(steps.at(-1) ?? 0)} steps`, left + 2, height - 5);
    const name = inWords(this.model.start.rows.names[this.#curve]);
    canvas.setAttribute("aria-label", `${name} over the steps: now ${asText(values.at(-1) ?? 0)}, at most ${finite.length ? asText(Math.max(...finite)) : 0}`);
  }

  showLayers() {
    const { layer } = this.stage.frame ?? {}, counts = this.world.layers.map(() => 0);
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
    if (frame.layer) facts.layer = this.world.layers[frame.layer[row]] ?? "none";
    if (frame.heat && frame.counts.fires) facts.heat = `${Math.round(100 * frame.heat[row])} %`;
    if (frame.distance) facts.nearest = nearest(frame, row, this.world.kinds);
    fill(find("robot-facts"), facts);
    if (find("robot-columns").parentElement.open) fill(find("robot-columns"), this.numbersOf(row));
    find("follow").setAttribute("aria-pressed", String(followed === id));
  }

  /** Return what a robot's columns hold. */
  numbersOf(row) {
    const { columns, robots } = this.model.start, facts = {};
    for (const [name, [, , shape]] of Object.entries(columns)) {
      const width = shape.slice(1).reduce((product, length) => product * length, 1);
      if (shape[0] !== robots || width < 1) continue;
      const numbers = [...this.model.column(name).subarray(row * width, (row + 1) * width)];
      facts[name] = numbers.slice(0, MOST_NUMBERS).map((number) => asText(number)).join(", ") + (width > MOST_NUMBERS ? ", …" : "");
    }
    return facts;
  }

  /** Write down once what the page is of. */
  describe() {
    const { about, world } = this;
    const { title } = about;
    document.title = title;
    find("model").textContent = title;
    const changeable = new Set(about.begins.map(({ name }) => name));
    const others = Object.fromEntries(Object.entries(about.fixed).filter(([name]) => !changeable.has(name)));
    fill(find("facts"), { map: world.map, robots: this.model.start.robots, ...others });
    find("world").setAttribute("aria-label", `The world of ${title}, drawn to scale`);
    find("seed").replaceChildren(...about.starts.filter((start) => !start.with).map(({ seed }) => make("option", { value: String(seed) }, about.assembled ? "own" : String(seed))));
    this.describeReadings();
    this.describeSettings();
    this.describeFires();
    this.describeDiscs();
    const known = new Set(world.columns.map((column) => column.name)), { sensors, fires } = this.frames.frame().counts;
    const needs = { sectors: "distance", perceived: "kind", layers: "layer", heat: "heat", messages: "heard" };
    const idle = new Set([...(fires ? [] : ["heat", "labels"]), ...(sensors ? [] : ["sectors", "perceived"]), ...(about.radio ? [] : ["messages"]), "contacts"]);
    for (const { name, label, on } of togglesOf(world)) {
      if (!idle.has(name) && (!needs[name] || known.has(needs[name]))) find("toggles").append(this.toggleItem(name, label, on));
    }
  }

  describeReadings() {
    const names = this.model.start.rows?.names ?? [], general = ["collisions", "total_collisions"];
    const events = this.model.events.names;
    find("measures").hidden = !names.length && !events.length;
    // What the model itself counts stands before what every model does.
    const order = [...names.keys()].sort((one, other) => general.includes(names[one]) - general.includes(names[other]));
    this.#curve = order[0] ?? 0;
    order.forEach((k) => {
      const name = names[k];
      const choose = () => {
        this.#curve = k;
        for (const other of document.querySelectorAll("#readings button")) other.setAttribute("aria-pressed", String(other === button));
        this.drawChart();
      };
      const button = make("button", { type: "button", "aria-pressed": String(k === this.#curve), title: "Show its chart", click: choose }, inWords(name));
      find("readings").append(make("li", {}, button, make("b", { "data-row": String(k) }, "–")));
    });
    events.forEach((name, k) => {
      const text = make("span", { title: "How many such events there were" }, `events: ${inWords(name)}`);
      find("readings").append(make("li", {}, text, make("b", { "data-event": String(k) }, "–")));
    });
  }

  /** Make a button for each fire, to put it out and light it again. */
  describeFires() {
    const discs = this.model.start.fires?.discs ?? [], largest = Math.max(...discs.map(([, , radius]) => radius));
    find("burning").hidden = !discs.length;
    find("fires").replaceChildren(...discs.map(([, , radius], place) => {
      const name = `fire ${place + 1}${radius === largest ? ", the largest" : ""}`;
      const button = make("button", { type: "button", "data-fire": String(place), click: () => this.burn(place, this.model.fire(place)[2] === 1) });
      return make("li", {}, make("span", {}, name), make("b", {}, ""), button);
    }));
  }

  /** Light a fire, or put it out. */
  burn(place, burns) {
    try {
      this.model.burn(place, burns);
    } catch (error) {
      this.complain(error);
    }
    find("hash").textContent = "";
    this.show(true);
  }

  /** List the discs, each with a button that takes it away. */
  describeDiscs() {
    const { spare, discs } = this.model;
    for (const id of ["blocking", "place"]) find(id).hidden = !spare;
    if (!spare) {
      if (find("place").getAttribute("aria-pressed") === "true") this.handle("place", false);
      return;
    }
    find("discs-left").textContent = `${spare.left} more can be added`;
    const [left, low, right, high] = this.world.bounds, middle = { x: (left + right) / 2, y: (low + high) / 2, radius: spare.largest / 3 };
    const limits = { x: [left, right], y: [low, high], radius: [0, spare.largest] };
    for (const [name, [least, most]] of Object.entries(limits)) {
      const input = find("disc").elements[name];
      Object.assign(input, { min: least, max: most });
      if (!input.value) input.value = String(Number(middle[name].toPrecision(3)));
    }
    const added = new Set(this.model.start.discs.spare), listed = [...discs].sort(([one], [other]) => added.has(other) - added.has(one));
    find("discs").replaceChildren(...listed.slice(0, MOST_LISTED_DISCS).map(([number, x, y, radius]) => {
      const text = `${x.toFixed(0)}, ${y.toFixed(0)}; radius ${asText(radius)}`;
      const button = make("button", { type: "button", "data-disc": String(number), "aria-label": `Take away the disc at ${text}`, click: () => this.removeListed(number) }, "Remove");
      return make("li", {}, make("span", {}, text), button);
    }));
    if (listed.length > MOST_LISTED_DISCS) find("discs").append(make("li", {}, `and ${listed.length - MOST_LISTED_DISCS} more: choose Place discs, and click on one`));
  }

  /** Add a disc; return its number, -1 where there is no room. */
  addDisc(x, y, radius) {
    const number = this.model.addDisc(x, y, radius);
    if (number >= 0) this.showDiscs();
    return number;
  }

  removeDisc(number) {
    this.model.removeDisc(number);
    this.showDiscs();
  }

  /** Take a disc away by its button; the next one has the focus then. */
  removeListed(number) {
    const buttons = [...find("discs").querySelectorAll("button")], place = buttons.findIndex((one) => one.dataset.disc === String(number));
    this.removeDisc(number);
    const left = find("discs").querySelectorAll("button");
    (left[Math.min(place, left.length - 1)] ?? find("disc").querySelector("button")).focus();
  }

  /** Add a disc by hand: what is wrong with it is written on the page. */
  tryDisc(x, y, radius) {
    try {
      if (this.addDisc(x, y, radius) < 0) throw new Error(`a robot is in the way of the disc at ${x.toFixed(0)}, ${y.toFixed(0)}; place it elsewhere`);
    } catch (error) {
      this.complain(error);
    }
  }

  /** Draw the discs as they are now. */
  showDiscs() {
    const base = this.worlds.get(this.model.key), own = new Set(this.model.start.discs.own);
    let row = -1;
    const kept = base.shapes.filter(({ disc, mark }) => {
      if (disc && !mark) row++;
      return !disc || mark || !own.has(row);
    });
    this.#changed = { ...base, shapes: [...kept, ...this.model.discs.map(([, ...disc]) => ({ disc }))] };
    this.stage.world = this.#changed;
    this.#points = [];
    find("hash").textContent = "";
    this.describeDiscs();
    this.show(true);
  }

  showFires() {
    for (const button of document.querySelectorAll("#fires button")) {
      const [temperature, robots, out] = this.model.fire(Number(button.dataset.fire));
      button.textContent = out ? "Light" : "Put out";
      button.previousSibling.textContent = out ? "out" : `${Math.round(100 * temperature)} %`;
      button.title = out ? "It is out" : `${robots} robots fight it`;
    }
  }

  describeSettings() {
    const { begins, parameters } = this.about;
    find("sliders").hidden = !parameters.length && !begins.length;
    for (const parameter of begins) find("settings").append(this.beginningOf(parameter));
    for (const parameter of parameters) find("settings").append(parameter.options ? this.choiceOf(parameter) : this.sliderOf(parameter));
  }

  choiceOf({ name, help, options }) {
    const select = make("select", { id: `set-${name}`, change: ({ target }) => this.change(name, target.value) });
    select.append(...options.map((option) => make("option", { value: option }, option)));
    return make("label", {}, make("span", {}, inWords(name)), select, make("small", {}, help));
  }

  beginningOf({ name, help, value, values }) {
    const change = ({ target }) => this.begin({ [name]: typeof value === "string" ? target.value : Number(target.value) });
    const select = make("select", { id: `set-${name}`, change });
    select.append(...values.map((one) => make("option", { value: String(one) }, String(one))));
    return make("label", {}, make("span", {}, inWords(name)), select, make("small", {}, `${help}; begins anew`));
  }

  sliderOf({ name, help, minimum, maximum, step, values }) {
    const change = ({ target }) => {
      const number = Number(target.value);
      this.change(name, values ? values.reduce((best, other) => (Math.abs(other - number) < Math.abs(best - number) ? other : best)) : number);
    };
    const input = make("input", { type: "range", id: `set-${name}`, min: String(minimum), max: String(maximum), step: String(step), input: change });
    return make("label", {}, make("span", {}, inWords(name)), make("output", { id: `now-${name}`, for: `set-${name}` }), input, make("small", {}, help));
  }

  describeLayers() {
    fillLegend(find("layers"), this.stage.layers());
    fillLegend(find("colours"), this.stage.legend().filter(({ form }) => form !== "layer" && form !== "disc"));
    for (const name of ["layers", "colours"]) find(name).parentElement.hidden = !find(name).children.length;
  }

  toggleItem(name, label, on) {
    const change = ({ target }) => {
      this.stage.set(name, target.checked);
      if (name === "trails") this.#points = [];
      this.show(true);
      this.describeLayers();
    };
    const box = make("input", { type: "checkbox", name, checked: on, change });
    return make("label", { title: label, class: name.startsWith("fields.") && "wide" }, box, make("span", {}, label));
  }

  listen() {
    const actions = {
      play: () => this.toggle(),
      reset: () => this.reset(),
      forth: () => this.step(1),
      fit: () => this.fit(),
      closer: () => this.stage.zoom(1.5),
      farther: () => this.stage.zoom(1 / 1.5),
      theme: () => this.setTheme(this.theme === "dark" ? "light" : "dark"),
      follow: () => this.stage.follow(this.stage.followed === this.stage.selected ? null : this.stage.selected),
      hand: () => this.handle("hand", find("hand").getAttribute("aria-pressed") !== "true"),
      place: () => this.model.spare && this.handle("place", find("place").getAttribute("aria-pressed") !== "true"),
      full: () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()),
      fold: () => find("fold").setAttribute("aria-expanded", String(find("fold").getAttribute("aria-expanded") !== "true")),
      fingerprint: () => (find("hash").textContent = this.model.hash()),
    };
    for (const [id, act] of Object.entries(actions)) find(id).addEventListener("click", act);
    find("full").hidden = !document.fullscreenEnabled;
    find("seed").addEventListener("change", ({ target }) => this.begin({ seed: Number(target.value) }));
    find("speed").addEventListener("input", ({ target }) => this.setSpeed(Number(target.value)));
    find("robot").addEventListener("toggle", () => this.showRobot(), true);
    find("disc").addEventListener("submit", (event) => {
      event.preventDefault();
      const { x, y, radius } = event.target.elements;
      this.tryDisc(...[x, y, radius].map(({ value }) => Number(value)));
    });
    document.addEventListener("click", (event) => event.detail && event.target.closest?.("button, label")?.blur());
    const keys = { " ": "play", ArrowRight: "forth", r: "reset", f: "fit", m: "hand", d: "place", "+": "closer", "-": "farther" };
    document.addEventListener("keydown", (event) => {
      const { target, key } = event, name = keys[key.length === 1 ? key.toLowerCase() : key];
      const own = target.matches("input[type=range], input[type=number], select") || (key === " " && target.matches("button, summary, input[type=checkbox]"));
      if (!name || own || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      if (event.shiftKey && key === "ArrowRight") this.step(10);
      else actions[name]();
    });
  }

  fit() {
    this.stage.follow(null);
    this.stage.fit();
  }

  /** Let the pointer move robots, or place discs, or select robots and move the map again. */
  handle(id, on) {
    const tools = { hand: () => this.handOfRobots(), place: () => this.handOfDiscs() };
    this.stage.tool = on ? tools[id]() : null;
    for (const name of Object.keys(tools)) find(name).setAttribute("aria-pressed", String(on && name === id));
  }

  /** What moves robots. */
  handOfRobots() {
    let held = null;
    return {
      cursor: "grab",
      press: ({ hit }) => {
        held = hit.kind === "robot" ? this.frames.ids.indexOf(hit.id) : null;
        return held !== null;
      },
      move: ({ x, y }) => this.put(held, x, y),
      release: () => (held = null),
      cancel: () => (held = null),
    };
  }

  /** What places discs, as large as the pointer is drawn, and takes away one that is clicked. */
  handOfDiscs() {
    let centre = null, radius = 0;
    const usual = () => Math.min(Math.max(Number(find("disc").elements.radius.value), 0), this.model.spare.largest);
    return {
      cursor: "crosshair",
      press: ({ x, y }) => {
        const there = this.model.discs.find(([, left, low, size]) => Math.hypot(x - left, y - low) < size);
        if (there) this.removeDisc(there[0]);
        else [centre, radius] = [[x, y], 0];
        return true;
      },
      move: ({ x, y }) => centre && (radius = Math.min(Math.hypot(x - centre[0], y - centre[1]), this.model.spare.largest)),
      release: () => {
        if (centre) this.tryDisc(...centre, radius > 6 / this.stage.view.scale ? radius : usual());
        centre = null;
      },
      cancel: () => (centre = null),
      draw: (context, pixel) => {
        if (!centre) return;
        context.beginPath();
        context.arc(...centre, radius > 6 * pixel ? radius : usual(), 0, 2 * Math.PI);
        context.lineWidth = 2 * pixel;
        context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--swarm-accent");
        context.stroke();
      },
    };
  }

  /** Put a robot where there is room for it. */
  put(row, x, y) {
    if (row === null || !this.model.move(row, x, y)) return false;
    this.#points = [];
    find("hash").textContent = "";
    this.show(true);
    return true;
  }
}

function fill(list, facts) {
  const rows = Object.entries(facts).map(([name, value]) => [make("dt", {}, inWords(name)), make("dd", {}, String(value))]);
  list.replaceChildren(...rows.flat());
}

function nearest({ distance, kind, counts }, row, kinds) {
  const readings = [...distance.subarray(row * counts.sensors, (row + 1) * counts.sensors)];
  const least = readings.reduce((best, read, s) => (read >= 0 && (best < 0 || read < readings[best]) ? s : best), -1);
  const names = kinds ?? ["obstacle", "robot", "fire", "load"];
  return least < 0 ? "nothing in sight" : `${names[kind[row * counts.sensors + least]] ?? "something"} at ${readings[least].toFixed(1)}`;
}

/** Return the model of the page, and the world of each of its starts. */
async function load(about) {
  const content = async (name) => inflatedText(find(name).textContent), first = about.starts[0];
  const own = await content(`start-${first.key}`), starts = new Map(), worlds = new Map();
  for (const { key, differs, begins, places, world, changes } of about.starts) {
    const bytes = key === first.key ? own : await content(`start-${key}`);
    starts.set(key, { changes, places: places ?? first.places, image: differs ? added(bytes, own) : bytes, begun: begins ? await content(`begun-${key}`) : undefined });
    worlds.set(key, world ?? first.world);
  }
  return [new LiveModel(await content("module"), about, starts), worlds];
}

async function start() {
  const about = JSON.parse(find("about").textContent), [model, worlds] = await load(about), player = new LivePlayer(about, model, worlds);
  Object.assign(swarm, {
    step: (count = 1) => player.step(count),
    column: (name) => model.column(name),
    set: (name, value) => {
      if (about.begins.some((one) => one.name === name)) player.reset({ [name]: value });
      else model.set(name, value);
      player.showSettings();
      player.remember();
    },
    reset: (wanted = {}) => player.reset(wanted),
    move: (row, x, y) => player.put(row, x, y),
    burn: (place, burns = true) => player.burn(place, burns),
    addDisc: (x, y, radius) => player.addDisc(x, y, radius),
    removeDisc: (number) => player.removeDisc(number),
    hash: () => model.hash(),
  });
  Object.defineProperty(swarm, "steps", { get: () => model.steps });
  Object.defineProperty(swarm, "events", { get: () => model.events });
  Object.defineProperty(swarm, "discs", { get: () => model.discs });
  Object.defineProperty(swarm, "memory", { get: () => model.memory });
  Object.defineProperty(swarm, "stage", { get: () => player.stage });
  Object.defineProperty(swarm, "parameters", { get: () => model.parameters });
  if (EMBEDDED) {
    document.documentElement.dataset.embedded = "true";
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
  }
  document.documentElement.dataset.ready = "true";
  return swarm;
}

const swarm = (globalThis.swarm = {});
swarm.ready = start();
