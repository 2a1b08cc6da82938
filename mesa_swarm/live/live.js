/* A model that runs in the browser, or in Node: its functions as WebAssembly, its arrays as an image of memory, both out
   of the page (mesa_swarm/live/). Nothing is loaded from anywhere. */

const PAGE = 65536;
const SPARE = 2 * 1024 * 1024;
const STACK = 2 ** 18 - 64;
const MOST_STEPS = 1000;
// Of measures, after which every second one is kept; and of the last events.
const MOST_ROWS = 20000, MOST_EVENTS = 2000;
const TAKEN = 0;
const RAISED = -2147483648;
const VIEWS = {
  f8: Float64Array, f4: Float32Array, i8: BigInt64Array, u8: BigUint64Array, i4: Int32Array, u4: Uint32Array,
  i2: Int16Array, u2: Uint16Array, i1: Int8Array, u1: Uint8Array, b1: Uint8Array,
};

/** Return bytes that were compressed and written as text. */
export async function inflatedText(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Bytes as differences from others, word by word. */
export function added(bytes, others) {
  const sum = bytes.slice();
  for (let k = 0; k < Math.min(sum.length, others.length); k++) sum[k] ^= others[k];
  return sum;
}

/** What bodies at rest are, as a fingerprint has it: bytes of a text and six arrays, see `describe_bodies` in state_hash.py. */
class Bodies {
  constructor(bytes) {
    this.at = 0;
    this.bytes = bytes;
    this.#upTo(";"); // how many items there are
    const words = this.#upTo("';").slice("str '".length);
    this.names = words ? words.split(";") : [];
    const [types, corners, rings, points, radii, heats] = Array.from({ length: 6 }, () => this.#array());
    let point = 0;
    this.rows = this.names.map((name, k) => {
      const count = 16 * Number(new DataView(corners.slice(8 * k, 8 * k + 8).buffer).getBigInt64(0, true)), begin = point;
      point += count;
      const of = (array) => array.slice(8 * k, 8 * k + 8);
      return { name, type: of(types), corners: of(corners), rings: of(rings), points: points.slice(begin, point), radius: of(radii), heat: of(heats) };
    });
  }

  #upTo(mark) {
    const text = new TextDecoder(), begin = this.at, ends = [...mark].map((letter) => letter.charCodeAt(0));
    while (!ends.every((code, k) => this.bytes[this.at + k] === code)) this.at++;
    this.at += mark.length;
    return text.decode(this.bytes.slice(begin, this.at - mark.length));
  }

  #array() {
    const shape = this.#upTo(";").match(/\d+/g).map(Number), begin = this.at;
    this.at += 8 * shape.reduce((product, length) => product * length, 1);
    return this.bytes.slice(begin, this.at);
  }

  /** Return how a disc is written down. */
  static disc(x, y, radius) {
    const reals = (...numbers) => new Uint8Array(Float64Array.from(numbers, (number) => number + 0).buffer);
    const whole = (number) => new Uint8Array(BigInt64Array.of(BigInt(number)).buffer);
    return { name: "fixed obstacle True", type: whole(0), corners: whole(1), rings: whole(0), points: reals(x, y), radius: reals(radius), heat: reals(-1) };
  }

  /** Add a disc where its kind, its radius and the bytes of its place put it among the others. */
  add(disc) {
    const place = this.rows.findIndex((row) => isBefore(disc, row));
    this.rows.splice(place < 0 ? this.rows.length : place, 0, disc);
  }

  remove(disc) {
    const place = this.rows.findIndex((row) => !isBefore(row, disc) && !isBefore(disc, row));
    if (place < 0) throw new Error("the disc is not in the fingerprint; begin anew");
    this.rows.splice(place, 1);
  }

  /** Return the bytes. */
  text() {
    const { rows } = this, encoder = new TextEncoder(), pieces = [encoder.encode(`items 7;str '${rows.map(({ name }) => name).join(";")}';`)];
    for (const key of ["type", "corners", "rings", "points", "radius", "heat"]) {
      const length = rows.reduce((sum, row) => sum + row[key].length, 0) / 8;
      pieces.push(encoder.encode(key === "points" ? `array (${length / 2}, 2);` : `array (${length},);`), ...rows.map((row) => row[key]));
    }
    return Uint8Array.from(pieces.flatMap((piece) => [...piece]));
  }
}

