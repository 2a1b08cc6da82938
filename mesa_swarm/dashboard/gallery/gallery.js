// Cards of models. A card's picture moves while it is pointed at or has the focus by keyboard, unless the system asks
// for less motion; the moving picture is loaded then, begins as the one at rest, and pauses when it is left.

// Time on a card before its moving picture is loaded, ms: not all that the pointer passes are.
const PATIENCE = 120;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const loaded = new Map();

function moving(address) {
  if (!loaded.has(address)) {
    const answer = fetch(new URL(address, document.baseURI)).then((one) => (one.ok ? one.text() : ""));
    loaded.set(address, answer.catch(() => (loaded.delete(address), "")));
  }
  return loaded.get(address);
}

function svg(text) {
  return document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
}

function animated(card, picture, address) {
  let pointed = false, focused = false, moves = false, timer = 0;
  const play = async () => {
    if (!moves) {
      const text = await moving(address);
      if (!text || moves || !wanted() || !picture.isConnected) return;
      picture.replaceChildren(svg(text));
      moves = true;
    }
    picture.firstElementChild.unpauseAnimations();
    picture.dataset.moves = "true";
  };
  const wanted = () => (pointed || focused) && !calm.matches;
  const change = () => {
    clearTimeout(timer);
    if (wanted()) {
      timer = setTimeout(play, PATIENCE);
    } else if (moves) {
      picture.firstElementChild.pauseAnimations();
      picture.dataset.moves = "false";
    }
  };
  card.addEventListener("pointerenter", () => ((pointed = true), change()));
  card.addEventListener("pointerleave", () => ((pointed = false), change()));
  card.addEventListener("focus", () => ((focused = card.matches(":focus-visible")), change()));
  card.addEventListener("blur", () => ((focused = false), change()));
  calm.addEventListener("change", change);
  return () => (clearTimeout(timer), calm.removeEventListener("change", change));
}

export default {
  render({ model, el }) {
    const list = make("div", { class: "swarm-cards" }), pictures = new Map(), endings = [];
    for (const { name, title, about, still, moving } of model.get("cards")) {
      const choose = () => (model.set("choice", name), model.save_changes()), current = name === model.get("chosen");
      const shown = still ? svg(still) : make("b", {}, title.slice(0, 1));
      const picture = make("div", { class: "swarm-picture", "aria-hidden": "true" }, shown);
      const words = make("div", { class: "swarm-about" }, make("strong", {}, title), make("span", {}, about));
      if (current) words.append(make("em", {}, "current model"));
      const look = { type: "button", class: "swarm-card", "data-name": name, "aria-current": current && "true" };
      const card = make("button", { ...look, click: choose }, picture, words);
      if (moving) endings.push(animated(card, picture, moving));
      pictures.set(name, picture);
      list.append(card);
    }
    const complete = () => {
      for (const [name, text] of Object.entries(model.get("drawn"))) {
        const picture = pictures.get(name);
        if (text && picture && !picture.querySelector("svg")) picture.replaceChildren(svg(text));
      }
    };
    complete();
    model.on("change:drawn", complete);
    el.replaceChildren(list);
    return () => (endings.forEach((end) => end()), model.off("change:drawn", complete));
  },
};
