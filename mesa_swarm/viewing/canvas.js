/* A swarm drawn to scale on a 2D canvas. One module, no dependencies, no build step; before it stands the
   constants PALETTE, the colours by theme, and MEANINGS, their names in legends: `script` in viewing/palette.py.

     const stage = new Stage(canvas, world, { theme: "light", onSelect: (id) => ... });
     stage.show(frame);                   // draws, with its trail if it has one
     stage.pass(frame);                   // takes note of the trail of a frame that is not drawn
     stage.show(unpacked(world, bytes));  // the same from the bytes of `packed_frame`
     stage.set("sectors", false);         // one of TOGGLES
     stage.theme = "dark";
     stage.world = another;               // when things that stand still, designs or layers have changed
     stage.fit(); stage.zoom(1.5); stage.follow(id); stage.select(id);
     new Stage(canvas, world, { covered: () => ({ left: 0, right: 52, top: 0, bottom: 44 }) });  // px that buttons cover
     stage.set("fields.trail", false);    // or a scalar field, by its name
     stage.legend();                      // [{ form, name, colours, low, high }] of what is shown, see `fillLegend`
     stage.view = stage.view;             // { fitted, x, y, scale }: what is in sight, to be stored
     stage.enlarge = 1.6;                 // lines, texts and the smallest robots, for those who sit far away
     stage.hit(x, y);                     // { kind: "robot" | "fire" | "load" | "shape" | null, id or index } on the map
     stage.tool = { cursor, press, move, release, hover, cancel, draw };  // takes the pointer; null for none, see `tool`
     stage.destroy();

   The wheel zooms (where the page scrolls, only with Ctrl or once the canvas has the focus), dragging pans, a click
   selects, pointing at a robot names it. With one finger the page scrolls while the whole map is shown; two fingers zoom
   and pan. The canvas is drawn at the size that CSS gives it.

   world (JSON, made by `Scene.world` in viewing/scene.py):
     bounds      [x_min, y_min, x_max, y_max], map units, y up
     shapes      [{ disc: [x, y, r] } or { rings: [[[x, y], ...], ...] }, each with mark: true on the ground, its kind if that
                 is of the model's own, and its temperature if it radiates]
     loads       the same about their own centres
     designs     [{ name, radius, holonomic, sensors: [[mount_x, mount_y, bearing, half_angle, range], ...] }]
     scale       [map units a metre, seconds a step], if they are known
     layers      names; the column layer holds indices into them
     kinds       names of all kinds of bodies, if there are kinds of the model's own; the column kind holds their indices
     columns     [{ name, table, width, type }] of a packed frame, in its order
     looks       { kinds: by theme colours by kind, column: { label, low, high, and by theme its colours } }, if any
     fields      names of the scalar fields, if there are any
     parts       [name, colour] of each part of the model's own that shows discs, if there are any
     legend      [{ form, name, and by theme its colours }] of fields, and of bodies where there are kinds of the model's own

   frame: step, counts { robots, sensors, fires, loads, contacts }, and typed arrays, row after row:
     ids         Int32, unique_id of each robot
     pose        Float32, x, y, heading (rad)
     distance    Float32, one a proximity sensor, below 0 for nothing; kind: Int8, 0 obstacle, 1 robot, 2 fire, 3 load
     command     Float32, the two numbers that drive the robot; heat: Float32, 1 is too hot
     layer       Int8, -1 none; design: Int8; hot: Int8, 1 while too hot to fight
     heard       Float32, x, y of the robot that was heard, NaN for none
     fires       Float32, x, y, radius, temperature, robots, 1 if out
     loads       Float32, index in world.loads, x, y, heading
     contacts    Float32, row of the robot, azimuth from it to what it met
     value       Int8, index of the colour by which a robot is drawn, -1 none; label: UTF-8 of 12 bytes, zeros behind
     trail       { more, points: [{ step, values, stride, moved }] }: where its robots were in steps up to its own, the
                 oldest first; `more` if that goes on from the frame before. Row i of values, Float32, begins at i * stride with
                 x and y; `moved`, if it is there, is the Set of rows that were put there. In between the way is not known, unless
                 one step follows the other.
     fields      [{ rows, columns, peak, levels }] of each field, from the bottom up: Uint8, 255 is its largest value so far,
                 the peak; no rows where the model did not have it
     shown       Float32, of each disc of a part: its index in world.parts, x, y, radius
   Columns other than ids and pose may be missing. */

export const TOGGLES = [
  { name: "sectors", label: "Sensor sectors", on: true },
  { name: "perceived", label: "Perceived centroid", on: false },
  { name: "trails", label: "Trails", on: true },
  { name: "contacts", label: "Contacts", on: true },
  { name: "layers", label: "Winning layer", on: true },
  { name: "heat", label: "Hot robots", on: true },
  { name: "messages", label: "Messages", on: true },
  { name: "labels", label: "Fire numbers, robots at fires", on: true },
  { name: "texts", label: "Labels of robots", on: true },
];
// Begins the names of fields among the toggles.
const FIELD = "fields.";

/** Return what may be shown of a world: TOGGLES, and after them its fields. */
export function togglesOf(world) {
  const fields = (world.fields ?? []).map((name) => ({ name: FIELD + name, label: `Field ${name}`, on: true }));
  return [...TOGGLES.filter(({ name }) => name !== "texts" || world.columns.some((column) => column.name === "label")), ...fields];
}

const TAU = 2 * Math.PI;
// Units of length by name, m.
const LENGTHS = [["km", 1e3], ["m", 1], ["cm", 1e-2], ["mm", 1e-3], ["µm", 1e-6]];
const ROBOT = 1;
// More robots in sight than this are drawn without trails and the like, and plainer.
const MOST_DETAILED = 2000;
// Sectors that lie over a place of the map in sight, on average: where there are more, only those of the selected and of the
// pointed robot are drawn, until there are fewer again. All models of the gallery are below as they begin, but for one at 25.
const MOST_OVERLAP = 2, AGAIN_OVERLAP = 1.6;
// More sectors in sight than this are too many to draw in time.
const MOST_SECTORS = 2500;
// Robots are drawn no smaller than this radius, px, as long as all of them would cover no more than this share of the map;
// smaller ones than the second are plain.
const LEAST_RADIUS = 3, MOST_COVERED = 0.12, PLAIN_BELOW = 1.75;
// Below this radius, px, halves and lines blur: a robot is a drop that points ahead.
const DROP_BELOW = 7;
// Commanded speed below which a robot stands, map units a step.
const STANDS = 1e-3;
// How far a drop's tip is from its middle, by its radius; and the half-width of its pale front, rad.
const TIP = 1.6, FRONT = 0.95;
// A robot is pointed at within this distance, px.
const NEAR = 9;
// Points of all trails in sight together: trails of many robots are shorter.
const MOST_TRAIL = 12000;
const BATCH = 32;
// Points of a trail nearer to each other than this are left out, px, or than half a robot's radius: no robot is nearer to
// a wall than its radius, so that the line stays clear of walls. Points between which the way is not known are dots of this radius, px.
const TRAIL_APART = 2, DOT = 2;
// How far a robot gets in a step, by its speed, and at least, by its radius; what is farther was put there: as `reach` in trails.py.
const MARGIN = 1.5, LEAST_JUMP = 2;
// More robots in sight than this are copied from sheets of robots drawn beforehand, which takes a fourth of the time,
// unless their radius is larger than this, px of the screen.
const MOST_DRAWN = 100;
const LARGEST_COPIED = 8;
// Robots on a sheet: places per pixel, along and across, and headings per pixel of rim.
const PLACES = 3;
const TURNS = 1.5;
/** Steps that a trail shows; trails.py has the same number. */
export const TRAIL_STEPS = 100;
const NARROWEST = 4;
// Of discs of parts; pictures.py has the same number.
const PART_OPACITY = 0.6;
// A cooler robot has no glow, as a share of what is too hot.
const LEAST_HEAT = 0.02;
// More robots in sight than this have no texts.
const MOST_LABELLED = 300;
const DECODER = new TextDecoder();
// The number of a smaller fire is not drawn, radius in px.
const SMALLEST_NUMBERED = 4;

/** Return the frame that these bytes hold, as views into them. */
export function unpacked(world, bytes) {
  const buffer = bytes.buffer ?? bytes;
  let at = bytes.byteOffset ?? 0;
  if (at % 4) return unpacked(world, new Uint8Array(buffer, at, bytes.byteLength).slice());
  const [step, robots, sensors, fires, loads, contacts] = new Int32Array(buffer, at, 6);
  const counts = { robots, sensors, fires, loads, contacts };
  const kinds = { f4: Float32Array, i4: Int32Array, i1: Int8Array };
  const frame = { step, counts };
  at += 24;
  for (const { name, table, width, type } of world.columns) {
    const length = counts[table] * (width === "sensors" ? sensors : width);
    frame[name] = new kinds[type](buffer, at, length);
    at += frame[name].byteLength;
  }
  if (world.fields) frame.fields = world.fields.map(picture);
  if (world.parts) frame.shown = discs();
  return frame;

  function picture() {
    at += -at & 3;
    const [rows, columns] = new Int32Array(buffer, at, 2), [peak] = new Float32Array(buffer, at + 8, 1);
    const levels = new Uint8Array(buffer, at + 12, rows * columns);
    at += 12 + levels.length;
    return { rows, columns, peak, levels };
  }

  function discs() {
    at += -at & 3;
    return new Float32Array(buffer, at + 4, 4 * new Int32Array(buffer, at, 1)[0]);
  }
}