const realOf = (bytes) => new DataView(bytes.buffer, bytes.byteOffset).getFloat64(0, true);

/** Whether a body stands before another in a fingerprint: by kind, radius, and the bytes of a disc's place. */
function isBefore(one, other) {
  const [, kind, touches] = one.name.split(" "), [, otherKind, otherTouches] = other.name.split(" ");
  if (kind !== otherKind) return kind < otherKind;
  if (touches !== otherTouches) return touches < otherTouches;
  const radius = realOf(one.radius), otherRadius = realOf(other.radius);
  if (radius !== otherRadius) return radius < otherRadius;
  for (let k = 0; k < 16; k++) if (one.points[k] !== other.points[k]) return one.points[k] < other.points[k];
  return realOf(one.heat) < realOf(other.heat);
}

export class LiveModel {
  #exports;
  #memory;
  #start;
  #image;
  #begun;
  #completed = 0;
  #emptied = false;
  #set = new Map();
  #begins = {};
  #changes = {};

  /** Begin with a module, bytes, and starts by their keys: `{ key: { places, image, begun } }`, of which images are bytes; begun,
      if it is there, is what differs in them after what Python does in the first step. */
  constructor(module, about, starts) {
    this.about = about;
    this.starts = starts;
    const most = Math.max(...[...starts.values()].map(({ places }) => places.end));
    this.#memory = new WebAssembly.Memory({ initial: Math.ceil((most + SPARE) / PAGE) });
    const table = new WebAssembly.Table({ initial: about.functions + 2, element: "anyfunc" });
    const env = {
      __linear_memory: this.#memory,
      __stack_pointer: new WebAssembly.Global({ value: "i32", mutable: true }, STACK),
      __indirect_function_table: table,
    };
    const { exports } = new WebAssembly.Instance(new WebAssembly.Module(module), { env });
    this.#exports = exports;
    for (const [name, place] of Object.entries(about.table)) table.set(place, exports[name]);
    this.reset({ seed: about.seed });
  }

