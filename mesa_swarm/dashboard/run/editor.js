/* Tools that change the world, on the left of the canvas. Python applies what a tool sends, { do: "use", tool, values }, or
   shows why not (status.fault); what is dragged follows the pointer by "grab", "drag" and "drop". Each tool has fields as
   well, so that all can be done without a mouse. */

const TOOL_ICONS = {
  edit: "M3 14.5V17h2.5L14 8.500 11.500 6zM15 7.500l1.600-1.600a.8.8 0 0 0 0-1.100l-1.400-1.400a.8.8 0 0 0-1.100 0L12.500 5z",
  move: "M10 1l3 3h-2v5h5V7l3 3-3 3v-2h-5v5h2l-3 3-3-3h2v-5H4v2l-3-3 3-3v2h5V4H7z",
  robot: "M8 4a6 6 0 1 0 0 12A6 6 0 0 0 8 4zm0 2a4 4 0 0 1 0 8zM15 2h2v2h2v2h-2v2h-2V6h-2V4h2z",
  wall: "M2 15.500L15.500 2 18 4.500 4.500 18z",
  obstacle: "M10 3a7 7 0 1 0 0 14 7 7 0 0 0 0-14z",
  load: "M3 3h14v14H3zM5 5v10h10V5z",
  fire: "M10.500 1c.5 3-3 4.500-3 7.500 0 1 .5 1.800 1 2.200C8 8.500 10 8 10.500 6c3 2 4.500 4.200 4.500 7a5 5 0 0 1-10 0C5 8 9.500 6.500 10.500 1z",
  undo: "M8 4v3h4a5 5 0 0 1 0 10H7v-2h5a3 3 0 0 0 0-6H8v3L3 8z",
  erase: "M12 3l5 5-8.500 8.500H5l-2.500-2.500zM5.800 15h1.900l2-2-2.900-2.900-2.600 2.900z",
};
const NUMBERS = { x: "x", y: "y", toX: "to x", toY: "to y", width: "width", radius: "radius", heading: "heading, degrees" };
const TOOLS = {
  move: { label: "Move robots and bodies: drag", fields: ["x", "y", "toX", "toY"] },
  robot: { label: "Add a robot: click, drag to set its heading", fields: ["x", "y", "heading"] },
  wall: { label: "Add a wall: drag from end to end", fields: ["x", "y", "toX", "toY", "width"] },
  obstacle: { label: "Add a disc: click, or drag its radius", fields: ["x", "y", "radius"] },
  load: { label: "Add a body that robots push: click, or drag its radius", fields: ["x", "y", "radius"] },
  fire: { label: "Add a fire; click on one to put it out or light it", fields: ["x", "y", "radius"] },
  erase: { label: "Remove what is clicked", fields: ["x", "y"] },
};
// Of the map's width: a wall, and a disc that is only clicked; and how far from a small robot a click may be, px.
const WALL = 0.015, DISC = 0.03, NEAR = 9;
// Shortest time between places that are sent while something is dragged, ms.
const DRAG_EVERY = 30;

const SHAPES = "http://www.w3.org/2000/svg";

function toolIcon(name) {
  const picture = document.createElementNS(SHAPES, "svg"), path = document.createElementNS(SHAPES, "path");
  picture.setAttribute("viewBox", "0 0 20 20");
  picture.setAttribute("aria-hidden", "true");
  path.setAttribute("fill-rule", "evenodd");
  path.setAttribute("d", TOOL_ICONS[name]);
  picture.append(path);
  return picture;
}

function toolButton(icon, label, act) {
  return make("button", { type: "button", title: label, "aria-label": label, click: act }, toolIcon(icon));
}

class EditorView extends View {
  #parts = {}; #tool = null; #from = null; #to = null; #sent = 0; #canvas = null; #search = 0;

