/* What stands around the canvas of canvas.js, to which elements.js and this text are appended: buttons, readings, and the talk with
   Python. All that Python sends comes through one channel, so that it arrives in order: { kind: "world", ... },
   { kind: "picture", ... } with the frame as its buffer, { kind: "state", ... }. A picture is acknowledged as soon
   as it is drawn; Python sends no more than two ahead, so that a slow browser leaves some out and lags behind none.
   Each view of a widget has a name, with which it signs what it sends; what has another name in `to` is not for it. */

const ICONS = {
  play: "M5 3.5v13l11-6.5z", pause: "M5 3.5h3.6v13H5zM11.4 3.5H15v13h-3.6z", step: "M4 3.5l8 6.5-8 6.5zM13 3.5h2.6v13H13z",
  back: "M16 3.5L8 10l8 6.5zM4.4 3.5H7v13H4.4z", reset: "M10 3a7 7 0 1 1-6.6 4.7l1.9.7A5 5 0 1 0 10 5v3L5.4 4 10 0z",
  closer: "M9 4h2v5h5v2h-5v5H9v-5H4V9h5z", farther: "M4 9h12v2H4z", fit: "M3 3h5v2H5v3H3zM12 3h5v5h-2V5h-3zM3 12h2v3h3v2H3zM15 12h2v5h-5v-2h3z",
  follow: "M10 2v3a5 5 0 0 1 5 5h3v1h-3a5 5 0 0 1-4.5 4V18h-1v-3A5 5 0 0 1 5 11H2v-1h3a5 5 0 0 1 5-5zM10 7.5a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  eye: "M10 4.5c4.2 0 7.2 3 8.5 5.5-1.3 2.5-4.3 5.5-8.5 5.5S2.8 12.5 1.5 10C2.8 7.5 5.8 4.5 10 4.5zM10 6.8a3.2 3.2 0 1 0 0 6.4 3.2 3.2 0 0 0 0-6.400z",
};
const FASTEST = "as fast as it goes";
const TYPED_IN = "input, textarea, select, [contenteditable], [role=listbox]";
// What a slider and what a button do themselves; all other keys are the player's there too.
const SLIDES = /^(Arrow|Home$|End$|Page)/, SLIDER = "input[type=range], [role=slider]";
const PRESSED = "button, summary, a, input[type=checkbox]";

// Shortest time between changes of numbers, s: faster is not readable, and drawing text takes as long as drawing robots.
const WRITE_EVERY = 0.15;
// A stage that is lower is all map, CSS pixels; and the gap between the map and what stands beside it.
const LOW = 240, GAP = 8;
// In a smaller stage the legend is folded at first.
const LEAST_WITH_LEGEND = { width: 520, height: 450 };
const LEGEND = "mesa_swarm.legend", VIEW = "mesa_swarm.view ";
// Least time between storings of the view, s.
const STORE_EVERY = 0.3;
// How much larger lines and texts are on a projector.
const PROJECTED = 1.6;
// Pictures that wait to be drawn; how close together they count as quick, s; of quick ones every one of this many is
// reported, and a last one after this time, s.
const MOST_WAITING = 5, QUICK = 0.03, ANSWERED = 3, LATEST = 0.1;
const TOO_MANY = ": of the selected robot only, too many in sight";

/** What the browser stores, and until the page is left also where it stores nothing: in some notebooks. */
const stored = {
  here: new Map(),
  get(place, name) {
    try { return JSON.parse(globalThis[place].getItem(name)) ?? this.here.get(name); } catch { return this.here.get(name); }
  },
  set(place, name, value) {
    this.here.set(name, value);
    try { globalThis[place].setItem(name, JSON.stringify(value)); } catch { /* then it is forgotten with the page */ }
  },
};

function iconButton(icon, label, act, more = {}) {
  const button = make("button", { type: "button", title: label, "aria-label": label, click: act, ...more });
  button.innerHTML = `<svg viewBox="0 0 20 20" aria-hidden="true"><path fill-rule="evenodd" d="${ICONS[icon]}"/></svg>`;
  return button;
}

