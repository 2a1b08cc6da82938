/* The arrangement of the page. Columns fold, the world may be alone on the screen, and type may be large for a
   projector. Style sheets read it from `aria-expanded` of the folds and from attributes of the page's root; the browser
   remembers folds and the projector. elements.js stands before this text. */

const FOLDED = "mesa_swarm.folded", PROJECTOR = "mesa_swarm.projector";
// Where columns stand below the world, as in layout.css.
const BELOW = matchMedia("(max-width: 800px), (max-height: 480px)");
const ROOT = document.documentElement;
const ENTER = "M3 3h5v2H5v3H3zM12 3h5v5h-2V5h-3zM3 12h2v3h3v2H3zM15 12h2v5h-5v-2h3z";
const LEAVE = "M6 3h2v5H3V6h3zM12 3h2v3h3v2h-5zM3 12h5v5H6v-3H3zM12 12h5v2h-3v3h-2z";

/** Return an icon without its lines. */
function icon() {
  const [picture, path] = ["svg", "path"].map((name) => document.createElementNS("http://www.w3.org/2000/svg", name));
  picture.setAttribute("viewBox", "0 0 20 20");
  picture.setAttribute("aria-hidden", "true");
  picture.append(path);
  return picture;
}

/** A button that folds one column. */
class FoldView {
  #model; #button; #leave = [];

  constructor(model, root) {
    const side = model.get("side");
    this.#model = model;
    root.classList.add("swarm-fold", `swarm-fold-${side}`);
    this.#button = make("button", { type: "button", click: () => this.#toggle() }, make("span", {}, model.get("label")));
    root.append(this.#button);
    const show = () => this.#show();
    BELOW.addEventListener("change", show);
    this.#leave.push(() => BELOW.removeEventListener("change", show));
    show();
  }

  destroy() {
    this.#leave.forEach((leave) => leave());
  }

  get #place() { return `${FOLDED}.${this.#model.get("side")}${BELOW.matches ? ".below" : ""}`; }

  get #folded() {
    return (localStorage.getItem(this.#place) ?? String(BELOW.matches && this.#model.get("folded_below"))) === "true";
  }

  #toggle() {
    localStorage.setItem(this.#place, String(!this.#folded));
    this.#show();
  }

  #show() {
    const folded = this.#folded, label = this.#model.get("label");
    this.#button.setAttribute("aria-expanded", String(!folded));
    this.#button.title = `${folded ? "Show" : "Hide"} ${label.toLowerCase()}`;
  }
}

/** The buttons of the whole screen. */
class ScreenView {
  #full; #projector; #leave = [];

  constructor(model, root) {
    root.classList.add("swarm-screen");
    this.#projector = make("button", { type: "button", class: "swarm-projector", title: "Large type and robots, few controls", click: () => this.#project(ROOT.dataset.projector !== "1") }, "Projector");
    this.#full = make("button", { type: "button", class: "swarm-full", click: () => this.#fill(ROOT.dataset.full !== "1") });
    this.#full.append(icon());
    root.append(this.#projector, this.#full);
    const change = () => document.fullscreenElement || this.#show(false);
    const press = ({ key }) => key === "Escape" && ROOT.dataset.full === "1" && this.#fill(false);
    document.addEventListener("fullscreenchange", change);
    document.addEventListener("keydown", press);
    this.#leave.push(() => document.removeEventListener("fullscreenchange", change), () => document.removeEventListener("keydown", press));
    this.#project(localStorage.getItem(PROJECTOR) === "true");
    this.#show(false);
  }

  destroy() {
    this.#leave.forEach((leave) => leave());
    this.#fill(false);
  }

  #project(on) {
    localStorage.setItem(PROJECTOR, String(on));
    if (on) ROOT.dataset.projector = "1";
    else delete ROOT.dataset.projector;
    this.#projector.setAttribute("aria-pressed", String(on));
  }

  /** Show the world alone; also where the browser grants no full screen, then within its window. */
  async #fill(full) {
    this.#show(full);
    try {
      if (full) await ROOT.requestFullscreen();
      else if (document.fullscreenElement) await document.exitFullscreen();
    } catch {
      // A telephone that has no full screen.
    }
  }

  #show(full) {
    const label = full ? "Leave full screen" : "Full screen";
    if (full) ROOT.dataset.full = "1";
    else delete ROOT.dataset.full;
    this.#full.setAttribute("aria-label", label);
    this.#full.title = full ? `${label} (Escape)` : "Full screen: the world and its controls only";
    this.#full.querySelector("path").setAttribute("d", full ? LEAVE : ENTER);
  }
}

const VIEWS = { fold: FoldView, screen: ScreenView };

export default {
  render({ model, el }) {
    const view = new VIEWS[model.get("part")](model, el);
    return () => view.destroy();
  },
};
