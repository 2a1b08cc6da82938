/* The controls beside the canvas. Python sends the controls (groups), their values (values) and remarks
   (notes); changes by the user are sent back, and shown when Python has accepted them. */

// A slider that is dragged sends its place again after this, also where Python has not answered, ms.
const LONGEST_ANSWER = 120;
// How many fields were built, so that each has names of its own on the page.
let built = 0;

class PanelView extends View {
  #fields = new Map(); #notes = null; #places = new Map(); #answer = 0;

  constructor(model, root) {
    super(model, root, "swarm-panel");
    this.follow({ groups: () => this.#build(), values: () => (this.#fill(), this.#sendPlaces()), notes: () => this.#showNotes() });
    this.atEnd(() => clearTimeout(this.#answer));
  }

  /** Send where a slider is: the first place at once, then the latest when Python has answered. */
  #sendPlace(name, value) {
    this.#places.set(name, value);
    if (!this.#answer) this.#sendPlaces();
  }

  #sendPlaces() {
    clearTimeout(this.#answer);
    this.#answer = 0;
    if (!this.#places.size) return;
    for (const [name, value] of this.#places) this.send({ do: "place", name, value });
    this.#places.clear();
    this.#answer = setTimeout(() => this.#sendPlaces(), LONGEST_ANSWER); // nothing changes where a value is the same
  }

  #build() {
    const open = new Set([...this.root.querySelectorAll("details[open]")].map((one) => one.dataset.title));
    const fresh = !this.root.childElementCount;
    this.#fields = new Map();
    this.#notes = null;
    const groups = this.model.get("groups").map((group, k) => {
      const shown = fresh ? k < 3 : open.has(group.title);
      const details = make("details", { open: shown, "data-title": group.title, "aria-label": group.title }, make("summary", {}, group.title));
      details.append(...group.fields.map((field) => this.#field(field)));
      if (group.notes) details.append((this.#notes = make("ul", { class: "swarm-notes", "aria-live": "polite" })));
      return details;
    });
    const defaults = make("button", { type: "button", click: () => this.send({ do: "defaults" }) }, "All defaults");
    const end = make("div", { class: "swarm-end" }, defaults);
    this.root.replaceChildren(...(this.model.get("bare") ? groups : [this.#run(), ...groups, end]));
    this.#fill();
    this.#showNotes();
  }

  #run() {
    const seed = this.#text("seed", "seed");
    const random = make("button", { type: "button", click: () => this.send({ do: "random" }) }, "Random");
    random.title = "Choose a random seed, and reset";
    const row = make("div", { class: "swarm-row" }, seed, random);
    const field = this.#frame({ name: "seed", label: "seed", help: "the same seed gives the same run" }, row, seed);
    return make("div", { class: "swarm-run", role: "group", "aria-label": "Run" }, field);
  }

  #field(field) {
    if (field.kind === "choice") return this.#choice(field);
    if (field.kind === "text") return this.#typed(field);
    if (field.kind === "ticks") return this.#ticks(field);
    if (field.kind === "span") return this.#span(field);
    const id = `swarm-${field.name}-${built}`;
    const send = () => this.#sendPlace(field.name, Number(slider.value));
    const slider = make("input", { type: "range", min: field.low, max: field.high, step: 1, "aria-label": field.label, id, input: send });
    const text = field.designed ? make("output", { class: "swarm-value", for: id }) : this.#text(field.name, field.label);
    return this.#frame(field, make("div", { class: "swarm-row" }, slider, text), text, slider);
  }

  #text(name, label) {
    const done = () => delete text.dataset.typing;
    const send = () => { done(); this.send({ do: "text", name, value: text.value }); };
    const typing = () => { text.dataset.typing = "yes"; };
    const text = make("input", { class: "swarm-value", type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${label}, typed`, change: send, input: typing, blur: done });
    return text;
  }

  #typed(field) {
    const text = this.#text(field.name, field.label);
    return this.#frame(field, make("div", { class: "swarm-row" }, text), text);
  }

  /** Boxes to tick, of which several may be; Python sends the ticked ones. */
  #ticks(field) {
    const boxes = field.options.map((name) => make("input", { type: "checkbox", value: name, change: () => send() }));
    const send = () => this.send({ do: "tick", name: field.name, value: boxes.filter((box) => box.checked).map((box) => box.value) });
    const labels = boxes.map((box) => make("label", {}, box, box.value));
    const list = make("div", { class: "swarm-ticks", role: "group", "aria-label": field.label }, ...labels);
    const text = make("output", { hidden: true }), frame = this.#frame(field, list, text);
    // An answer to an earlier tick may come after a later one: boxes in use stay as the user left them.
    this.#fields.get(field.name).more = ({ ticked }) => {
      if (!list.contains(document.activeElement)) boxes.forEach((box) => { box.checked = ticked.includes(box.value); });
    };
    return frame;
  }

  /** A list of numbers: typed, or a number of them from one end to another. */
  #span(field) {
    const send = () => this.send({ do: "span", name: field.name, value: parts.map((part) => part.value) });
    const part = (label) => make("input", { class: "swarm-value", type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": `${field.label}, ${label}`, change: send });
    const parts = [part("from"), part("to"), part("number")];
    const words = ["from", "to", "number"].map((word, k) => make("label", {}, word, parts[k]));
    const row = make("div", { class: "swarm-row" }, ...words), list = this.#text(field.name, field.label);
    const frame = this.#frame(field, make("div", { class: "swarm-span" }, row, list), list);
    // As with boxes: while one of the three is in use, an answer to an earlier one replaces none of them.
    this.#fields.get(field.name).more = ({ span }) => {
      if (!row.contains(document.activeElement)) parts.forEach((one, k) => { one.value = span[k]; });
    };
    return frame;
  }

  #choice(field) {
    const send = () => this.send({ do: "choose", name: field.name, value: list.value });
    const options = field.options.map((name) => make("option", { value: name }, name));
    const list = make("select", { "aria-label": field.label, change: send }, ...options);
    const row = make("div", { class: "swarm-row" }, list);
    if (field.upload) row.append(...this.#upload());
    return this.#frame(field, row, list);
  }

  #upload() {
    const file = make("input", { type: "file", accept: ".svg,.toml", hidden: true, "aria-label": "Map file", change: () => this.#sendFile(file) });
    const button = make("button", { type: "button", click: () => file.click() }, "Upload");
    button.title = "A map as SVG or TOML";
    return [file, button];
  }

  async #sendFile(file) {
    const [one] = file.files;
    file.value = "";
    if (!one) return;
    const largest = this.model.get("largest_map");
    if (one.size > largest) {
      const sizes = [one.size, largest].map((size) => size.toLocaleString("en"));
      this.#fault(this.#fields.get("map"), `${one.name} has ${sizes[0]} bytes; expected at most ${sizes[1]}`);
      return;
    }
    this.send({ do: "upload", name: one.name }, [await one.arrayBuffer()]);
  }

  #frame({ name, label, help, live }, row, text, slider) {
    const place = `swarm-field-${built++}`, mark = make("em", { class: "swarm-mark" });
    const fault = make("p", { class: "swarm-fault", role: "alert", hidden: true, id: `${place}-fault` });
    const note = make("small", { id: `${place}-help`, hidden: !help || help === label }, help ?? "");
    const own = [slider, text].filter((one) => one?.matches("input, select")), controls = own.length ? own : [...row.querySelectorAll("input")];
    if (own.length) own[0].id ||= place;
    if (!note.hidden) for (const one of controls) one.setAttribute("aria-describedby", note.id);
    const head = make("div", { class: "swarm-label" }, own.length ? make("label", { for: own[0].id }, label) : make("span", {}, label), mark);
    const frame = make("div", { class: "swarm-field", "data-name": name }, head, row, note, fault);
    this.#fields.set(name, { frame, text, slider, mark, fault, live, note, controls });
    return frame;
  }

  #fill() {
    const values = this.model.get("values");
    for (const [name, field] of this.#fields) {
      const { text, place, waits, fault } = values[name] ?? { text: "", waits: false, fault: "" };
      if (field.slider && !field.slider.matches(":active")) field.slider.value = place;
      field.slider?.setAttribute("aria-valuetext", text);
      if (values[name]) field.more?.(values[name]);
      if (field.text.tagName === "OUTPUT") field.text.textContent = text;
      else if (!this.#isTypedIn(field.text, fault)) field.text.value = text;
      const reset = field.live === undefined ? "waits for Apply" : "waits for reset";
      field.mark.textContent = waits ? reset : field.live === false ? "on reset" : "";
      field.mark.classList.toggle("swarm-waits", Boolean(waits));
      this.#fault(field, fault);
    }
  }

  /** Whether the user is typing in this field, or has typed a refused value there: it is then not replaced. */
  #isTypedIn(text, fault) {
    return document.activeElement === text && (fault !== "" || text.dataset.typing === "yes");
  }

  /** Show what is wrong with a field, and describe its controls by it. */
  #fault({ fault, frame, note, controls }, text) {
    showText(fault, text);
    frame.classList.toggle("swarm-wrong", Boolean(text));
    const described = [text && fault.id, !note.hidden && note.id].filter(Boolean).join(" ");
    for (const one of controls) {
      if (described) one.setAttribute("aria-describedby", described);
      if (text) one.setAttribute("aria-invalid", "true"), one.setAttribute("aria-errormessage", fault.id);
      else one.removeAttribute("aria-invalid"), one.removeAttribute("aria-errormessage");
      if (!described) one.removeAttribute("aria-describedby");
    }
  }

  #showNotes() {
    this.#notes?.replaceChildren(...this.model.get("notes").map(([kind, text]) => make("li", { class: `swarm-${kind}` }, text)));
  }
}

export default shownBy(PanelView);