function relabel(button, icon, label) {
  if (button.getAttribute("aria-label") === label) return;
  button.setAttribute("aria-label", label);
  button.title = label;
  button.querySelector("path").setAttribute("d", ICONS[icon]);
}

// States of a kernel that has forgotten the widget; JupyterLab informs widgets of the first only.
const ENDED = new Set(["restarting", "autorestarting", "dead", "terminating"]);
const GONE = "The kernel is gone: run the cell again";
const STORED = "The last picture, without a kernel: run the cell to play";

/** Act when the kernel that a notebook has now ends or begins anew; return how to stop. */
function watchKernel(manager, act) {
  const kernel = manager?.kernel, look = (_, status) => ENDED.has(status) && act();
  kernel?.statusChanged?.connect(look);
  kernel?.disposed?.connect(act);
  return () => {
    kernel?.statusChanged?.disconnect(look);
    kernel?.disposed?.disconnect(act);
  };
}

/** Whether what has the focus makes use of a key itself; what was pressed by a pointer leaves the space bar to the player. */
function isTaken(key, target, pointed) {
  if (target.closest("dialog")) return true;
  if (target.closest(SLIDER)) return SLIDES.test(key);
  if (target.closest(PRESSED)) return key === " " && !pointed;
  return Boolean(target.closest(TYPED_IN));
}

function asBytes(part) { return new Uint8Array(part.buffer ?? part, part.byteOffset ?? 0, part.byteLength); }

/** Return the trail of a frame: what a picture has of it beside its places, which are shares of the map, 65535 for all of it. */
function trailOf({ bounds: [x0, y0, x1, y1] }, { more, steps, moved }, bytes) {
  const shares = new Uint16Array(bytes.slice().buffer), length = shares.length / steps.length;
  const low = [x0, y0], unit = [(x1 - x0) / 65535, (y1 - y0) / 65535];
  const points = steps.map((step, k) => ({
    step, stride: 2, moved: moved[k].length ? new Set(moved[k]) : null,
    values: Float32Array.from(shares.subarray(k * length, (k + 1) * length), (share, at) => low[at % 2] + share * unit[at % 2]),
  }));
  return { more, points };
}

/** The bar, the canvas and the time line of one view of a widget. */
class PlayerView {
  #name = Math.random().toString(36).slice(2);
  #model; #root; #canvas; #stage = null; #world = null;
  #state = { playing: false, speed: 0, speeds: [], finished: false, error: "", can_reset: false, newest: 0 };
  // Pictures that wait for the next frames of the screen, one for each: two that arrive together are both drawn.
  #waiting = [];
  #asked = 0;
  // How many pictures were drawn and not reported, how many the server waits for, when the last one was drawn, and the
  // timer of the report.
  #unanswered = 0; #each = 1; #before = 0; #answering = 0;
  #drawn = 0;
  #written = 0;
  #shown = { pushed: 0, fingerprint: "" };
  #staged = true;
  #storing = 0;
  // Whether the server was requested to send trails.
  #traced = false;
  #leave = [];
  #parts = {};
  // Whether a pointer was used last, not the Tab key; whether the space bar was the player's; whether it waits to be seen.
  #pointed = !document.activeElement?.matches(":focus-visible");
  #spaced = false;
  #unseen = false;

  constructor(model, root) {
    this.#model = model;
    this.#root = root;
    root.classList.add("swarm-player");
    root.classList.toggle("swarm-compact", Boolean(model.get("options").compact));
    const options = model.get("options");
    this.#staged = options.stage ?? true;
    this.#canvas = make("canvas", { tabindex: "0", role: "img", "aria-label": "the world" });
    this.#build(options);
    this.#listen(options);
    this.#retheme();
    if (options.compact) this.#watchKernel();
    this.#begin();
  }