  /** How many steps were taken. */
  get steps() { return this.#completed; }
  /** Whether a condition of the model has ended the run. */
  get ended() { return this.#emptied; }
  get start() { return this.#start; }
  /** How many bytes its arrays and functions take. */
  get memory() { return this.#memory.buffer.byteLength; }

  /** Begin anew, with the seed of before or another one, and with other parameters of the beginning if some are given. */
  reset({ seed = this.seed, ...begins } = {}) {
    for (const [name, value] of Object.entries(begins)) this.#checkBeginning(name, value);
    const [key, wanted] = this.#keyOf(Number(seed), { ...this.#begins, ...begins }), start = this.starts.get(key);
    if (!start) {
      const seeds = [...this.starts.keys()].filter((one) => !one.startsWith("v")).join(", ");
      const only = wanted.length ? `; with ${wanted.map(([name, value]) => `${name} ${value}`).join(" and ")} it has ${wanted.length > 1 ? "none" : this.about.seed}` : "";
      throw new Error(`seed is ${seed}; this page has ${seeds}${only}: export another page for more`);
    }
    this.seed = Number(seed);
    this.key = key;
    this.#begins = { ...this.#begins, ...begins };
    this.#changes = start.changes ?? {};
    this.#start = start.places;
    this.#image = start.image;
    this.#begun = start.begun;
    new Uint8Array(this.#memory.buffer, this.about.base, this.#image.length).set(this.#image);
    this.#exports.begin_heap((this.about.base + this.#image.length + 63) & ~63);
    for (const [name, value] of this.#set) this.#write(this.#described(name), value);
    this.#completed = this.about.steps;
    this.#emptied = false;
    const { rows } = this.#start;
    const names = rows?.names ?? [];
    this.series = { every: 1, steps: [], values: names.map(() => []), last: names.map(() => undefined) };
    const reported = this.#start.events?.names ?? [];
    this.events = { names: reported, counts: reported.map(() => 0), last: [] };
    this.#sense();
  }

  /** Take steps, and return how many were taken: fewer where the run ends. */
  step(count = 1) {
    let taken = 0;
    if (count > 0) this.#begin();
    while (taken < count && !this.#emptied) {
      const steps = Math.min(count - taken, this.#most), [now, code] = this.#drive(steps);
      taken += now;
      this.#completed += now;
      this.#collect();
      this.#checked(code);
      if (this.#view("b1", this.#start.stop, 1)[0]) this.#emptied = true;
      else if (now < steps) break;
    }
    return taken;
  }

  /** Return the numbers of a column as they are now, of robots or, as "fires.temperature", of another part. */
  column(name) {
    const found = this.#start.columns[name];
    if (!found) throw new Error(`column is ${name}; expected one of ${Object.keys(this.#start.columns).join(", ")}`);
    const [address, type, shape] = found;
    const array = this.#view(type, address, shape.reduce((product, length) => product * length, 1)).slice();
    return type === "i8" ? Float64Array.from(array, Number) : array;
  }

  /** Return temperature, visitors and whether it is out of a fire. */
  fire(place) {
    const { temperature, robots, out } = this.#start.fires;
    const visitors = Number(this.#view("i8", robots + 8 * place, 1)[0]);
    return [this.#view("f8", temperature[place], 1)[0], visitors, this.#view("b1", out + place, 1)[0]];
  }

  /** Return the index of the part, x, y and radius of each disc that parts show. */
  get shown() {
    const rows = this.#start.shown.flatMap(([address, count], part) => {
      const discs = this.#view("f8", address, 3 * count);
      return Array.from({ length: count }, (_, k) => [part, ...discs.subarray(3 * k, 3 * k + 3)]);
    });
    return Float32Array.from(rows.flat());
  }

  /** Return x, y and heading of a body that moves, by its id; null if there is none. */
  body(id) {
    const found = this.#start.moving.find(([other]) => other === id);
    return found ? [...this.#view("f8", found[1], 2), this.#view("f8", found[2], 1)[0]] : null;
  }

  /** Put the robot in a row at a place, as its handle does in Python, and return whether there is room for it. */
  move(row, x, y) {
    const [place, block, length] = this.#start.hand, robots = this.#start.robots;
    if (!(Number.isInteger(row) && row >= 0 && row < robots)) throw new Error(`row is ${row}; expected 0 to ${robots - 1}`);
    this.#view("f8", this.#start.hand_at, 2).set([x, y]);
    const code = this.#called(() => this.#exports.call_kernel(place, block, length, 0, row, row + 1));
    if (code === RAISED) this.#checked(code);
    this.#sense();
    return code === 0;
  }

  /** Light a fire again, or put it out, as its handle does in Python. */
  burn(place, burns = true) {
    const { lighter, fires } = this.#start, count = fires?.discs.length ?? 0;
    if (!(Number.isInteger(place) && place >= 0 && place < count)) throw new Error(`fire is ${place}; expected 0 to ${count - 1}`);
    const [function_, block, length] = lighter;
    this.#checked(this.#called(() => this.#exports.call_kernel(function_, block, length, this.#completed, place, burns ? 1 : 0)));
    this.#sense();
  }

  /** The discs that can be taken away, and those that were added: the number, x, y and radius of each. */
  get discs() {
    const { discs } = this.#start, rows = discs ? [...discs.own, ...discs.spare] : [];
    return rows.map((row) => [row, ...this.#view("f8", discs.table + 24 * row, 3)]).filter(([, x]) => !Number.isNaN(x));
  }

  /** How many discs can be added, and how large they may be; null on a page without. */
  get spare() {
    const { discs } = this.#start;
    if (!discs) return null;
    const present = new Set(this.discs.map(([row]) => row));
    return { left: discs.spare.filter((row) => !present.has(row)).length, largest: discs.largest };
  }

  /** Put a disc on the map, as `add_obstacle` does in Python, and return its number; -1 where a robot is in the way. */
  addDisc(x, y, radius) {
    const { discs } = this.#withDiscs(), [left, low, right, high] = discs.bounds;
    if (![x, y, radius].every(Number.isFinite)) throw new Error(`disc is at ${x}, ${y} with radius ${radius}; expected three numbers`);
    if (!(x >= left && x <= right && y >= low && y <= high)) throw new Error(`place is ${x}, ${y}; expected x from ${left} to ${right} and y from ${low} to ${high}`);
    if (!(radius > 0 && radius <= discs.largest)) throw new Error(`radius is ${radius}; expected a number above 0, at most ${discs.largest}`);
    const present = new Set(this.discs.map(([row]) => row)), row = discs.spare.find((one) => !present.has(one));
    if (row === undefined) throw new Error(`no more discs: this page has room for ${discs.spare.length} besides those of the model; take one of these away first`);
    this.#view("f8", discs.at, 3).set([x, y, radius]);
    if (!this.#putDisc(row, true)) return -1;
    this.#describe((bodies) => bodies.add(Bodies.disc(x, y, radius)));
    return row;
  }

  /** Take a disc away, by its number, as its handle's `remove` does in Python. */
  removeDisc(number) {
    this.#withDiscs();
    const found = this.discs.find(([row]) => row === number);
    if (!found) throw new Error(`disc is ${number}; expected ${this.discs.map(([row]) => row).join(", ") || "none: there is no disc"}`);
    this.#putDisc(number, false);
    this.#describe((bodies) => bodies.remove(Bodies.disc(...found.slice(1))));
  }

  #withDiscs() {
    if (!this.#start.discs) throw new Error("discs cannot be added or taken away here: bodies move, fields flow round them, or functions read where they are; add them in Python");
    return this.#start;
  }

  /** Put the disc in a row where it is to be, or take it away; return whether there is room. */
  #putDisc(row, there) {
    const [place, block, length] = this.#start.discs.put;
    const code = this.#called(() => this.#exports.call_kernel(place, block, length, 0, row, there ? 1 : 0));
    if (code === RAISED) this.#checked(code);
    this.#sense();
    return code === 0;
  }

  /** Write into the fingerprint what bodies are from now on. */
  #describe(change) {
    const { piece, described: address } = this.#start.discs, found = this.#view("i8", piece, 2);
    const bodies = new Bodies(this.#view("u1", address, Number(found[1])).slice());
    change(bodies);
    const text = bodies.text();
    this.#view("u1", address, text.length).set(text);
    found.set([BigInt(address), BigInt(text.length)]);
  }

  /** Return the fingerprint of the model as it is now: that of `model.state_hash()`. */
  hash() {
    const [digest, pieces, count] = this.#start.digest;
    this.#sense();
    this.#checked(this.#called(() => this.#exports.call_kernel(digest, pieces, count, this.#completed, 0, 0)));
    return Array.from(this.#view("u1", this.#start.hash, 16), (byte) => byte.toString(16).padStart(2, "0")).join("");
  }

  /** The parameters as they are now, by name: those that can be changed, and others. */
  get parameters() {
    const begins = Object.fromEntries(this.about.begins.map(({ name, value }) => [name, this.#begins[name] ?? value]));
    return { ...this.about.fixed, ...begins, ...Object.fromEntries(this.about.parameters.map(({ name }) => [name, this.value(name)])) };
  }

  /** Return what a parameter is now. */
  value(name) { return this.#set.get(name) ?? this.#described(name).value; }

  /** Change a parameter from the next step on, as `continued` does in Python; it stays so after a reset. */
  set(name, value) {
    if (this.about.begins.some((one) => one.name === name)) {
      this.reset({ [name]: value });
      return;
    }
    const parameter = this.#described(name);
    const { options, minimum, maximum, whole, values } = parameter;
    const number = options ? value : Number(value);
    if (options && !options.includes(value)) throw new Error(`${name} is ${value}; expected ${options.join(" or ")}`);
    if (!options && !(number >= minimum && number <= maximum)) throw new Error(`${name} is ${value}; expected a number from ${minimum} to ${maximum}`);
    if (whole && !Number.isInteger(number)) throw new Error(`${name} is ${value}; expected a whole number`);
    if (values && !options && !values.includes(number)) {
      const near = values.reduce((best, other) => (Math.abs(other - number) < Math.abs(best - number) ? other : best));
      throw new Error(`${name} is ${value}, of which this page has not the numbers; the nearest that it has is ${near}`);
    }
    this.#set.set(name, number);
    this.#write(parameter, number);
  }

  /** Return the key of a start, and the parameters that differ from those of the page. */
  #keyOf(seed, begins) {
    const wanted = Object.entries(begins).filter(([name, value]) => value !== this.about.begins.find((one) => one.name === name)?.value);
    if (!wanted.length) return [String(seed), wanted];
    const [[name, value]] = wanted, isOther = ([other, of]) => other === name && of === value;
    const found = wanted.length === 1 && this.about.starts.find((start) => start.seed === seed && start.with && isOther(start.with));
    return [found ? found.key : "", wanted];
  }

  #checkBeginning(name, value) {
    const found = this.about.begins.find((one) => one.name === name);
    if (!found) throw new Error(`${name} is not a parameter with which this page can begin; expected ${this.about.begins.map((one) => one.name).join(", ") || "none"}`);
    if (!found.values.includes(value)) throw new Error(`${name} is ${value}; this page can begin with ${found.values.join(", ")}`);
  }

  #described(name) {
    const { parameters } = this.about, found = parameters.find((parameter) => parameter.name === name);
    if (found) return found;
    const known = parameters.map((parameter) => parameter.name).join(", ") || "none";
    const why = name in this.about.fixed ? "it acts from the beginning of a run: export a page with another value" : "there is no such parameter";
    throw new Error(`${name} cannot be changed here, ${why}; those that can: ${known}`);
  }

  #write({ name, copies: usual, places: usualPlaces = [], values = [], bytes: usualBytes = [] }, value) {
    const own = this.#changes[name], copies = own?.copies ?? usual, places = own?.places ?? usualPlaces;
    const bytes = own?.bytes ?? usualBytes;
    const memory = new DataView(this.#memory.buffer), base = this.about.base;
    for (const place of copies.f8 ?? []) memory.setFloat64(base + place, value, true);
    for (const place of copies.i8 ?? []) memory.setBigInt64(base + place, BigInt(value), true);
    const row = bytes[values.indexOf(value)];
    places.forEach((place, k) => memory.setUint8(base + place, row[k]));
  }

  /** Do what Python does in the first step: let learners begin. */
  #begin() {
    if (!this.#begun) return;
    for (const [place, block, length] of this.#start.begins) this.#checked(this.#called(() => this.#exports.call_kernel(place, block, length, 0, 0, 0)));
    const memory = new Uint8Array(this.#memory.buffer, this.about.base);
    for (let k = 0; k < this.#begun.length; k++) if (this.#begun[k]) memory[k] = this.#image[k] ^ this.#begun[k];
    this.#begun = undefined;
  }

  #view(type, address, count) { return new VIEWS[type](this.#memory.buffer, address, count); }

  /** Let robots read their sensors, as they do at the beginning of a step; to read twice gives the same. */
  #sense() {
    const [place, block, length] = this.#start.sense;
    const robots = this.#start.robots;
    this.#checked(this.#called(() => this.#exports.call_kernel(place, block, length, this.#completed + 1, 0, robots)));
  }

  /** Return how many steps were taken, which are whole even where the next one fails, and the code of a failure. */
  #drive(steps) {
    const progress = this.#view("i8", this.#start.progress, 3);
    progress.fill(0n);
    this.#view("b1", this.#start.stop, 1)[0] = 0;
    const [block, length] = this.#start.driver, robots = this.#start.robots;
    const code = this.#called(() => this.#exports.drive(block, length, steps, this.#completed, this.#completed, robots));
    return [Number(this.#view("i8", this.#start.progress, 3)[TAKEN]), code];
  }

  /** Return what a compiled function does; where it stops, as for a text of an error, it has raised one. */
  #called(act) {
    try {
      return act();
    } catch (error) {
      if (error instanceof WebAssembly.RuntimeError) return RAISED;
      throw error;
    }
  }

  #checked(code) {
    if (code === 0) return;
    const step = this.#completed + 1;
    const what = code === RAISED ? "a function has raised an error" : `Python is needed (code ${code})`;
    throw new Error(`step ${step} cannot be taken here: ${what}; run the model in Python to see why`);
  }

  /** Keep every second row from now on: a run may last for hours. */
  #thin() {
    const { series } = this;
    series.every *= 2;
    const kept = series.steps.map((step) => step % series.every === 0), keep = (list) => list.filter((_, row) => kept[row]);
    series.steps = keep(series.steps);
    series.values = series.values.map(keep);
  }

  /** How many steps a call may take: the buffers of events, and of rows that only Python reads, hold those of as many. */
  get #most() {
    const { counts, events, robots } = this.#start, rooms = counts.map(([, most]) => most);
    if (events) rooms.push(Math.max(1, Math.floor(events.most / (robots * events.names.length))));
    return Math.min(MOST_STEPS, ...rooms);
  }

  /** Take the events that were reported: how many of each name, and the last ones; their buffer begins anew when it is full. */
  #collectEvents() {
    const { events: places } = this.#start;
    if (!places) return;
    const { most, names } = places, filled = this.#view("i8", places.filled, 1), count = Number(filled[0]);
    const [step, code, id] = ["step", "code", "unique_id"].map((name) => this.#view("i8", places[name], most));
    const value = this.#view("f8", places.value, most);
    if (count > most) throw new Error(`step ${this.#completed} reported ${count} events, and a page has room for ${most} in a step; run the model in Python`);
    for (let k = 0; k < count; k++) {
      const name = names[Number(code[k])];
      this.events.counts[Number(code[k])] += 1;
      this.events.last.push({ step: Number(step[k]), name, robot: Number(id[k]), value: value[k] });
    }
    this.events.last = this.events.last.slice(-MOST_EVENTS);
    filled[0] = 0n;
  }

  /** Take the rows of measures, and empty what only Python reads. */
  #collect() {
    for (const [address] of this.#start.counts) this.#view("i8", address, 1)[0] = 0n;
    this.#collectEvents();
    const { rows } = this.#start;
    if (!rows) return;
    if (this.#view("b1", rows.failed, 1)[0]) throw new Error(`a measure has failed in step ${this.#completed}; run the model in Python to see why`);
    const count = this.#view("i8", rows.count, 1), found = Number(count[0]), width = rows.names.length;
    const steps = this.#view("i8", rows.steps, found), table = this.#view("f8", rows.table, found * width);
    const { series } = this;
    for (let row = 0; row < found; row++) {
      for (let k = 0; k < width; k++) series.last[k] = table[row * width + k];
      if (Number(steps[row]) % series.every) continue;
      series.steps.push(Number(steps[row]));
      for (let k = 0; k < width; k++) series.values[k].push(series.last[k]);
    }
    count[0] = 0n;
    if (series.steps.length > MOST_ROWS) this.#thin();
  }
}