  constructor(model, root) {
    super(model, root);
    this.#build();
    this.receive();
    this.follow({ status: () => this.#show() });
    this.listen(document, "keydown", (event) => this.#hearKey(event));
    this.#search = requestAnimationFrame(() => this.#find());
    this.atEnd(() => this.#remove());
  }

  #remove() {
    cancelAnimationFrame(this.#search);
    this.#parts.box.remove();
    if (this.#canvas?.stage) this.#canvas.stage.tool = null;
  }

  #hearKey(event) {
    if (event.key === "Escape" && this.#tool) this.#choose(null);
    const typing = event.target instanceof Element && event.target.closest("input[type=text], textarea, select");
    if (event.key !== "z" || !(event.ctrlKey || event.metaKey) || typing || this.#parts.undo.disabled) return;
    event.preventDefault();
    this.send({ do: "undo" });
  }

  /** Find the canvas beside it, which may come later, and put the tools upon it. */
  #find() {
    this.#canvas = this.root.closest(".swarm-watch")?.querySelector(".swarm-stage canvas") ?? null;
    if (!this.#canvas) {
      this.#search = requestAnimationFrame(() => this.#find());
      return;
    }
    this.#canvas.parentElement.append(this.#parts.box);
    this.listen(this.#canvas, "swarm-stage", () => this.#use());
    this.#use();
  }

  #build() {
    const parts = this.#parts;
    parts.buttons = Object.entries(TOOLS).map(([name, { label }]) => {
      const button = toolButton(name, label, () => this.#choose(this.#tool === name ? null : name));
      button.dataset.tool = name;
      return button;
    });
    parts.form = make("form", { class: "swarm-place", submit: (event) => (event.preventDefault(), this.#place()) });
    parts.undo = toolButton("undo", "Nothing to undo", () => this.send({ do: "undo" }));
    const action = (label, message, about = label) => make("button", { type: "button", title: about, click: () => this.send(message) }, label);
    parts.apply = action("Use as map", { do: "apply" }, "Reset, and run the model on the map as it is now");
    parts.hint = make("p", { class: "swarm-hint" });
    parts.fault = make("p", { class: "swarm-fault", role: "alert", hidden: true });
    parts.edits = make("ol", { class: "swarm-edits", "aria-label": "Changes by hand", tabindex: "0" });
    const more = make("details", { class: "swarm-edit-more" }, make("summary", { title: "Map and changes by hand", "aria-label": "Map and changes by hand" }, "\u22ef"),
      make("div", {}, action("Remove all obstacles", { do: "clear" }), action("Save map as TOML", { do: "save", value: "toml" }),
        action("Save map as SVG", { do: "save", value: "svg" }), parts.apply, parts.edits));
    const tools = make("div", { class: "swarm-toolbox", role: "toolbar", "aria-label": "Tools" }, ...parts.buttons, parts.undo, more);
    parts.about = make("div", { class: "swarm-about-tool" }, parts.hint, make("details", {}, make("summary", {}, "by numbers"), parts.form));
    parts.box = make("details", { class: "swarm-edit", toggle: () => parts.box.open || this.#choose(null) }, make("summary", { title: "Edit the world" }, toolIcon("edit"), make("span", {}, "Edit")), tools, parts.about, parts.fault);
    this.#choose(null);
  }

  #show() {
    const { undo = "", fault = "", edits = [], takes_map: takesMap = false } = this.model.get("status"), parts = this.#parts;
    parts.edits.replaceChildren(...edits.map((text) => make("li", {}, text)));
    parts.edits.hidden = !edits.length;
    parts.undo.disabled = !undo;
    parts.undo.title = undo || "Nothing to undo";
    parts.undo.setAttribute("aria-label", parts.undo.title);
    showText(parts.fault, fault);
    parts.apply.hidden = !takesMap;
  }

  #choose(name) {
    const parts = this.#parts;
    this.#tool = name;
    this.#from = this.#to = null;
    parts.buttons.forEach((button) => button.setAttribute("aria-pressed", button.dataset.tool === name));
    parts.hint.textContent = name ? `${TOOLS[name].label}. Esc ends.` : "";
    parts.about.hidden = !name;
    if (name) this.#fillForm(TOOLS[name].fields);
    this.#use();
  }

  #fillForm(fields) {
    const inputs = fields.map((field) => make("label", {}, NUMBERS[field], make("input", { type: "text", inputmode: "decimal", name: field, autocomplete: "off", required: true })));
    this.#parts.form.replaceChildren(...inputs, make("button", { type: "submit" }, this.#tool === "erase" ? "Remove" : this.#tool === "move" ? "Move" : "Add"));
  }

  /** Show in the fields what the mouse did. */
  #fill(values) {
    for (const input of this.#parts.form.querySelectorAll("input")) {
      const value = values[input.name];
      if (value !== undefined && document.activeElement !== input) input.value = String(Number(value.toPrecision(6)));
    }
  }

  #place() {
    const values = [...this.#parts.form.querySelectorAll("input")].map((input) => Number(input.value.replace(",", ".")));
    if (this.#tool === "robot") values[2] *= Math.PI / 180;
    this.send({ do: "use", tool: this.#tool, values, like: this.#canvas?.stage?.selected ?? null });
  }

  get #size() {
    const [x0, , x1] = this.#canvas.stage.world.bounds;
    return x1 - x0;
  }

  /** Give the stage what it calls when the pointer does something. */
  #use() {
    const stage = this.#canvas?.stage;
    if (!stage) return;
    stage.tool = this.#tool && {
      cursor: this.#tool === "move" ? "grab" : "crosshair",
      press: (at) => this.#press(at),
      move: (at) => this.#drag(at),
      release: (at) => this.#release(at),
      cancel: () => { this.#from = this.#to = null; },
      draw: (context, pixel) => this.#draw(context, pixel),
    };
  }

  get #near() { return NEAR / this.#canvas.stage.view.scale; }

  #press({ x, y }) {
    this.#from = this.#to = { x, y };
    if (this.#tool === "move") this.send({ do: "grab", values: [x, y], near: this.#near });
    return true;
  }

  #drag({ x, y }) {
    this.#to = { x, y };
    const now = performance.now();
    if (this.#tool !== "move" || now - this.#sent < DRAG_EVERY) return;
    this.#sent = now;
    this.send({ do: "drag", values: [x, y] });
  }

  #release({ x, y }) {
    const from = this.#from ?? { x, y };
    this.#from = this.#to = null;
    if (this.#tool === "move") {
      this.#fill({ x: from.x, y: from.y, toX: x, toY: y });
      this.send({ do: "drop", values: [x, y] });
      return;
    }
    const values = this.#values(from, { x, y });
    this.#fill({ ...values, heading: (values.heading * 180) / Math.PI });
    this.send({ do: "use", tool: this.#tool, values: TOOLS[this.#tool].fields.map((name) => values[name]), near: this.#near, like: this.#canvas.stage.selected });
  }

  /** Return the numbers of the tool after a drag between two places. */
  #values(from, to) {
    const [dx, dy] = [to.x - from.x, to.y - from.y], far = Math.hypot(dx, dy), small = 3 / this.#canvas.stage.view.scale;
    const radius = far > small ? far : DISC * this.#size;
    return { x: from.x, y: from.y, toX: to.x, toY: to.y, width: WALL * this.#size, radius, heading: far > small ? Math.atan2(dy, dx) : 0 };
  }

  /** Draw what would be added. */
  #draw(context, pixel) {
    if (!this.#from || this.#tool === "erase" || this.#tool === "move") return;
    const { x, y, toX, toY, width, radius } = this.#values(this.#from, this.#to), line = this.#tool === "wall" || this.#tool === "robot";
    context.strokeStyle = PALETTE[themeAround(this.#canvas)].selection;
    context.lineWidth = this.#tool === "wall" ? width : 2 * pixel;
    context.globalAlpha = this.#tool === "wall" ? 0.6 : 1;
    context.beginPath();
    if (line) {
      context.moveTo(x, y);
      context.lineTo(toX, toY);
    } else context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
    context.globalAlpha = 1;
  }
}

export default shownBy(EditorView);