  #begin() {
    this.#traced = false;
    this.#send({ do: "ready" });
  }

  destroy() {
    this.#store();
    this.#send({ do: "left" });
    this.#leave.forEach((leave) => leave());
    cancelAnimationFrame(this.#asked);
    clearTimeout(this.#answering);
    this.#stage?.destroy();
  }

  #send(message) {
    try {
      this.#model.send({ ...message, view: this.#name });
    } catch {
      // The connection has ended, which is shown by other means.
    }
  }

  /** In a notebook, state over the picture that there is no kernel, until there is one again. */
  #watchKernel() {
    const root = this.#root, show = (gone) => {
      const was = root.classList.contains("swarm-is-gone");
      showGone(root, gone ? (this.#drawn ? GONE : STORED) : "");
      if (was && !gone) this.#begin();
    };
    const hear = function () { show(this?.model?.comm_live === false); }; // called with the view of which this is a part
    this.#model.on("comm_live_update", hear);
    this.#leave.push(() => this.#model.off("comm_live_update", hear), watchKernel(this.#model.widget_manager, () => show(true)));
    show(root.classList.contains("jupyter-widgets-disconnected"));
  }

  #on(target, name, act, first = false) {
    target.addEventListener(name, act, first);
    this.#leave.push(() => target.removeEventListener(name, act, first));
  }

  #build({ bar, head, toggles, errors }) {
    const parts = this.#parts, act = (name) => () => this.#send({ do: name });
    parts.play = iconButton("play", "Play", act("toggle"), { class: "swarm-main" });
    parts.back = iconButton("back", "Step back", act("back"));
    parts.step = iconButton("step", "Step", act("step"));
    parts.reset = iconButton("reset", "Reset", act("reset"));
    const send = () => this.#send({ do: "speed", value: Number(parts.speed.value) });
    parts.speed = make("input", { type: "range", min: 0, max: 12, step: 1, "aria-label": "Speed", input: send });
    parts.requested = make("output", {});
    parts.readings = make("dl", { class: "swarm-readings" });
    const look = () => this.#send({ do: "look", value: Number(parts.past.value) });
    parts.past = make("input", { type: "range", min: 0, max: 0, step: 1, "aria-label": "Steps in memory", input: look });
    parts.when = make("span", { class: "swarm-when" });
    const buttons = make("div", { class: "swarm-buttons", role: "toolbar", "aria-label": "Play" });
    buttons.append(parts.back, parts.play, parts.step, parts.reset);
    const speed = make("label", { class: "swarm-speed" }, parts.speed, parts.requested);
    if (bar) this.#root.append(make("div", { class: "swarm-bar" }, buttons, speed, parts.readings));
    parts.caption = make("strong", { class: "swarm-caption" });
    if (head) this.#root.append(make("div", { class: "swarm-head" }, parts.caption, parts.readings));
    const still = make("img", { class: "swarm-still", alt: "", src: this.#model.get("picture") || undefined });
    const stage = make("div", { class: "swarm-stage" }, still, this.#canvas, this.#tools(toggles), this.#key());
    parts.error = make("p", { class: "swarm-error", role: "alert", hidden: true });
    if (errors) this.#root.append(parts.error);
    if (this.#staged) this.#root.append(stage);
    else this.#root.classList.add("swarm-unstaged");
    if (bar) this.#root.append(make("div", { class: "swarm-past" }, parts.past, parts.when));
  }

  #tools(toggles) {
    const parts = this.#parts, on = { ...Object.fromEntries(TOGGLES.map((one) => [one.name, one.on])), ...toggles };
    parts.usual = parts.on = on;
    parts.follow = iconButton("follow", "Follow the selected robot", () => this.#follow(), { "aria-pressed": "false" });
    parts.boxes = make("div", {});
    const summary = make("summary", { title: "What is drawn", "aria-label": "What is drawn" });
    summary.innerHTML = `<svg viewBox="0 0 20 20" aria-hidden="true"><path fill-rule="evenodd" d="${ICONS.eye}"/></svg>`;
    parts.menu = make("details", {}, summary, parts.boxes);
    return (parts.tools = make("div", { class: "swarm-tools" },
      iconButton("closer", "Zoom in", () => this.#stage?.zoom(1.4)),
      iconButton("farther", "Zoom out", () => this.#stage?.zoom(1 / 1.4)),
      iconButton("fit", "Show the whole map", () => this.#fit()), parts.follow, parts.menu));
  }

  /** Offer to show and hide what there is in this world. */
  #fillBoxes() {
    const { on, boxes } = this.#parts;
    boxes.replaceChildren(...togglesOf(this.#world).map(({ name, label, on: usual }) => {
      const box = make("input", { type: "checkbox", change: () => this.#toggle(name, box.checked) });
      box.checked = on[name] ??= usual;
      return make("label", { "data-name": name }, box, make("span", {}, label));
    }));
  }

  /** Explain in the menu why most sectors are not drawn. */
  #showDensity(dense) {
    const text = this.#parts.boxes.querySelector('[data-name="sectors"] span'), usual = TOGGLES.find(({ name }) => name === "sectors").label;
    if (text) text.textContent = dense ? usual + TOO_MANY : usual;
    requestAnimationFrame(() => this.#fillKey()); // not while the stage draws
  }

  #key() {
    const parts = this.#parts, fold = () => this.#foldLegend(!parts.legend.hidden);
    parts.legend = make("ul", { "aria-label": "Legend" });
    parts.fold = make("button", { type: "button", click: fold }, "Legend");
    return (parts.key = make("div", { class: "swarm-key" }, parts.fold, parts.legend));
  }

  /** Fold the legend or unfold it, and remember that for canvases of about this size. */
  #foldLegend(folded) {
    stored.set("localStorage", LEGEND + this.#size, folded ? "folded" : "open");
    this.#fillKey();
  }

  get #size() {
    const { clientWidth: width, clientHeight: height } = this.#canvas, { width: least, height: lowest } = LEAST_WITH_LEGEND;
    return width >= least && height >= lowest ? "" : " small";
  }

  get #folded() { return (stored.get("localStorage", LEGEND + this.#size) ?? (this.#size ? "folded" : "open")) === "folded"; }

  #listen({ keys }) {
    const hear = (message, buffers) => this.#hear(message, buffers), press = (event) => this.#press(event);
    this.#model.on("msg:custom", hear);
    this.#leave.push(() => this.#model.off("msg:custom", hear));
    const choose = () => {
      this.#stage?.select(this.#model.get("selected"));
      this.#fillKey();
    };
    this.#model.on("change:selected", choose);
    this.#leave.push(() => this.#model.off("change:selected", choose));
    const where = keys === "page" ? window : this.#root;
    if (keys) this.#on(where, "keydown", press);
    if (keys) this.#on(where, "keyup", (event) => this.#release(event));
    this.#on(window, "pointerdown", () => (this.#pointed = true), true);
    this.#on(window, "keydown", ({ key }) => (this.#pointed &&= key !== "Tab"), true);
    this.#on(document, "visibilitychange", () => this.#watch());
    if (keys === "own") requestAnimationFrame(() => this.#takeKeys());
    this.#leave.push(watchTheme(this.#root, () => this.#retheme()));
    const close = (event) => this.#parts.menu.contains(event.target) || (this.#parts.menu.open = false);
    document.addEventListener("pointerdown", close);
    this.#leave.push(() => document.removeEventListener("pointerdown", close));
    const store = () => this.#store();
    window.addEventListener("pagehide", store);
    this.#leave.push(() => window.removeEventListener("pagehide", store));
    const projector = new MutationObserver(() => this.#enlarge());
    projector.observe(document.documentElement, { attributes: true, attributeFilter: ["data-projector"], subtree: true });
    this.#leave.push(() => projector.disconnect());
    const fold = new ResizeObserver(() => this.#parts.legend.hidden === this.#folded || this.#fillKey());
    fold.observe(this.#canvas);
    this.#leave.push(() => fold.disconnect());
  }

  /** Draw larger where the page is arranged for a projector. */
  #enlarge() {
    if (this.#stage) this.#stage.enlarge = this.#root.closest('[data-projector="1"]') ? PROJECTED : 1;
  }

  /** The name under which the view is stored, if there is one. */
  get #stores() {
    const { remember } = this.#model.get("options");
    return remember && this.#world ? `${VIEW}${remember} ${this.#world.model}` : "";
  }

  #viewed() {
    this.#storing ||= setTimeout(() => this.#store(), 1000 * STORE_EVERY);
  }

  /** Store what is in sight and what is switched on, for when this world is shown again. */
  #store() {
    clearTimeout(this.#storing);
    this.#storing = 0;
    if (!this.#stores || !this.#stage) return;
    const { view, followed } = this.#stage, bounds = this.#world.bounds;
    stored.set("sessionStorage", this.#stores, { bounds, view, followed, switched: this.#parts.switched });
  }

  /** Return what was stored, unless it was of another map. */
  #restored() {
    const found = this.#stores ? stored.get("sessionStorage", this.#stores) : null;
    return String(found?.bounds) === String(this.#world.bounds) ? found : null;
  }

  /** Have JupyterLab leave all keys to what has the focus here: otherwise R makes the cell raw, and arrows leave it. */
  #takeKeys() {
    const output = this.#root.closest(".swarm-notebook") ?? this.#root, take = ({ target }) => (target.dataset.lmSuppressShortcuts = "true");
    output.addEventListener("focusin", take);
    this.#leave.push(() => output.removeEventListener("focusin", take));
  }

  #retheme() {
    const theme = themeAround(this.#root);
    this.#root.dataset.theme = theme;
    if (this.#stage) this.#stage.theme = theme;
    this.#fillKey();
  }

  #hear(message, buffers) {
    if (message.to !== undefined && message.to !== this.#name) return;
    if (message.kind === "world") this.#enter(message.world);
    else if (message.kind === "state") this.#settle(message.state);
    else if (message.kind === "picture") {
      const bytes = buffers[0];
      this.#waiting.push({ ...message, bytes: asBytes(bytes), places: message.trail && asBytes(buffers[1]) });
      if (this.#waiting.length > MOST_WAITING) this.#pass(this.#waiting.shift()); // in a hidden tab
      this.#askToDraw();
    }
  }

  #enter(world) {
    if (!this.#staged) return;
    const before = this.#stage;
    this.#store();
    this.#world = world;
    this.#waiting = [];
    if (before && this.#sameView(before)) { // a parameter was changed, something was added, or it was reset
      before.world = world;
      this.#fillBoxes();
      this.#requestTrails();
      return;
    }
    before?.destroy();
    const onSelect = (id) => this.#choose(id), onFollow = (id) => this.#followed(id), onView = () => this.#viewed();
    const again = this.#stores ? this.#restored() : this.#sameView(before);
    this.#parts.switched = again?.switched ?? {};
    this.#parts.on = { ...this.#parts.usual, ...this.#parts.switched };
    this.#fillBoxes();
    const calls = { onSelect, onFollow, onView, onDense: (dense) => this.#showDensity(dense), takesWheel: () => this.#takesWheel() };
    this.#stage = new Stage(this.#canvas, world, { theme: this.#root.dataset.theme, covered: () => this.#covered(), ...calls });
    for (const [name, on] of Object.entries(this.#parts.on)) this.#stage.set(name, on);
    this.#requestTrails();
    this.#stage.select(this.#model.get("selected"));
    this.#enlarge();
    this.#fillKey();
    if (again?.view) this.#stage.view = again.view;
    if (again?.followed != null) this.#stage.follow(again.followed);
    this.#canvas.arena = () => this.#arena();
    this.#canvas.stage = this.#stage;
    this.#canvas.dispatchEvent(new Event("swarm-stage"));
  }

  /** Return what was shown before of the same model: it was reset, or something was added. */
  #sameView(before) {
    const is = ({ model, bounds }) => `${model} ${bounds}`, { switched } = this.#parts;
    return before && is(before.world) === is(this.#world) ? { view: before.view, followed: before.followed, switched } : null;
  }

  /** Whether the wheel zooms without the focus: on a page that does not scroll. In a notebook what scrolls may be out of sight. */
  #takesWheel() {
    return Boolean(this.#root.closest(".swarm")) && !scrollsAround(this.#canvas);
  }

  /** Return where the map is on the canvas: left, top, right, bottom in CSS pixels. */
  #arena() {
    const [x0, y0, x1, y1] = this.#world.bounds;
    return [...this.#stage.toCanvas(x0, y1), ...this.#stage.toCanvas(x1, y0)];
  }

  /** Return how far from each edge buttons, legend and scale reach; in a low stage all of them stand at the sides. */
  #covered() {
    const { tools, key } = this.#parts, size = this.#stage?.enlarge ?? 1, stage = this.#canvas.parentElement, all = stage.getBoundingClientRect();
    const low = all.height < LOW, nothing = { left: 0, top: 0, bottom: 0 };
    stage.classList.toggle("swarm-low", low);
    const layers = key.getBoundingClientRect(), right = all.right - tools.getBoundingClientRect().left + GAP;
    if (low) return { ...nothing, right, left: Math.max(size * SCALE.width, layers.right - all.left) + GAP };
    return { ...nothing, right, bottom: Math.max(size * SCALE.height, key.hidden ? 0 : all.bottom - layers.top) + GAP };
  }

  #askToDraw() {
    this.#asked ||= requestAnimationFrame(() => this.#draw());
  }

  #draw() {
    this.#asked = 0;
    const picture = this.#waiting.shift();
    if (this.#waiting.length) this.#askToDraw();
    if (!picture || (this.#staged && !this.#stage)) return;
    this.#stage?.show(this.#frameOf(picture));
    this.#answer(picture);
    this.#root.dataset.drawn = ++this.#drawn;
    this.#canvas.step = picture.step;
    this.#shown = picture;
    const now = performance.now();
    if (picture.fingerprint || picture.rest || now - this.#written > 1000 * WRITE_EVERY) {
      this.#written = now;
      this.#write(picture);
    }
    this.#describeRest();
  }

  #frameOf({ bytes, trail, places }) {
    return { ...unpacked(this.#world, bytes), trail: trail && trailOf(this.#world, trail, places) };
  }

  /** Leave a picture out, but for the trail that the next one goes on from. */
  #pass(picture) { if (picture.trail) this.#stage?.pass(this.#frameOf(picture)); }

  /** Have trails sent only while they are drawn. */
  #requestTrails() {
    const on = Boolean(this.#stage?.toggles.trails);
    if (on !== this.#traced) this.#send({ do: "trails", value: (this.#traced = on) });
  }

  /** Report which picture was drawn: while they come quickly only every third one, which is less work for the server. */
  #answer({ number, rest }) {
    const now = performance.now(), each = now - this.#before < 1000 * QUICK ? ANSWERED : 1;
    this.#before = now;
    this.#unanswered += 1;
    clearTimeout(this.#answering);
    const send = () => {
      [this.#unanswered, this.#each] = [0, each];
      this.#send({ do: "drawn", value: number, each });
    };
    if (rest || this.#unanswered >= this.#each) send();
    else this.#answering = setTimeout(send, 1000 * LATEST);
  }

  #write({ step, readings, rate, index, length, first, last, fingerprint }) {
    const root = this.#root, parts = this.#parts;
    if (this.#stage) this.#showRanges();
    root.dataset.step = step;
    root.dataset.fingerprint = fingerprint;
    const pace = rate ? [["Steps a second", rate]] : [], steps = ["Step", step.toLocaleString("en")];
    const compact = root.classList.contains("swarm-compact"), shown = compact ? [steps, ...readings, ...pace] : [steps, ...pace, ...readings];
    shown.forEach(([name, value], k) => {
      const row = parts.readings.children[k] ?? parts.readings.appendChild(make("div", {}, make("dt"), make("dd")));
      if (row.firstChild.textContent !== name) row.firstChild.textContent = name;
      if (row.lastChild.textContent !== value) row.lastChild.textContent = value;
    });
    while (parts.readings.children.length > shown.length) parts.readings.lastChild.remove();
    parts.past.max = Math.max(length - 1, 0);
    parts.past.value = index;
    parts.past.disabled = length < 2;
    parts.back.disabled = index <= 0;
    const text = index < length - 1 ? `step ${step} of ${last}, in memory from ${first} on` : `in memory: steps ${first} to ${last}`;
    parts.when.textContent = fingerprint ? `${text} · state ${fingerprint.slice(0, 8)}` : text;
    parts.when.title = fingerprint ? `Fingerprint of the state: ${fingerprint}` : "";
  }

  /** Show whether it is at rest: this may be known before the last picture arrives. */
  #describeRest() {
    const { playing, newest } = this.#state, { pushed, fingerprint } = this.#shown;
    this.#root.dataset.rest = Boolean(!playing && fingerprint && pushed >= newest);
  }

  #settle(state) {
    this.#state = { ...this.#state, ...state };
    const { playing, speed, speeds, finished, error, can_reset: canReset, caption, waits } = this.#state, parts = this.#parts;
    parts.caption.textContent = caption ?? "";
    parts.error.hidden = !error;
    if (parts.error.textContent !== error) parts.error.textContent = error;
    this.#root.dataset.playing = playing;
    this.#describeRest();
    relabel(parts.play, playing ? "pause" : "play", playing ? "Pause" : "Play");
    parts.play.disabled = Boolean(error) || finished;
    parts.step.disabled = Boolean(error);
    parts.reset.hidden = !canReset;
    relabel(parts.reset, "reset", waits ? "Apply" : "Reset");
    parts.reset.classList.toggle("swarm-apply", Boolean(waits));
    parts.speed.max = speeds.length - 1;
    if (document.activeElement !== parts.speed || !parts.speed.matches(":active")) parts.speed.value = speed;
    parts.requested.textContent = speeds[speed] ?? "";
    parts.speed.setAttribute("aria-valuetext", speeds[speed] ?? "");
  }

  #fillKey() {
    const { key, legend, fold } = this.#parts, entries = this.#stage?.legend() ?? [], folded = this.#folded;
    key.hidden = !entries.length;
    legend.hidden = folded;
    fold.setAttribute("aria-expanded", String(!folded));
    key.classList.toggle("swarm-folded", folded);
    fillLegend(legend, entries);
    this.#stage?.resize(); // the legend may cover more or less now
  }

  /** Show the ranges of fields; where they need another line, the map moves out of the way. */
  #showRanges() {
    const { key, legend } = this.#parts, before = key.offsetHeight;
    if (legend.hidden) return;
    fillLegend(legend, this.#stage.legend());
    if (key.offsetHeight !== before) this.#stage.resize();
  }

  #choose(id) {
    this.#model.set("selected", id);
    this.#model.save_changes();
    if (this.#stage.followed !== null && id !== null) this.#stage.follow(id);
  }

  #follow() {
    const { followed, selected, frame } = this.#stage;
    const one = followed !== null ? null : selected ?? frame?.ids[0] ?? null;
    if (one !== null && selected === null) {
      this.#stage.select(one);
      this.#choose(one);
    }
    this.#stage.follow(one);
    if (one !== null) this.#closeUp();
  }

  #closeUp() {
    const [x0, , x1] = this.#world.bounds, [left] = this.#stage.toCanvas(x0, 0), [right] = this.#stage.toCanvas(x1, 0);
    if (right - left < 1.5 * this.#canvas.clientWidth) this.#stage.zoom(3);
  }

  #fit() {
    this.#stage?.follow(null);
    this.#stage?.fit();
  }

  #followed(id) {
    this.#parts.follow.setAttribute("aria-pressed", id !== null);
    this.#viewed();
  }

  #toggle(name, on) {
    this.#parts.on[name] = this.#parts.switched[name] = on;
    this.#viewed();
    this.#stage?.set(name, on);
    this.#requestTrails();
    this.#fillKey();
  }

  #press(event) {
    const name = { " ": "toggle", ArrowRight: "step", ArrowLeft: "back", r: "reset" }[event.key];
    const target = event.target instanceof Element ? event.target : document.body;
    if (!name || event.ctrlKey || event.metaKey || event.altKey || isTaken(event.key, target, this.#pointed)) return;
    if (name === "reset" && !this.#state.can_reset) return;
    event.preventDefault();
    event.stopPropagation();
    this.#spaced = event.key === " ";
    this.#send({ do: name });
  }

  /** Browsers press a button when the space bar is released. */
  #release(event) {
    if (event.key === " " && this.#spaced) event.preventDefault();
    this.#spaced = false;
  }

  /** Pause what is not looked at, and go on when it is again. */
  #watch() {
    if (document.hidden && this.#state.playing) {
      this.#unseen = true;
      this.#send({ do: "pause" });
    } else if (!document.hidden && this.#unseen) {
      this.#unseen = false;
      this.#send({ do: "play" });
    }
  }
}

export default {
  render({ model, el }) {
    const view = new PlayerView(model, el);
    return () => view.destroy();
  },
};
