/* Export from the page. Python sends the kinds of files (kinds) and the state (status); the user requests a file, which
   arrives in pieces (view.js), or switches recording on. A picture of the screen is made in the browser. */

const SCREEN = ["screen", "Picture as on screen (PNG)", false];

class ExportForm extends View {
  #parts = {}; #requested = false;

  constructor(model, root) {
    super(model, root, "swarm-export");
    this.#build(root);
    this.receive();
    this.follow({ kinds: () => this.#list(), status: () => this.#show() });
  }

  #build(root) {
    const parts = this.#parts, send = (message) => this.send(message);
    parts.record = make("button", { type: "button", "aria-pressed": "false", click: () => send({ do: "record", value: parts.record.getAttribute("aria-pressed") !== "true" }) }, make("i"), make("span", {}, "Record"));
    parts.recorded = make("p", { class: "swarm-hint" });
    parts.kind = make("select", { "aria-label": "Kind of file", change: () => this.#show() });
    parts.source = make("select", { "aria-label": "Source of steps" });
    parts.every = make("select", { "aria-label": "Steps in the table" }, ...[1, 10, 100].map((every) => make("option", { value: every }, every === 1 ? "every step" : `every ${every} steps`)));
    parts.sectors = make("input", { type: "checkbox" });
    parts.trails = make("input", { type: "checkbox" });
    parts.sectorsLabel = make("label", {}, parts.sectors, "sensors");
    parts.trailsLabel = make("label", {}, parts.trails, "trails");
    parts.start = make("button", { type: "button", class: "swarm-make", click: () => this.#start() }, "Export");
    parts.cancel = make("button", { type: "button", click: () => send({ do: "cancel" }) }, "Cancel");
    parts.bar = make("progress", { max: 1, "aria-label": "Progress" });
    parts.doing = make("span");
    parts.busy = make("div", { class: "swarm-busy", hidden: true }, parts.doing, parts.bar, parts.cancel);
    parts.message = make("p", { class: "swarm-hint", role: "status" });
    parts.fault = make("p", { class: "swarm-fault", role: "alert" });
    root.setAttribute("role", "region");
    root.setAttribute("aria-label", "Export");
    root.append(make("div", { class: "swarm-head" }, make("h2", {}, "Export"), parts.record), parts.recorded,
      make("div", { class: "swarm-options" }, parts.kind, parts.source, parts.every, parts.sectorsLabel, parts.trailsLabel, parts.start),
      parts.busy, parts.message, parts.fault);
  }

  get #kinds() {
    const [first, ...others] = this.model.get("kinds");
    return [first, SCREEN, ...others];
  }

  #list() {
    const chosen = this.#parts.kind.value;
    this.#parts.kind.replaceChildren(...this.#kinds.map(([key, label]) => make("option", { value: key }, label)));
    if ([...this.#parts.kind.options].some((option) => option.value === chosen)) this.#parts.kind.value = chosen;
    this.#show();
  }

  #show() {
    const status = this.model.get("status"), parts = this.#parts;
    if (status.doing === undefined) return;
    const [kind, , whole] = this.#kinds.find(([key]) => key === parts.kind.value) ?? ["", "", false];
    parts.record.setAttribute("aria-pressed", status.recording);
    parts.record.lastChild.textContent = status.recording ? "Stop recording" : "Record";
    parts.record.title = status.recording ? "Stop recording; the recorded steps stay" : "Record from the next step on; replaces the recording before";
    showText(parts.recorded, status.ended || (status.recorded && `Recorded: ${status.recorded}`));
    this.#sources(status, whole);
    parts.every.hidden = !kind.includes(".");
    parts.sectorsLabel.hidden = !["png", "svg", "gif", "mp4"].includes(kind);
    parts.trailsLabel.hidden = !["gif", "mp4"].includes(kind);
    const busy = Boolean(status.doing);
    parts.busy.hidden = !busy;
    parts.start.disabled = kind !== SCREEN[0] && (busy || (whole && !parts.source.value));
    parts.doing.textContent = status.doing;
    if (status.progress === null) parts.bar.removeAttribute("value");
    else parts.bar.value = status.progress;
    showText(parts.message, status.message);
    showText(parts.fault, status.fault);
    if (this.#requested && !busy && (status.fault || status.message)) {
      this.#requested = false;
      parts[status.fault ? "fault" : "message"].scrollIntoView({ block: "nearest" });
    }
  }

  #sources(status, whole) {
    const list = this.#parts.source, chosen = list.value, options = [];
    if (status.steps) options.push(["run", `the run so far: steps 1 to ${status.steps.toLocaleString("en")}`]);
    if (status.recorded) options.push(["recording", `recorded: ${status.recorded}`]);
    if (!options.length) options.push(["", status.straight ? "no steps yet" : "changed while running: record it"]);
    const text = JSON.stringify(options);
    if (list.dataset.options !== text && document.activeElement !== list) {
      list.dataset.options = text;
      list.replaceChildren(...options.map(([value, label]) => make("option", { value }, label)));
      if (options.some(([value]) => value === chosen)) list.value = chosen;
    }
    list.hidden = !whole;
  }

  #start() {
    const { kind, source, every, sectors, trails } = this.#parts;
    if (kind.value === SCREEN[0]) return this.#saveScreen();
    const value = { kind: kind.value, source: source.value || "run", every: Number(every.value), sectors: sectors.checked, trails: trails.checked };
    this.#requested = true;
    return this.send({ do: "export", value });
  }

  /** Save the canvas as it is: zoomed, with what is shown, in the pixels of the screen. */
  #saveScreen() {
    const canvas = this.root.closest(".swarm-watch").querySelector(".swarm-stage canvas");
    const name = `${this.model.get("status").name}_${canvas.step}_screen.png`;
    canvas.toBlob((picture) => picture && save(name, picture), "image/png");
  }
}

export default shownBy(ExportForm);
