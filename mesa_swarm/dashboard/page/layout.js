/* The arrangement of the page. Columns fold, the world may be alone on the screen, and type may be large for a
   projector. Style sheets read it from `aria-expanded` of the folds and from attributes of the page's root; the browser
   remembers folds and the projector. elements.js and view.js stand before this text. */

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
class FoldView extends View {
  #button;

  constructor(model, root) {
    super(model, root, "swarm-fold");
    root.classList.add(`swarm-fold-${model.get("side")}`);
    this.#button = make("button", { type: "button", click: () => this.#toggle() }, make("span", {}, model.get("label")));
    root.append(this.#button);
    this.listen(BELOW, "change", () => this.#show());
    this.#show();
  }

  get #place() { return `${FOLDED}.${this.model.get("side")}${BELOW.matches ? ".below" : ""}`; }

  get #folded() {
    return (localStorage.getItem(this.#place) ?? String(BELOW.matches && this.model.get("folded_below"))) === "true";
  }

  #toggle() {
    localStorage.setItem(this.#place, String(!this.#folded));
    this.#show();
  }

  #show() {
    const folded = this.#folded, label = this.model.get("label");
    this.#button.setAttribute("aria-expanded", String(!folded));
    this.#button.title = `${folded ? "Show" : "Hide"} ${label.toLowerCase()}`;
  }
}

/** The buttons of the whole screen. */
class ScreenView extends View {
  #full; #projector;

  constructor(model, root) {
    super(model, root, "swarm-screen");
    this.#projector = make("button", { type: "button", class: "swarm-projector", title: "Large type and robots, few controls", click: () => this.#project(ROOT.dataset.projector !== "1") }, "Projector");
    this.#full = make("button", { type: "button", class: "swarm-full", click: () => this.#fill(ROOT.dataset.full !== "1") });
    this.#full.append(icon());
    root.append(this.#projector, this.#full);
    this.listen(document, "fullscreenchange", () => document.fullscreenElement || this.#show(false));
    this.listen(document, "keydown", ({ key }) => key === "Escape" && ROOT.dataset.full === "1" && this.#fill(false));
    this.atEnd(() => this.#fill(false));
    this.#project(localStorage.getItem(PROJECTOR) === "true");
    this.#show(false);
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

export default {
  render: ({ model, el }) => shownBy({ fold: FoldView, screen: ScreenView }[model.get("part")]).render({ model, el }),
};
