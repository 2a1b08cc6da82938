/* One robot in detail. Python sends its description (inspected); the user moves it, or selects another one. The robot's
   own frame is drawn with its heading up. */

const KINDS = ["obstacle", "robot", "fire", "load"];
const SVG = "http://www.w3.org/2000/svg";

function drawn(tag, attributes, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Ahead is up, left is left. */
const place = (x, y) => [-y, -x];
// Width of the diagram, as in style.css, and smallest legible text, px.
const WIDTH = 150, TEXT = 11;

function sector({ mount, bearing, half }, reach) {
  const points = [place(...mount)];
  for (let k = 0; k <= 12; k++) {
    const direction = bearing - half + (k / 12) * 2 * half;
    points.push(place(mount[0] + reach * Math.cos(direction), mount[1] + reach * Math.sin(direction)));
  }
  return points.map(([x, y]) => `${x.toFixed(2)},${y.toFixed(2)}`).join(" ");
}

function diagram(inspected) {
  const { sensors, radius } = inspected, few = sensors.length <= 12;
  const reach = Math.max(1.6 * radius, ...sensors.map((one) => Math.hypot(...one.mount) + one.range));
  const size = reach * 1.1, text = (TEXT * 2 * size) / WIDTH;
  const picture = drawn("svg", { viewBox: `${-size} ${-size} ${2 * size} ${2 * size}`, role: "img", "aria-label": `Sensors of robot ${inspected.id}, heading up` });
  const labels = [];
  for (const one of sensors) {
    const seen = one.kind >= 0, state = `${seen ? ` sees-${KINDS[one.kind] ?? "body"}` : ""}${one.triggered ? " triggered" : ""}`;
    const outline = drawn("polygon", { class: `range${one.triggered ? " triggered" : ""}`, points: sector(one, one.range) });
    outline.append(drawn("title", {}, one.words));
    picture.append(outline);
    if (seen) {
      const filled = drawn("polygon", { class: `reading${state}`, points: sector(one, one.distance) });
      filled.append(drawn("title", {}, one.words));
      picture.append(filled);
    }
    if (!seen || !(few || one.triggered)) continue;
    const far = Math.max(Math.hypot(...one.mount) + one.range * 0.8, radius + text);
    const [x, y] = place(far * Math.cos(one.bearing), far * Math.sin(one.bearing));
    labels.push(drawn("text", { class: one.triggered ? "triggered" : "", x, y, "font-size": text, dy: text * 0.36 }, one.distance.toFixed(1)));
  }
  picture.append(drawn("circle", { class: "body", r: radius }), drawn("path", { class: "front", d: `M${-radius},0A${radius},${radius} 0 0 1 ${radius},0Z` }));
  picture.append(drawn("line", { class: "ahead", x2: 0, y2: -radius }), ...labels);
  return picture;
}

class InspectorView extends View {
  #parts = {}; #fields = {};

  constructor(model, root) {
    super(model, root, "swarm-inspector");
    this.#build(root);
    const fault = () => showText(this.#parts.fault, model.get("fault"));
    this.follow({ inspected: () => this.#show(), editable: () => this.#edit(), fault });
  }

  #build(root) {
    const parts = this.#parts, act = (name) => () => this.send({ do: name });
    parts.title = make("h2", {}, "Robot");
    parts.none = make("button", { type: "button", title: "Close the inspector", "aria-label": "Deselect", click: () => this.send({ do: "select", value: null }) }, "\u2715");
    const steps = make("div", { class: "swarm-pick" },
      make("button", { type: "button", title: "Previous robot", "aria-label": "Previous robot", click: act("previous") }, "\u2039"),
      make("button", { type: "button", title: "Next robot", "aria-label": "Next robot", click: act("next") }, "\u203A"), parts.none);
    parts.hint = make("p", { class: "swarm-hint" }, "Click on a robot to see its readings and the reason for its action.");
    parts.when = make("p", { class: "swarm-hint" });
    parts.picture = make("div", { class: "swarm-diagram" });
    parts.why = make("p", { class: "swarm-why" });
    parts.facts = make("dl", {});
    parts.worth = make("table", {});
    parts.pose = make("form", { class: "swarm-pose" });
    for (const [name, label] of [["x", "x"], ["y", "y"], ["heading", "heading\u00b0"]]) {
      this.#fields[name] = make("input", { type: "text", inputmode: "decimal", autocomplete: "off", "aria-label": name === "heading" ? "heading, degrees" : name });
      parts.pose.append(make("label", {}, label, this.#fields[name]));
    }
    parts.move = make("button", { type: "submit" }, "Move");
    parts.pose.append(parts.move);
    parts.pose.addEventListener("submit", (event) => (event.preventDefault(), this.#move()));
    parts.pose.addEventListener("focusout", () => setTimeout(() => this.#show()));
    parts.fault = make("p", { class: "swarm-fault", role: "alert", hidden: true });
    parts.beside = make("div", { class: "swarm-known" }, parts.why);
    parts.all = make("div", {}, parts.when, make("div", { class: "swarm-closely" }, parts.picture, parts.beside), parts.facts, parts.worth, parts.pose);
    root.append(make("div", { class: "swarm-head" }, parts.title, steps), parts.hint, parts.all, parts.fault);
  }

  #show() {
    const inspected = this.model.get("inspected"), parts = this.#parts, some = inspected.id !== undefined;
    parts.hint.hidden = some;
    parts.all.hidden = parts.none.hidden = !some;
    parts.title.textContent = some ? `Robot ${inspected.id}` : "Robot";
    if (!some) return;
    parts.when.textContent = inspected.known ? (inspected.layer || inspected.does ? `Readings and action in ${inspected.when}` : `Readings ${inspected.when}`) : inspected.when;
    for (const name of ["picture", "beside", "facts", "worth", "pose"]) parts[name].hidden = !inspected.known;
    if (!inspected.known) return;
    parts.picture.replaceChildren(diagram(inspected));
    parts.why.replaceChildren(...(inspected.does ? [make("b", {}, inspected.layer || "No layer"), make("span", {}, ` ${inspected.does}${inspected.reason ? `: ${inspected.reason}` : ""}`)] : []));
    parts.facts.replaceChildren(...inspected.facts.flatMap(([name, value]) => [make("dt", {}, name), make("dd", {}, value)]));
    this.#worth(inspected.worth);
    parts.move.hidden = inspected.movable === false;
    if (!parts.pose.contains(document.activeElement)) for (const [name, field] of Object.entries(this.#fields)) field.value = inspected.pose[name] ?? "\u2013";
  }

  /** Show the values of actions as bars from the least to the greatest, the best one highlighted. */
  #worth(rows) {
    const table = this.#parts.worth, values = rows.map(([, value]) => value);
    table.hidden = !rows.length;
    const low = Math.min(0, ...values), high = Math.max(1e-9, ...values), best = Math.max(...values);
    const lines = rows.map(([name, value]) => {
      const bar = make("i", { style: `margin-left:${(100 * (Math.min(value, 0) - low)) / (high - low)}%;width:${(100 * Math.abs(value)) / (high - low)}%` });
      return make("tr", { class: value === best ? "swarm-best" : "" }, make("th", { scope: "row" }, name), make("td", {}, value.toFixed(3)), make("td", {}, bar));
    });
    table.replaceChildren(make("caption", {}, "Value of each action, Q"), ...lines);
  }

  #edit() {
    const editable = this.model.get("editable");
    for (const field of Object.values(this.#fields)) field.readOnly = !editable;
    this.#parts.move.disabled = !editable;
    this.#parts.move.title = editable ? "Move the robot there" : "Pause, and go to the present step first";
  }

  #move() {
    if (this.#parts.move.disabled) return;
    const value = Object.fromEntries(Object.entries(this.#fields).map(([name, field]) => [name, field.value.trim()]));
    this.send({ do: "move", value });
  }
}

export default shownBy(InspectorView);