// Stands for the rear of a robot that is too hot, among indices of values.
const HOT = -2;
// Knows whether a path holds a point.
const TESTER = document.createElement("canvas").getContext("2d");
const NOTHING = { left: 0, right: 0, top: 0, bottom: 0 };
/** What the scale covers in the lower left corner, CSS pixels. */
export const SCALE = { width: 131, height: 36 };

/** A canvas on which a world is drawn. */
export class Stage {
  #canvas; #context; #world; #designs; #shapes; #loads; #small; #reach;
  #frame = null;
  #view = null;
  #fitted = true;
  #width = 0; #height = 0; #ratio = 1;
  #still = null;
  #sheets = { scale: 0, made: new Map() };
  #trail = [];
  #toggles = Object.fromEntries(TOGGLES.map(({ name, on }) => [name, on]));
  #theme = "light";
  #chosen = null;
  #followed = null;
  #pointers = new Map();
  #moved = 0;
  #spread = 0;
  #middle = null;
  #pointed = null;
  #enlarge = 1;
  #dense = false;
  #plain = false;
  #seen = new Set();
  #tool = null;
  #held = null;
  #listeners = new AbortController();
  #observer;
  #asked = 0;
  #covered;
  #takesWheel;

  /** `takesWheel` returns whether a wheel without Ctrl is the canvas's own although it has not the focus. */
  constructor(canvas, world, { theme = "light", onSelect = () => {}, onFollow = () => {}, onView = () => {}, onDense = () => {},
    covered = () => NOTHING, takesWheel = () => !scrollsAround(canvas) } = {}) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d");
    this.#world = world;
    this.#theme = theme;
    this.onSelect = onSelect;
    this.onFollow = onFollow;
    this.onView = onView;
    this.onDense = onDense;
    this.#covered = covered;
    this.#takesWheel = takesWheel;
    this.#prepare();
    this.#listen();
    this.#observer = new ResizeObserver(() => this.resize());
    this.#observer.observe(canvas);
    this.resize();
  }

  get world() { return this.#world; }
  set world(world) {
    const moved = String(world.bounds) !== String(this.#world.bounds);
    this.#world = world;
    this.#frame = this.#still = null;
    this.#trail = [];
    this.#seen.clear();
    this.#prepare();
    if (moved) this.fit(); // else its first frame is soon drawn, over the last one of the other world
  }

  get frame() { return this.#frame; }
  get selected() { return this.#chosen; }
  get followed() { return this.#followed; }
  get toggles() { return { ...this.#toggles }; }
  get theme() { return this.#theme; }
  set theme(name) {
    this.#theme = name in PALETTE ? name : "light";
    this.#still = null;
    this.#sheets.scale = 0;
    this.draw();
  }

  /** What is in sight: whether all of the map, else the middle of the canvas on the map, and pixels in a map unit. */
  get view() { return { fitted: this.#fitted, ...this.#view }; }
  set view({ fitted, x, y, scale }) {
    if (fitted) this.fit();
    else this.#look({ x, y, scale });
  }

  /** How much larger than usual lines, texts and the smallest robots are. */
  get enlarge() { return this.#enlarge; }
  set enlarge(factor) {
    if (factor === this.#enlarge) return;
    this.#enlarge = factor;
    this.#sheets.scale = 0;
    this.resize();
  }

  /** Whether too many sectors overlap: only those of the selected and of the pointed robot are drawn. */
  get dense() { return this.#dense; }

  /** What takes the pointer in place of panning and selecting, null for nothing. All of its parts but `press` may be missing:
        cursor                 as CSS has it
        press({ x, y, hit })   takes the drag that begins here if it returns true
        move({ x, y }), release({ x, y })   while it has the drag
        hover({ x, y, hit })   without a button
        cancel()               Escape was pressed, or a second finger came: forget the drag
        draw(context, pixel)   draws above all else, in map units; a pixel is this long
      Places are on the map; `hit` is that of `stage.hit`. */
  get tool() { return this.#tool; }
  set tool(tool) {
    this.#cancel(false);
    this.#tool = tool;
    this.#point(null);
    this.#showCursor();
    this.draw();
  }

  /** Take note of the trail of a frame that is not drawn: the next one goes on from it. */
  pass(frame) { this.#remember(frame); }

  /** Draw a frame now. */
  show(frame) {
    this.#remember(frame);
    this.#frame = frame;
    this.#see(frame);
    this.draw();
  }

  /** Show or hide one of `togglesOf` the world. */
  set(name, on) {
    this.#toggles[name] = Boolean(on);
    this.draw();
  }

  /** Show the whole map, beside what covers the canvas, unless that leaves less than half of it. */
  fit() {
    const [x0, y0, x1, y1] = this.#world.bounds, covered = this.#covered();
    const [left, right] = roomy(this.#width, covered.left, covered.right);
    const [top, bottom] = roomy(this.#height, covered.top, covered.bottom);
    const width = this.#width - left - right, height = this.#height - top - bottom;
    const scale = 0.97 * Math.min(width / (x1 - x0), height / (y1 - y0));
    this.#look({ x: (x0 + x1 + (right - left) / scale) / 2, y: (y0 + y1 + (top - bottom) / scale) / 2, scale }, true);
  }

  /** Zoom by a factor about a point of the canvas, by default its middle. */
  zoom(factor, [px, py] = [this.#width / 2, this.#height / 2]) {
    const { x, y, scale } = this.#view, [x0, y0, x1, y1] = this.#world.bounds;
    const widest = 0.3 * Math.min(this.#width / (x1 - x0), this.#height / (y1 - y0));
    const next = Math.min(Math.max(scale * factor, widest), Math.max(this.#width, this.#height) / NARROWEST);
    const shift = 1 / scale - 1 / next;
    this.#look({ x: x + (px - this.#width / 2) * shift, y: y - (py - this.#height / 2) * shift, scale: next });
  }

  /** Follow the robot with this id, or null for none. */
  follow(id) {
    this.#followed = id;
    this.onFollow(id);
    this.draw();
  }

  /** Mark the robot with this id, or null for none; without calling back. */
  select(id) {
    this.#chosen = id;
    this.draw();
  }

  /** Return what colours mean: of all that there is or was in this world, and is switched on. */
  legend() {
    const { legend = [], looks, columns } = this.#world, { label, low, high } = looks?.column ?? {};
    const values = columns.some(({ name }) => name === "value") && this.#values, on = this.#toggles, colours = this.#colours;
    const bodies = legend.filter(({ form }) => form !== "field").map((entry) => ({ ...entry, colours: entry[this.#theme], low: 0, high: 1 }));
    const robots = values ? [{ form: "value", name: label, low, high, colours: values }] : [];
    const sectors = on.sectors && (!this.#dense || this.#chosen !== null);
    const only = (form, is, shades = [colours[form]]) => (is && this.#seen.has(form) ? [{ form, name: MEANINGS[form], colours: shades }] : []);
    return [
      ...(this.#plain ? [] : only("robot", !values, this.#shades(this.#robotColour(-1)))),
      ...(this.#plain ? [] : only("robot_hot", !values && on.heat, this.#shades(colours.robot_hot))),
      ...(on.layers ? this.layers() : []), ...only("heat", on.heat),
      ...only("fire", true, colours.fire).map((entry) => ({ ...entry, low: 0, high: 1 })), ...only("ashes", true, [colours.ashes, colours.border]),
      ...bodies, ...robots, ...this.#fieldLegend(),
      ...only("seeing", sectors), ...only("sector", sectors), ...only("travel", true), ...only("contact", on.contacts),
      ...only("message", on.messages), ...only("trail", on.trails), ...only("places", on.trails, [colours.trail]), ...only("perceived", on.perceived),
      ...(this.#chosen === null ? [] : only("selection", true)),
    ];
  }

  #shades(rear) { return [rear, this.#colours.robot_front, this.#colours.robot_outline]; }

  /** Note what there is: it stays in the legend, which would otherwise change all the time. */
  #see({ counts, fires, distance, contacts, heard, heat, hot, kind }) {
    const seen = this.#seen, holonomic = this.#designs.some((design) => design.holonomic);
    const note = (form, is) => seen.has(form) || (is() && seen.add(form));
    const of = (part, test) => () => Boolean(part?.some(test));
    const states = (out) => () => { for (let i = 0; i < counts.fires; i++) if (Boolean(fires[6 * i + 5]) === out) return true; return false; };
    for (const form of ["robot", "selection"]) note(form, () => counts.robots > 0);
    this.#seeTrails();
    note("travel", () => holonomic && counts.robots > 0);
    note("fire", states(false));
    note("ashes", states(true));
    note("sector", () => counts.sensors > 0 && counts.robots > 0);
    note("seeing", of(distance, (read) => read >= 0));
    note("perceived", of(kind, (met) => met === ROBOT));
    note("contact", () => contacts && counts.contacts > 0);
    note("message", of(heard, (place) => place === place));
    note("heat", of(heat, (share) => share >= LEAST_HEAT));
    note("robot_hot", of(hot, (is) => is > 0));
  }

  /** Note whether trails that are not below their robots have lines, and whether dots. */
  #seeTrails() {
    const seen = this.#seen, frame = this.#frame, way = this.#way;
    if (way.length < 2 || (seen.has("trail") && seen.has("places"))) return;
    if (!frame.ids.some((_, i) => !isBelow(way, i, this.#radius(frame, i)))) return;
    for (let k = 1; k < way.length; k++) seen.add(way[k].step - way[k - 1].step > 1 ? "places" : "trail");
  }

  /** Return the entries of layers. */
  layers() {
    const form = this.#plain ? "disc" : "layer";
    return this.#world.layers.map((name, index) => ({ form, name, colours: [this.#layerColour(index)] }));
  }

  #fieldLegend() {
    const { legend = [] } = this.#world, pictures = this.#frame?.fields ?? [], fields = legend.filter(({ form }) => form === "field");
    const all = fields.map((entry, index) => ({ ...entry, colours: entry[this.#theme], low: 0, high: pictures[index]?.peak ?? 0 }));
    return all.filter(({ name }, index) => this.#showsField(name) && pictures[index]?.levels.length !== 0);
  }

  #showsField(name) { return this.#toggles[FIELD + name] !== false; }

  /** Return where on the canvas a point of the map is, in CSS pixels. */
  toCanvas(x, y) {
    const view = this.#view;
    return [this.#width / 2 + (x - view.x) * view.scale, this.#height / 2 - (y - view.y) * view.scale];
  }

  /** Return where on the map a point of the canvas is. */
  toMap(px, py) {
    const view = this.#view;
    return [view.x + (px - this.#width / 2) / view.scale, view.y - (py - this.#height / 2) / view.scale];
  }

  /** Return what is at a place of the map: the uppermost of robots, loads, fires and shapes. */
  hit(x, y) {
    const frame = this.#frame, row = this.#robotAt(x, y);
    if (row >= 0) return { kind: "robot", id: frame.ids[row] };
    const load = frame ? this.#loadAt(frame, x, y) : -1;
    if (load >= 0) return { kind: "load", index: load, id: this.#world.loads[load].id };
    for (let i = (frame?.counts.fires ?? 0) - 1; i >= 0; i--) {
      if (Math.hypot(frame.fires[6 * i] - x, frame.fires[6 * i + 1] - y) <= frame.fires[6 * i + 2]) return { kind: "fire", index: i };
    }
    const index = this.#shapes.findLastIndex(({ path }) => TESTER.isPointInPath(path, x, y, "evenodd"));
    return index >= 0 ? { kind: "shape", index } : { kind: null };
  }

  #loadAt({ counts, loads }, x, y) {
    for (let i = counts.loads - 1; i >= 0; i--) {
      const [index, left, up, heading] = loads.subarray(4 * i, 4 * i + 4), cos = Math.cos(heading), sin = Math.sin(heading);
      const dx = x - left, dy = y - up, path = this.#loads[index];
      if (path && TESTER.isPointInPath(path, cos * dx + sin * dy, cos * dy - sin * dx, "evenodd")) return index;
    }
    return -1;
  }

  /** Return the row of the robot that is nearest to a place, within reach of a pointer; -1 for none. */
  #robotAt(x, y) {
    const frame = this.#frame, near = NEAR * this.#pixel;
    let best = -1, least = Infinity;
    for (let i = 0; i < (frame?.counts.robots ?? 0); i++) {
      const distance = Math.hypot(frame.pose[3 * i] - x, frame.pose[3 * i + 1] - y);
      if (distance < least && distance <= Math.max(this.#radius(frame, i), near)) [best, least] = [i, distance];
    }
    return best;
  }

  /** Take note of a new size; called by itself when CSS changes it. */
  resize() {
    const { clientWidth, clientHeight } = this.#canvas;
    this.#width = Math.max(clientWidth, 1);
    this.#height = Math.max(clientHeight, 1);
    this.#ratio = Math.min(globalThis.devicePixelRatio || 1, 3);
    const size = [Math.round(this.#width * this.#ratio), Math.round(this.#height * this.#ratio)];
    if (this.#canvas.width !== size[0] || this.#canvas.height !== size[1]) {
      [this.#canvas.width, this.#canvas.height] = size;
    }
    this.#still = null;
    if (this.#fitted || this.#view === null) this.fit();
    else this.draw();
  }

  /** Stop listening. */
  destroy() {
    this.#listeners.abort();
    this.#observer.disconnect();
    cancelAnimationFrame(this.#asked);
    Object.assign(this.#canvas.style, { touchAction: "", cursor: "" });
  }

  /** Draw anew; before the first frame later, since there may be much to set. */
  draw() {
    if (this.#frame === null) this.#redraw();
    else this.#drawNow();
  }

  #drawNow() {
    if (this.#view === null) return;
    this.#keepInSight();
    const context = this.#context;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.#background(), 0, 0);
    if (this.#frame === null) return;
    const frame = this.#frame, rows = this.#rowsInSight(frame), detailed = rows.length <= MOST_DETAILED && !this.#isPlain;
    const on = this.#toggles, rings = on.layers && frame.layer, pointed = this.#pointedRow();
    this.#plain = !detailed;
    this.#toMap(context);
    if (frame.fields) this.#drawFields(frame.fields);
    if (frame.shown) this.#drawShown(frame.shown);
    this.#drawFires(frame);
    this.#drawLoads(frame, false);
    if (on.labels && frame.counts.fires) this.#drawNumbers(frame);
    if (on.trails && detailed) this.#drawTrails(frame, rows);
    if (frame.distance) this.#drawSectors(frame, this.#sensing(frame, rows, pointed));
    if (on.heat && frame.heat) this.#drawHeat(frame, rows);
    if (on.messages && frame.heard) this.#drawMessages(frame, rows);
    if (on.perceived && detailed && frame.kind) this.#drawPerceived(frame, rows);
    if (!detailed) this.#drawPlainly(frame, rows);
    else if (this.#copies(rows)) this.#copyBodies(frame, rows, rings);
    else this.#drawBodies(frame, rows, rings);
    this.#drawLoads(frame, true);
    if (detailed) this.#drawTravel(frame, rows);
    if (on.contacts && frame.contacts) this.#drawContacts(frame);
    this.#drawChosen(frame);
    if (on.labels) this.#drawLabels(frame);
    if (on.texts && frame.label && rows.length <= MOST_LABELLED) this.#drawTexts(frame, rows);
    if (pointed >= 0) this.#drawPointed(frame, pointed);
    if (this.#tool?.draw) this.#drawTool();
  }

  #drawTool() {
    const context = this.#context;
    context.save();
    this.#toMap(context);
    try {
      this.#tool.draw(context, this.#pixel);
    } finally {
      context.restore();
    }
  }

  /** Draw anew before the next picture of the screen, once, however often this is called. */
  #redraw() {
    this.#asked ||= requestAnimationFrame(() => {
      this.#asked = 0;
      this.#drawNow();
    });
  }

  get #colours() { return PALETTE[this.#theme]; }
  #layerColour(index) {
    const { layers, no_layer } = this.#colours;
    return index < 0 ? no_layer : layers[index % layers.length];
  }

  /** Return the colours of values, undefined without any. */
  get #values() { return this.#world.looks?.column?.[this.#theme]; }

  #kindColour(kind, usual) { return this.#world.looks?.kinds[this.#theme][kind] ?? usual; }

  /** Return the colour of a body: of its kind if the model declares one, else of its temperature if it has one. */
  #bodyColour({ kind, temperature }, usual) {
    const colours = this.#colours, cold = temperature === undefined;
    return this.#kindColour(kind ?? usual, cold ? colours[usual] : fireColour(colours, temperature));
  }

  #fieldColour(index) {
    const { scalars } = this.#colours;
    return scalars[index % scalars.length];
  }

  /** A pixel, map units; larger where lines and texts are. */
  get #pixel() { return this.#enlarge / this.#view.scale; }

  /** The radius as which a robot is drawn. */
  #radius(frame, row) { return Math.max(this.#design(frame, row).radius, this.#leastRadius); }

  /** The smallest radius of robots: not so large that they hide each other. */
  get #leastRadius() {
    const [x0, y0, x1, y1] = this.#world.bounds, count = this.#frame?.counts.robots || 1;
    return Math.min(LEAST_RADIUS * this.#pixel, Math.sqrt((MOST_COVERED * (x1 - x0) * (y1 - y0)) / (Math.PI * count)));
  }

  /** Whether robots are so small that nothing can be seen on them. */
  get #isPlain() { return Math.max(this.#largest, this.#leastRadius) * this.#view.scale < PLAIN_BELOW; }

  get #largest() { return this.#designs.reduce((most, { radius }) => Math.max(most, radius), 0); }

  #prepare() {
    const { designs, shapes, loads } = this.#world;
    this.#designs = designs.map((design) => ({ ...design, rows: design.sensors.map(sensorRow), reach: reachOf(design), area: areaOf(design) }));
    this.#shapes = shapes.map((shape) => ({ ...shape, path: pathOf(shape) }));
    this.#loads = loads.map(pathOf);
    this.#reach = designs.reduce((most, design) => Math.max(most, reachOf(design)), 10);
    const least = Math.min(...designs.map(({ radius }) => radius));
    this.#small = loads.map((load) => extentOf(load) < least);
    this.#sheets.scale = 0;
  }

  #look(view, fitted = false) {
    this.#view = view;
    this.#fitted = fitted;
    this.#still = null;
    this.#showCursor();
    this.onView();
    this.draw();
  }

  /** Return the pixels of the screen in a map unit, and how far right and down of the corner the map's origin is. */
  #origin() {
    const { x, y, scale } = this.#view, s = scale * this.#ratio;
    return [s, (this.#width / 2) * this.#ratio - x * s, (this.#height / 2) * this.#ratio + y * s];
  }

  #toMap(context) {
    const [s, left, top] = this.#origin();
    context.setTransform(s, 0, 0, -s, left, top);
  }

  #keepInSight() {
    const frame = this.#frame, row = this.#followed === null || !frame ? -1 : frame.ids.indexOf(this.#followed);
    if (row < 0) return;
    const x = frame.pose[3 * row], y = frame.pose[3 * row + 1];
    if (x === this.#view.x && y === this.#view.y) return;
    this.#view = { ...this.#view, x, y };
    this.#fitted = false;
    this.#still = null;
    this.#showCursor();
  }

  /** Return what stands still, drawn when the view last changed. */
  #background() {
    if (this.#still) return this.#still;
    const still = document.createElement("canvas"), colours = this.#colours;
    still.width = this.#canvas.width;
    still.height = this.#canvas.height;
    const context = still.getContext("2d", { alpha: false });
    context.fillStyle = colours.outside;
    context.fillRect(0, 0, still.width, still.height);
    this.#toMap(context);
    const [x0, y0, x1, y1] = this.#world.bounds;
    context.fillStyle = colours.ground;
    context.fillRect(x0, y0, x1 - x0, y1 - y0);
    this.#drawStanding(context);
    if (!this.#world.fields) this.#drawScale(context);
    return (this.#still = still);
  }

  #drawStanding(context) {
    const colours = this.#colours, [x0, y0, x1, y1] = this.#world.bounds;
    for (const wanted of [true, false]) {
      for (const body of this.#shapes) {
        const { path, mark } = body;
        if (Boolean(mark) !== wanted) continue;
        context.fillStyle = this.#bodyColour(body, mark ? "mark" : "obstacle");
        context.fill(path, "evenodd");
      }
    }
    context.strokeStyle = colours.border;
    context.lineWidth = 1.5 * this.#pixel;
    context.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }

  /** Draw fields on the ground, and on them what stands still. */
  #drawFields(fields) {
    const context = this.#context, [x0, y0, x1, y1] = this.#world.bounds;
    fields.forEach((field, index) => {
      if (!field.levels.length || !this.#showsField(this.#world.fields[index])) return; // or it was not there then
      context.drawImage(fieldImage(field, this.#fieldColour(index)), x0, y0, x1 - x0, y1 - y0);
    });
    this.#drawStanding(context);
    this.#drawScale(context);
    this.#toMap(context);
  }

  /** Return the length of a scale bar, map units, at most this long, and its text: a length in metres if those are known. */
  #ruler(most) {
    if (!this.#world.scale) {
      const length = roundLength(most);
      return [length, `${Number(length.toPrecision(2))} units`];
    }
    const units = this.#world.scale[0], metres = roundLength(most / units);
    const [name, size] = LENGTHS.find(([, size]) => metres >= size * (1 - 1e-9)) ?? LENGTHS[LENGTHS.length - 1];
    return [metres * units, `${Number((metres / size).toPrecision(2))} ${name}`];
  }

  #drawScale(context) {
    const larger = this.#enlarge, [length, text] = this.#ruler(110 * this.#pixel), pixels = (length * this.#view.scale) / larger;
    this.#toPixels(context);
    const x = 14, y = this.#height / larger - 14;
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    context.fillStyle = this.#colours.ground;
    context.globalAlpha = 0.85;
    context.fillRect(x - 7, y - 22, Math.max(pixels, context.measureText(text).width) + 14, 30);
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = this.#colours.label;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y - 4);
    context.lineTo(x, y);
    context.lineTo(x + pixels, y);
    context.lineTo(x + pixels, y - 4);
    context.stroke();
    context.fillText(text, x, y - 8);
  }

  /** Let a context draw in pixels, larger ones where texts are; return where in them a place of the map is. */
  #toPixels(context) {
    const size = this.#ratio * this.#enlarge;
    context.setTransform(size, 0, 0, size, 0, 0);
    return (x, y) => this.toCanvas(x, y).map((one) => one / this.#enlarge);
  }

  #rowsInSight({ counts, pose }) {
    const { x, y, scale } = this.#view, rows = [];
    const margin = this.#reach;
    const w = this.#width / 2 / scale + margin, h = this.#height / 2 / scale + margin;
    for (let i = 0; i < counts.robots; i++) {
      if (Math.abs(pose[3 * i] - x) <= w && Math.abs(pose[3 * i + 1] - y) <= h) rows.push(i);
    }
    return rows;
  }

  #design(frame, row) {
    return this.#designs[frame.design ? frame.design[row] : 0] ?? this.#designs[0];
  }

  /** Draw what parts of the model's own show. */
  #drawShown(discs) {
    const context = this.#context;
    context.lineWidth = this.#pixel;
    for (let i = 0; i < discs.length; i += 4) {
      const [part, x, y, r] = discs.subarray(i, i + 4);
      context.beginPath();
      context.arc(x, y, r, 0, TAU);
      context.fillStyle = context.strokeStyle = this.#world.parts[part][1];
      context.globalAlpha = PART_OPACITY;
      context.fill();
      context.globalAlpha = 1;
      context.stroke();
    }
  }

  #drawFires({ fires, counts }) {
    const context = this.#context, colours = this.#colours;
    context.lineWidth = 1.5 * this.#pixel;
    for (let i = 0; i < counts.fires; i++) {
      const [x, y, r, temperature, , out] = fires.subarray(6 * i, 6 * i + 6);
      context.beginPath();
      context.arc(x, y, r, 0, TAU);
      context.fillStyle = out ? colours.ashes : fireColour(colours, temperature);
      context.fill();
      context.strokeStyle = out ? colours.border : colours.fire_rim;
      context.stroke();
    }
  }

  /** Write below each fire what charts call it; robots stand upon that. */
  #drawNumbers({ fires, counts }) {
    const context = this.#context, colours = this.#colours, at = this.#toPixels(context);
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = colours.ground;
    context.fillStyle = colours.label;
    for (let i = 0; i < counts.fires; i++) {
      const [x, y, r] = fires.subarray(6 * i, 6 * i + 3), [across, down] = at(x, y);
      const radius = r / this.#pixel, text = `fire ${i + 1}`;
      if (radius < SMALLEST_NUMBERED) continue;
      context.strokeText(text, across, down + radius + 9);
      context.fillText(text, across, down + radius + 9);
    }
    this.#toMap(context);
  }

  /** Draw loads, or those smaller than every robot, which a robot that carries one would hide. */
  #drawLoads({ loads, counts }, small) {
    const context = this.#context;
    for (let i = 0; i < counts.loads; i++) {
      const [index, x, y, heading] = loads.subarray(4 * i, 4 * i + 4);
      if (!this.#loads[index] || this.#small[index] !== small) continue;
      context.save();
      context.translate(x, y);
      context.rotate(heading);
      context.fillStyle = this.#bodyColour(this.#world.loads[index], "load");
      context.fill(this.#loads[index], "evenodd");
      context.restore();
    }
  }

  /** Draw where robots were: lines through places of successive steps, dots where the way between is not known. */
  #drawTrails(frame, rows) {
    const context = this.#context, points = this.#way.slice(-Math.max(2, Math.ceil(MOST_TRAIL / rows.length)));
    const seen = points.length < 2 ? [] : rows.filter((i) => !isBelow(points, i, this.#radius(frame, i)));
    if (!seen.length) return;
    context.strokeStyle = context.fillStyle = this.#colours.trail;
    context.lineWidth = 1.6 * this.#pixel;
    context.lineJoin = "bevel";
    const dots = new Path2D(), size = DOT * this.#pixel, apart = TRAIL_APART * this.#pixel;
    seen.forEach((i, k) => {
      if (k % BATCH === 0) context.beginPath();
      const { radius, max_speed: speed } = this.#design(frame, i), farthest = (steps) => Math.max(LEAST_JUMP * radius, MARGIN * speed * steps);
      addTrail(context, dots, points, i, Math.min(apart, radius / 2), farthest, size);
      if (k % BATCH === BATCH - 1 || k === seen.length - 1) context.stroke();
    });
    context.fill(dots);
  }

  /** The points of the trails, the frame's own place as the last one. */
  get #way() {
    const { step, pose } = this.#frame, trail = this.#trail;
    return trail.length && trail.at(-1).step < step ? [...trail, { step, values: pose, stride: 3 }] : trail;
  }

  /** Return the rows of robots whose sectors are drawn. */
  #sensing(frame, rows, pointed) {
    if (!this.#toggles.sectors) return [];
    const dense = rows.length * frame.counts.sensors > MOST_SECTORS || this.#overlap(frame, rows) > (this.#dense ? AGAIN_OVERLAP : MOST_OVERLAP);
    if (dense !== this.#dense) {
      this.#dense = dense;
      this.onDense(dense);
    }
    if (!dense) return rows;
    const chosen = this.#chosen === null ? -1 : frame.ids.indexOf(this.#chosen);
    return [...new Set([chosen, pointed])].filter((row) => row >= 0);
  }

  /** Return how many sectors lie over a place of the map in sight, on average, if robots see nothing. */
  #overlap(frame, rows) {
    const { x, y, scale } = this.#view, [x0, y0, x1, y1] = this.#world.bounds, w = this.#width / 2 / scale, h = this.#height / 2 / scale;
    const left = Math.max(x0, x - w), right = Math.min(x1, x + w), low = Math.max(y0, y - h), high = Math.min(y1, y + h);
    let sum = 0;
    for (const i of rows) {
      const { area, reach } = this.#design(frame, i), px = frame.pose[3 * i], py = frame.pose[3 * i + 1];
      const across = Math.min(px + reach, right) - Math.max(px - reach, left), up = Math.min(py + reach, high) - Math.max(py - reach, low);
      if (across > 0 && up > 0) sum += (area * across * up) / (4 * reach * reach);
    }
    return sum / Math.max((right - left) * (high - low), 1e-9);
  }

  #drawSectors(frame, rows) {
    const context = this.#context, width = frame.counts.sensors, { distance, pose } = frame;
    const blind = new Batch(context, this.#colours.sector), seeing = new Batch(context, this.#colours.seeing);
    for (const i of rows) {
      const x = pose[3 * i], y = pose[3 * i + 1], heading = pose[3 * i + 2];
      const cos = Math.cos(heading), sin = Math.sin(heading), sensors = this.#design(frame, i).rows;
      for (let s = 0; s < sensors.length && s < width; s++) {
        const { mx, my, bearing, half, range } = sensors[s], read = distance[width * i + s];
        const px = x + cos * mx - sin * my, py = y + sin * mx + cos * my;
        addSector((read >= 0 ? seeing : blind).next(), px, py, read >= 0 ? read : range, heading + bearing, half);
      }
    }
    blind.fill();
    seeing.fill();
  }

  #drawHeat(frame, rows) {
    const context = this.#context;
    context.fillStyle = this.#colours.heat;
    context.beginPath();
    for (const i of rows) {
      const heat = Math.min(frame.heat[i], 1.2);
      if (heat < LEAST_HEAT) continue;
      const x = frame.pose[3 * i], y = frame.pose[3 * i + 1];
      disc(context, x, y, this.#radius(frame, i) * (1.15 + 1.1 * heat));
    }
    context.fill();
  }

  #drawMessages(frame, rows) {
    const context = this.#context;
    context.strokeStyle = this.#colours.message;
    context.lineWidth = 1.25 * this.#pixel;
    context.setLineDash([6 * this.#pixel, 4 * this.#pixel]);
    context.beginPath();
    for (const i of rows) {
      const x = frame.heard[2 * i], y = frame.heard[2 * i + 1];
      if (x !== x) continue;
      context.moveTo(frame.pose[3 * i], frame.pose[3 * i + 1]);
      context.lineTo(x, y);
    }
    context.stroke();
    context.setLineDash([]);
  }

  #drawPerceived(frame, rows) {
    const context = this.#context, dot = 2.2 * this.#pixel;
    context.strokeStyle = context.fillStyle = this.#colours.perceived;
    context.lineWidth = 1.5 * this.#pixel;
    const lines = new Path2D(), dots = new Path2D();
    for (const i of rows) {
      const centroid = perceived(frame, i, this.#design(frame, i).rows);
      if (!centroid) continue;
      lines.moveTo(frame.pose[3 * i], frame.pose[3 * i + 1]);
      lines.lineTo(...centroid);
      disc(dots, ...centroid, dot);
    }
    context.stroke(lines);
    context.fill(dots);
  }

  #drawBodies(frame, rows, rings) {
    const bodies = rows.map((i) => {
      const [x, y] = frame.pose.subarray(3 * i, 3 * i + 2), heading = this.#facing(frame, i);
      return { x, y, heading, radius: this.#radius(frame, i), layer: rings ? frame.layer[i] : -1, value: this.#shade(frame, i) };
    });
    this.#drawDiscs(this.#context, bodies);
  }

  /** Return where a robot's front is drawn: its heading; of one that moves without turning its direction of motion. */
  #facing(frame, row) {
    const heading = frame.pose[3 * row + 2];
    if (!frame.command || !this.#design(frame, row).holonomic) return heading;
    const ahead = frame.command[2 * row], left = frame.command[2 * row + 1];
    return Math.hypot(ahead, left) < STANDS ? heading : heading + Math.atan2(left, ahead);
  }

  /** Return which colour a robot's rear has: the index of its value, `HOT`, or -1 for the usual one. */
  #shade({ value, hot }, row) {
    if (value && value[row] >= 0) return value[row];
    return hot && this.#toggles.heat && hot[row] > 0 && !value ? HOT : -1;
  }

  #robotColour(shade) {
    if (shade === HOT) return this.#colours.robot_hot;
    return this.#values?.[shade] ?? this.#kindColour("robot", this.#colours.robot);
  }

  /** Draw robots of any size, each with the colour of its layer around it, -1 for none. */
  #drawDiscs(context, bodies) {
    const least = DROP_BELOW / this.#view.scale, small = bodies.filter(({ radius }) => radius < least);
    if (small.length) this.#drawDrops(context, small);
    if (small.length < bodies.length) this.#drawHalves(context, bodies.filter(({ radius }) => radius >= least));
  }

  /** Draw drops that point ahead in the colours of layers, in each a disc in two colours. */
  #drawDrops(context, bodies) {
    const drops = new Map(), rears = new Map(), front = new Path2D(), lean = Math.acos(1 / TIP);
    for (const { x, y, heading, radius, layer, value = -1 } of bodies) {
      const outer = layer < 0 ? radius : this.#ringRadius(radius) + this.#ringWidth / 2;
      const ring = layer < 0 ? this.#robotColour(value) : this.#layerColour(layer);
      const drop = pathIn(drops, ring);
      drop.moveTo(x + TIP * outer * Math.cos(heading), y + TIP * outer * Math.sin(heading));
      drop.arc(x, y, outer, heading + lean, heading - lean);
      drop.closePath();
      disc(pathIn(rears, value), x, y, radius);
      front.moveTo(x - 0.3 * radius * Math.cos(heading), y - 0.3 * radius * Math.sin(heading));
      front.arc(x, y, radius, heading - FRONT, heading + FRONT);
      front.closePath();
    }
    for (const [ring, drop] of drops) fillWith(context, ring, drop);
    for (const [value, rear] of rears) fillWith(context, this.#robotColour(value), rear);
    fillWith(context, this.#colours.robot_front, front);
  }

  /** Draw discs in two colours with a line ahead, and a ring in the colour of the layer. */
  #drawHalves(context, bodies) {
    const colours = this.#colours, rears = new Map(), front = new Path2D(), edge = new Path2D();
    for (const { x, y, heading, radius, value = -1 } of bodies) {
      const rear = pathIn(rears, value), cos = radius * Math.cos(heading), sin = radius * Math.sin(heading);
      rear.moveTo(x - sin, y + cos);
      rear.arc(x, y, radius, heading + TAU / 4, heading + (3 * TAU) / 4);
      front.moveTo(x + sin, y - cos);
      front.arc(x, y, radius, heading - TAU / 4, heading + TAU / 4);
      disc(edge, x, y, radius);
      edge.moveTo(x, y);
      edge.lineTo(x + cos, y + sin);
    }
    for (const [value, rear] of rears) fillWith(context, this.#robotColour(value), rear);
    fillWith(context, colours.robot_front, front);
    context.strokeStyle = colours.robot_outline;
    context.lineWidth = 1.1 * this.#pixel;
    context.stroke(edge);
    this.#drawRings(context, bodies);
  }

  #drawRings(context, bodies) {
    const rings = new Map();
    context.lineWidth = this.#ringWidth;
    for (const { x, y, radius, layer } of bodies) if (layer >= 0) disc(pathIn(rings, layer), x, y, this.#ringRadius(radius));
    for (const [layer, path] of rings) {
      context.strokeStyle = this.#layerColour(layer);
      context.stroke(path);
    }
  }

  get #ringWidth() { return Math.max(0.24 * this.#designs[0].radius, 1.6 * this.#pixel); }

  #ringRadius(radius) { return radius + this.#ringWidth / 2 + 0.4 * this.#pixel; }

  #copies(rows) {
    return rows.length > MOST_DRAWN && Math.max(this.#largest, this.#leastRadius) * this.#view.scale * this.#ratio <= LARGEST_COPIED;
  }

  #copyBodies(frame, rows, rings) {
    const context = this.#context, { pose } = frame, [s, left, top] = this.#origin();
    context.setTransform(1, 0, 0, 1, 0, 0);
    for (const i of rows) {
      const sheet = this.#sheet(this.#radius(frame, i), rings ? frame.layer[i] : -1, this.#shade(frame, i));
      sheet.copy(context, left + s * pose[3 * i], top - s * pose[3 * i + 1], this.#facing(frame, i));
    }
    this.#toMap(context);
  }

  /** Return the sheet of robots of this radius, layer and value, drawn when the scale or the theme has changed. */
  #sheet(radius, layer, value) {
    const [scale] = this.#origin();
    if (this.#sheets.scale !== scale) this.#sheets = { scale, made: new Map() };
    const { made } = this.#sheets, key = `${radius} ${layer} ${value}`;
    if (!made.has(key)) {
      const outer = TIP * (this.#ringRadius(radius) + this.#ringWidth / 2);
      made.set(key, new Sheet(scale * radius, scale * outer, (context, places) => {
        context.scale(scale, -scale);
        const bodies = places.map(({ x, y, heading }) => ({ x: x / scale, y: -y / scale, heading, radius, layer, value }));
        this.#drawDiscs(context, bodies);
      }));
    }
    return made.get(key);
  }

  /** Draw many robots: discs in the colour of their layer, and a line ahead if there is room for one. */
  #drawPlainly(frame, rows) {
    const context = this.#context, { pose } = frame, coloured = this.#toggles.layers && frame.layer;
    const groups = new Map();
    for (const i of rows) {
      const layer = frame.value || !coloured ? this.#shade(frame, i) : frame.layer[i];
      if (!groups.has(layer)) groups.set(layer, []);
      groups.get(layer).push(i);
    }
    const small = Math.max(this.#designs[0].radius, this.#leastRadius) * this.#view.scale < 3.5;
    for (const [layer, members] of groups) {
      context.fillStyle = coloured && !frame.value ? this.#layerColour(layer) : this.#robotColour(layer);
      if (small) this.#fillSquares(frame, members);
      else this.#fillDiscs(frame, members);
    }
    if (small) return;
    context.strokeStyle = this.#colours.robot_outline;
    context.lineWidth = 1.2 * this.#pixel;
    context.beginPath();
    for (const i of rows) {
      const x = pose[3 * i], y = pose[3 * i + 1], h = this.#facing(frame, i), r = this.#radius(frame, i);
      context.moveTo(x, y);
      context.lineTo(x + r * Math.cos(h), y + r * Math.sin(h));
    }
    context.stroke();
  }

  #fillSquares(frame, rows) {
    const context = this.#context, least = 0.8 * this.#pixel;
    for (const i of rows) {
      const r = Math.max(0.886 * this.#radius(frame, i), least);
      context.fillRect(frame.pose[3 * i] - r, frame.pose[3 * i + 1] - r, 2 * r, 2 * r);
    }
  }

  #fillDiscs(frame, rows) {
    const path = new Path2D();
    for (const i of rows) disc(path, frame.pose[3 * i], frame.pose[3 * i + 1], this.#radius(frame, i));
    this.#context.fill(path);
  }

  /** Draw where robots go that do not go where they look. */
  #drawTravel(frame, rows) {
    if (!frame.command || !this.#designs.some((design) => design.holonomic)) return;
    const path = new Path2D();
    for (const i of rows) {
      const moves = Math.hypot(frame.command[2 * i], frame.command[2 * i + 1]) >= STANDS;
      if (!moves || !this.#design(frame, i).holonomic) continue;
      const azimuth = this.#facing(frame, i), r = this.#radius(frame, i);
      addArrow(path, frame.pose[3 * i], frame.pose[3 * i + 1], azimuth, 1.45 * r, 2.5 * r);
    }
    this.#context.fillStyle = this.#colours.travel;
    this.#context.fill(path);
  }

  #drawContacts(frame) {
    const context = this.#context, path = new Path2D();
    for (let k = 0; k < frame.counts.contacts; k++) {
      const i = frame.contacts[2 * k], azimuth = frame.contacts[2 * k + 1], r = this.#radius(frame, i);
      const x = frame.pose[3 * i], y = frame.pose[3 * i + 1];
      path.moveTo(x + 1.1 * r * Math.cos(azimuth - 0.75), y + 1.1 * r * Math.sin(azimuth - 0.75));
      path.arc(x, y, 1.1 * r, azimuth - 0.75, azimuth + 0.75);
    }
    context.strokeStyle = this.#colours.contact;
    context.lineWidth = Math.max(0.4 * this.#designs[0].radius, 2.5 * this.#pixel);
    context.stroke(path);
  }

  #drawChosen(frame) {
    const row = this.#chosen === null ? -1 : frame.ids.indexOf(this.#chosen);
    if (row < 0) return;
    const context = this.#context, r = this.#radius(frame, row);
    context.strokeStyle = this.#colours.selection;
    context.lineWidth = 2.5 * this.#pixel;
    context.beginPath();
    disc(context, frame.pose[3 * row], frame.pose[3 * row + 1], 1.7 * r + 4 * this.#pixel);
    context.stroke();
  }

  /** Mark the robot that is pointed at, and name it with its layer. */
  #drawPointed(frame, row) {
    const context = this.#context, colours = this.#colours, x = frame.pose[3 * row], y = frame.pose[3 * row + 1], r = this.#radius(frame, row);
    this.#toMap(context);
    context.strokeStyle = colours.selection;
    context.lineWidth = 1.25 * this.#pixel;
    context.beginPath();
    disc(context, x, y, 1.7 * r + 4 * this.#pixel);
    context.stroke();
    const layer = this.#world.layers[frame.layer?.[row] ?? -1], text = `robot ${frame.ids[row]}${layer ? `, ${layer}` : ""}`;
    const [across, down] = this.#toPixels(context)(x, y), gap = (1.7 * r) / this.#pixel + 10;
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "middle";
    const width = context.measureText(text).width + 14, edge = this.#width / this.#enlarge - 4;
    const left = Math.min(Math.max(across - width / 2, 4), edge - width), top = down - gap - 22 < 4 ? down + gap : down - gap - 22;
    context.beginPath();
    context.roundRect(left, top, width, 22, 5);
    context.fillStyle = colours.field;
    context.strokeStyle = colours.edge;
    context.lineWidth = 1;
    context.fill();
    context.stroke();
    context.fillStyle = colours.ink;
    context.fillText(text, left + 7, top + 11.5);
  }

  #drawLabels({ fires, counts }) {
    const context = this.#context, at = this.#toPixels(context);
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (let i = 0; i < counts.fires; i++) {
      const [x, y, r, , robots, out] = fires.subarray(6 * i, 6 * i + 6), size = Math.min(r / this.#pixel, 22);
      if (size < 7) continue;
      context.font = `600 ${out ? 0.85 * size : size}px system-ui, sans-serif`;
      context.fillStyle = out ? this.#colours.on_ashes : this.#colours.on_fire;
      context.fillText(out ? "out" : String(robots), ...at(x, y));
    }
  }

  /** Write above each robot its text. */
  #drawTexts({ pose, label, ...frame }, rows) {
    const context = this.#context, at = this.#toPixels(context), width = label.length / frame.counts.robots;
    context.font = "600 11px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "bottom";
    context.lineWidth = 3;
    context.lineJoin = "round";
    context.strokeStyle = this.#colours.ground;
    context.fillStyle = this.#colours.ink;
    for (const i of rows) {
      const bytes = new Uint8Array(label.buffer, label.byteOffset + width * i, width), end = bytes.indexOf(0);
      const text = DECODER.decode(bytes.subarray(0, end < 0 ? width : end));
      if (!text) continue;
      const [x, y] = at(pose[3 * i], pose[3 * i + 1]), top = y - this.#radius(frame, i) / this.#pixel - 3;
      context.strokeText(text, x, top);
      context.fillText(text, x, top);
    }
  }

  /** Store the trail of a frame, behind the one before if it goes on from there. */
  #remember({ step, ids, trail }) {
    const last = this.#trail.at(-1), more = trail?.more && last && sameIds(last.ids, ids);
    const points = (trail?.points ?? []).filter((point) => !more || point.step > last.step).map((point) => ({ ...point, ids }));
    this.#trail = [...(more ? this.#trail : []), ...points].filter((point) => point.step >= step - TRAIL_STEPS);
  }

  #listen() {
    const canvas = this.#canvas, { signal } = this.#listeners, stop = (event) => event.touches.length > 1 && event.preventDefault();
    const listen = (name, act) => canvas.addEventListener(name, act, { signal, passive: false });
    this.#showCursor();
    listen("wheel", (event) => this.#turn(event));
    listen("pointerdown", (event) => this.#press(event));
    listen("pointermove", (event) => this.#drag(event));
    listen("pointerup", (event) => this.#release(event));
    listen("pointercancel", (event) => this.#lose(event));
    listen("pointerleave", () => this.#point(null));
    listen("dblclick", () => this.#tool || this.fit());
    // Otherwise the browser would scroll by the first of two fingers.
    listen("touchstart", stop);
    listen("touchmove", stop);
    const escape = (event) => event.key === "Escape" && this.#tool && (event.preventDefault(), this.#cancel());
    window.addEventListener("keydown", escape, { signal });
  }

  #place(event) {
    const box = this.#canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /** Return a place of the canvas as tools receive it: on the map, and what is there. */
  #spot(place, seen = true) {
    const [x, y] = this.toMap(...place);
    return seen ? { x, y, hit: this.hit(x, y) } : { x, y };
  }

  #turn(event) {
    const own = event.ctrlKey || event.metaKey || document.activeElement === this.#canvas || this.#takesWheel();
    if (!own) return;
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 20 : 1;
    this.zoom(Math.exp(-0.0015 * lines * event.deltaY), this.#place(event));
  }

  #press(event) {
    const place = this.#place(event);
    this.#canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, place);
    this.#spread = 0;
    this.#point(null);
    if (this.#pointers.size > 1) {
      if (this.#held !== null) this.#cancel();
      return;
    }
    this.#moved = 0;
    if (this.#tool && !event.button && this.#tool.press(this.#spot(place)) === true) this.#held = event.pointerId;
    if (this.#tool) this.#redraw();
  }

  #drag(event) {
    const before = this.#pointers.get(event.pointerId), now = this.#place(event);
    if (!before) return this.#hover(event, now);
    this.#pointers.set(event.pointerId, now);
    if (this.#held === event.pointerId) return this.#hand("move", now);
    const dx = now[0] - before[0], dy = now[1] - before[1];
    this.#moved += Math.hypot(dx, dy);
    if (this.#pointers.size > 1) return this.#pinch();
    // The finger scrolls the page, which the browser may not have noticed yet.
    if (this.#moved <= 4 || (event.pointerType === "touch" && this.#fitted)) return undefined;
    if (this.#followed !== null) this.follow(null);
    const { x, y, scale } = this.#view;
    return this.#look({ x: x - dx / scale, y: y + dy / scale, scale });
  }

  #release(event) {
    if (!this.#pointers.delete(event.pointerId)) return;
    this.#spread = 0;
    const place = this.#place(event);
    if (this.#held === event.pointerId) {
      this.#held = null;
      this.#hand("release", place);
    } else if (this.#moved <= 4 && !this.#tool) this.#pick(place);
  }

  #lose(event) {
    this.#pointers.delete(event.pointerId);
    this.#spread = 0;
    if (this.#held === event.pointerId) this.#cancel();
  }

  #hand(what, place) {
    this.#tool?.[what]?.(this.#spot(place, what === "hover"));
    this.#redraw();
  }

  /** Let the tool forget its drag; without a drag only on request. */
  #cancel(always = true) {
    const held = this.#held !== null;
    this.#held = null;
    if (held || always) this.#tool?.cancel?.();
    this.#redraw();
  }

  #hover(event, place) {
    if (this.#tool) this.#hand("hover", place);
    else if (event.pointerType !== "touch") this.#point(place);
  }

  /** Point at a place of the canvas, null for none. */
  #point(place) {
    const before = this.#pointed;
    this.#pointed = place;
    if (!this.#frame || (!before && !place)) return;
    const one = before ? this.#robotAt(...this.toMap(...before)) : -1, other = place ? this.#robotAt(...this.toMap(...place)) : -1;
    if (one !== other) this.#redraw();
    this.#showCursor(other >= 0);
  }

  #pointedRow() { return this.#pointed ? this.#robotAt(...this.toMap(...this.#pointed)) : -1; }

  /** Show what the pointer does, and leave to the page what it does itself: scroll by a finger while all is in sight. */
  #showCursor(pointing = false) {
    const style = this.#canvas.style, cursor = this.#tool?.cursor ?? (pointing ? "pointer" : ""), touch = this.#fitted && !this.#tool ? "pan-y" : "none";
    if (style.cursor !== cursor) style.cursor = cursor;
    if (style.touchAction !== touch) style.touchAction = touch;
  }

  /** Zoom by how far two fingers are apart, and pan by the place between them. */
  #pinch() {
    const [[ax, ay], [bx, by]] = this.#pointers.values(), spread = Math.hypot(ax - bx, ay - by), middle = [(ax + bx) / 2, (ay + by) / 2];
    if (this.#spread) {
      const { x, y, scale } = this.#view, [mx, my] = this.#middle;
      this.#look({ x: x - (middle[0] - mx) / scale, y: y + (middle[1] - my) / scale, scale });
      this.zoom(spread / this.#spread, middle);
    }
    this.#spread = spread;
    this.#middle = middle;
  }

  #pick(place) {
    if (!this.#frame) return;
    const row = this.#robotAt(...this.toMap(...place)), best = row < 0 ? null : this.#frame.ids[row];
    this.select(best);
    this.onSelect(best);
  }
}

/** Return where on the map a robot perceives the centroid of the robots that it sees, or null. */
export function perceived(frame, row, sensors) {
  const width = frame.counts.sensors, heading = frame.pose[3 * row + 2];
  let count = 0, x = 0, y = 0;
  for (let s = 0; s < sensors.length && s < width; s++) {
    if (frame.kind[width * row + s] !== ROBOT) continue;
    const { mx, my, bearing } = sensors[s], distance = frame.distance[width * row + s];
    count += 1;
    x += mx + distance * Math.cos(bearing);
    y += my + distance * Math.sin(bearing);
  }
  if (!count) return null;
  const cos = Math.cos(heading) / count, sin = Math.sin(heading) / count;
  return [frame.pose[3 * row] + cos * x - sin * y, frame.pose[3 * row + 1] + sin * x + cos * y];
}

function sensorRow([mx, my, bearing, half, range]) {
  return { mx, my, bearing, half, range };
}

/** Return what to leave free before and after, nothing if less than half of the whole would remain. */
function roomy(whole, before, after) {
  return before + after <= whole / 2 ? [before, after] : [0, 0];
}

function reachOf(design) {
  return design.radius + design.sensors.reduce((most, [, , , , range]) => Math.max(most, range), 0);
}

/** Return the area of all sectors of a design. */
function areaOf({ sensors }) {
  return sensors.reduce((sum, [, , , half, range]) => sum + Math.min(half, Math.PI) * range * range, 0);
}

/** Return whether anything around an element scrolls down. */
export function scrollsAround(element) {
  for (let one = element.parentElement; one; one = one.parentElement) {
    const root = one === document.scrollingElement || one === document.body;
    if (one.scrollHeight > one.clientHeight + 1 && (root ? one === document.scrollingElement && getComputedStyle(one).overflowY !== "hidden"
      : /auto|scroll/.test(getComputedStyle(one).overflowY))) return true;
  }
  return false;
}

function pathIn(paths, key) {
  if (!paths.has(key)) paths.set(key, new Path2D());
  return paths.get(key);
}

function fillWith(context, colour, path) {
  context.fillStyle = colour;
  context.fill(path);
}

function disc(path, x, y, r) {
  path.moveTo(x + r, y);
  path.arc(x, y, r, 0, TAU);
}

/** Many parts in one colour, filled some at a time: thousands in one path take three times as long. */
class Batch {
  #context; #colour; #path = new Path2D(); #count = 0;

  constructor(context, colour) {
    this.#context = context;
    this.#colour = colour;
  }

  /** Return the path to which the next part is to be added. */
  next() {
    if (this.#count++ === BATCH) this.fill();
    return this.#path;
  }

  fill() {
    this.#context.fillStyle = this.#colour;
    this.#context.fill(this.#path);
    this.#path = new Path2D();
    this.#count = 1;
  }
}

/** Robots drawn beforehand at every place within a pixel and every heading: pixels are copied faster than drawn. */
class Sheet {
  #canvas = document.createElement("canvas");
  #size; #turns;

  /** Parameters in pixels; `draw` is given a context and the places and headings where robots are to stand. */
  constructor(radius, outer, draw) {
    const size = (this.#size = 2 * Math.ceil(outer + 2)), turns = (this.#turns = Math.max(1, Math.ceil(TURNS * TAU * radius)));
    this.#canvas.width = size * PLACES ** 2;
    this.#canvas.height = size * turns;
    const places = [];
    for (let turn = 0; turn < turns; turn++) {
      for (let place = 0; place < PLACES ** 2; place++) {
        const x = size * (place + 0.5) + (place % PLACES) / PLACES;
        const y = size * (turn + 0.5) + Math.floor(place / PLACES) / PLACES;
        places.push({ x, y, heading: (TAU * turn) / turns });
      }
    }
    draw(this.#canvas.getContext("2d"), places);
  }

  /** Copy the robot that looks this way to a place of the canvas. */
  copy(context, x, y, heading) {
    const size = this.#size, across = Math.round(PLACES * x), down = Math.round(PLACES * y);
    const left = Math.floor(across / PLACES), top = Math.floor(down / PLACES);
    const place = across - PLACES * left + PLACES * (down - PLACES * top);
    const turn = Math.round((heading / TAU) * this.#turns) % this.#turns;
    const from = size * (turn < 0 ? turn + this.#turns : turn);
    context.drawImage(this.#canvas, size * place, from, size, size, left - size / 2, top - size / 2, size, size);
  }
}

/** Whether a trail lies below its robot, which hides it. */
function isBelow(points, row, radius) {
  const { values: now, stride: wide } = points.at(-1), x = now[row * wide], y = now[row * wide + 1];
  return points.every(({ values, stride }) => (values[row * stride] - x) ** 2 + (values[row * stride + 1] - y) ** 2 < radius * radius);
}

/** Add the trail of a robot: to the path of `lines` what it has gone, to `dots` the places between which its way is not known. */
function addTrail(lines, dots, points, row, apart, farthest, size) {
  let before = null, x = 0, y = 0, from = null; // the point before, and where the line has got to
  points.forEach((point, k) => {
    const { step, values, stride, moved } = point, nextX = values[row * stride], nextY = values[row * stride + 1];
    const steps = before ? step - before.step : 0;
    const jumped = !before || moved?.has(row) || Math.hypot(nextX - before.x, nextY - before.y) > farthest(steps);
    if (!jumped && steps > 1) for (const place of [before, { x: nextX, y: nextY }]) disc(dots, place.x, place.y, size);
    if (jumped || steps > 1) from = null;
    else {
      if (from === null) lines.moveTo((x = before.x), (y = before.y));
      from = before;
      if (Math.hypot(nextX - x, nextY - y) >= apart || k === points.length - 1) lines.lineTo((x = nextX), (y = nextY));
    }
    before = { step, x: nextX, y: nextY };
  });
}

function addSector(path, x, y, range, azimuth, half) {
  if (half >= Math.PI) return disc(path, x, y, range);
  path.moveTo(x, y);
  path.arc(x, y, range, azimuth - half, azimuth + half);
  return path.closePath();
}

function addArrow(path, x, y, azimuth, from, to) {
  const cos = Math.cos(azimuth), sin = Math.sin(azimuth), side = 0.6 * (to - from);
  path.moveTo(x + to * cos, y + to * sin);
  path.lineTo(x + from * cos - side * sin, y + from * sin + side * cos);
  path.lineTo(x + from * cos + side * sin, y + from * sin - side * cos);
  path.closePath();
}

function pathOf({ disc: round, rings = [] }) {
  const path = new Path2D();
  if (round) disc(path, ...round);
  for (const ring of rings) {
    ring.forEach(([x, y], k) => (k ? path.lineTo(x, y) : path.moveTo(x, y)));
    path.closePath();
  }
  return path;
}

/** Return how far a shape reaches from the origin. */
function extentOf({ disc: round, rings = [] }) {
  if (round) return Math.hypot(round[0], round[1]) + round[2];
  return Math.max(0, ...rings.map((ring) => ring.reduce((most, [x, y]) => Math.max(most, Math.hypot(x, y)), 0)));
}

/** Return a field as an image, its first row that of the field; coloured as by `scalar_pixels` in palette.py. */
function fieldImage(field, colour) {
  if (field.image?.colour === colour) return field.image.canvas; // the same frame is drawn anew when the view changes
  const { rows, columns, levels } = field, canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [columns, rows];
  const context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
  const [red, green, blue, most] = [1, 3, 5, 7].map((place) => parseInt(colour.slice(place, place + 2), 16));
  const shades = new Uint8Array(1024);
  for (let level = 0; level < 256; level++) {
    shades.set([red, green, blue, Math.floor((level * most) / 255 + 0.5)], 4 * level);
  }
  const words = new Uint32Array(shades.buffer), pixels = new Uint32Array(image.data.buffer);
  for (let k = 0; k < pixels.length; k++) pixels[k] = words[levels[k]];
  context.putImageData(image, 0, 0);
  field.image = { colour, canvas };
  return canvas;
}

// Forms that are bars of colours, with a range.
const BARS = ["value", "field", "fire", "radiant"];
// How others are drawn beside their names: paths in a box of 16 by 12, each filled or (from "-" on) a line, "=" a dashed one.
const ROUND = (r, x = 8) => `M${x - r} 6a${r} ${r} 0 1 1 ${2 * r} 0a${r} ${r} 0 1 1 ${-2 * r} 0z`, HALVES = [ROUND(5), "M8 1a5 5 0 0 1 0 10z", "-" + ROUND(5)];
const SECTOR = "M1 6L13.5 .5A13 13 0 0 1 13.5 11.5z";
const SIGNS = {
  robot: HALVES, robot_hot: HALVES, heat: [ROUND(6)], ashes: [ROUND(5), "-" + ROUND(5)], layer: ["3-" + ROUND(4)], disc: [ROUND(4)], sector: [SECTOR], seeing: [SECTOR],
  contact: ["3-M4 2a5.5 5.5 0 0 0 8 0"], message: ["=M0 6H16"], trail: ["2-M0 9C5 9 7 3 16 3"], places: [2, 8, 14].map((x) => ROUND(2, x)), perceived: ["-M0 6H13", ROUND(2, 13)],
  selection: ["2-" + ROUND(4.5)], travel: ["M14 6L3 11V1z"],
};

// The namespace of SVG, which is a name only: written so that no page seems to refer to an address outside.
const SVG = ["http:", "", "www.w3.org", "2000", "svg"].join("/");

/** Fill a list with a legend: what `stage.legend()` returns. Items stay as they are where only a range has changed. */
export function fillLegend(list, entries) {
  const is = JSON.stringify(entries.map(({ form, name, colours }) => [form, name, colours]));
  if (list.legend !== is) list.replaceChildren(...entries.map(legendItem));
  list.legend = is;
  entries.forEach(({ form, low, high }, index) => {
    const range = list.children[index].lastChild, text = high > low ? `${digits(low)} to ${digits(high)}` : "";
    if (BARS.includes(form) && range.textContent !== text) range.textContent = text;
  });
}

function legendItem({ form, name, colours }) {
  const item = document.createElement("li"), sign = document.createElement("i"), text = document.createElement("span");
  item.dataset.form = form;
  if (SIGNS[form]) sign.append(signOf(SIGNS[form], colours));
  else sign.style.background = BARS.includes(form) ? `linear-gradient(${["to right", ...colours]})` : colours[0];
  text.textContent = name;
  text.title = name;
  item.append(sign, text, " ", document.createElement("b"));
  return item;
}

function signOf(paths, colours) {
  const make = (tag, attributes) => {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };
  const picture = make("svg", { viewBox: "0 0 16 12", width: 16, height: 12, "aria-hidden": true });
  picture.append(...paths.map((path, index) => {
    const colour = colours[Math.min(index, colours.length - 1)], [, width, kind, d] = path.match(/^(\d?)([-=]?)(.*)$/);
    const line = { fill: "none", stroke: colour, "stroke-width": width || 1.25, ...(kind === "=" ? { "stroke-dasharray": "4 3" } : {}) };
    return make("path", { d, ...(kind ? line : { fill: colour }) });
  }));
  return picture;
}

function digits(value) { return String(Number(value.toPrecision(3))); }

/** Return the colour of a fire; rounded as by `fire_steps` in palette.py. */
function fireColour({ fire }, temperature) {
  return fire[Math.floor(Math.min(Math.max(temperature, 0), 1) * (fire.length - 1) + 0.5)];
}

function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length)), digit = length / power;
  return power * (digit >= 5 ? 5 : digit >= 2 ? 2 : 1);
}

/** Whether two lists of ids are equal. */
export function sameIds(one, two) {
  return one.length === two.length && one.every((id, k) => id === two[k]);
}
