/* The end of the page's header: theme, link, keys, tour. It also writes the address bar (shown), sends Python the
   addresses of Back and Forward, and what a reload goes on with, and states when the server is gone. */

const THEME = "mesa_swarm.theme", TOURED = "mesa_swarm.toured", LEFT = "mesa_swarm.left";
const WORDS = { auto: "as the system", light: "light", dark: "dark" };
const NEXT = { auto: "dark", dark: "light", light: "auto" };
const SIGNS = { auto: "\u25D0", light: "\u2600", dark: "\u263E" };
// How often the connection is looked at, and how long a text stays on a button, ms.
const LOOK_EVERY = 500, SHOWN_FOR = 1500;
// How long the page may take to the place of Back or Forward before its address is written as it is, ms.
const LONGEST_WAY = 5000;
const GONE = "The dashboard's server does not answer: its program has ended or was restarted. Start it again, and reload this page.";

/** The query without the step, which is not in it while a run is played. */
function withoutStep(search) {
  const words = new URLSearchParams(search);
  words.delete("step");
  return words.toString();
}

function plainButton(label, act, more = {}) {
  return make("button", { type: "button", click: act, ...more }, label);
}

class PageBarView extends View {
  #place = null; #parts = {}; #dialog = null; #tour = null; #timer = 0; #waiting = 0; #awaited = null; #patience = 0; #tabs = null;

  constructor(model, root) {
    super(model, root, "swarm-page-bar");
    const parts = this.#parts;
    parts.link = plainButton("Link", () => this.#copy(), { title: "Copy a link to what is shown" });
    parts.keys = plainButton("Keys", () => this.#toggleKeys(), { title: "List of keys (?)" });
    parts.tour = plainButton("Tour", () => this.#startTour(), { title: "A tour of the page, one minute" });
    parts.theme = plainButton("", () => (localStorage.setItem(THEME, NEXT[this.#choice]), this.#applyTheme()), { class: "swarm-theme" });
    root.append(parts.tour, parts.keys, parts.link, parts.theme);
    this.listen(matchMedia("(prefers-color-scheme: dark)"), "change", () => this.#applyTheme());
    this.listen(window, "popstate", (event) => this.#visit(event));
    this.listen(window, "pagehide", () => this.#store());
    this.listen(window, "keydown", (event) => this.#hear(event));
    this.#timer = setInterval(() => this.#look(), LOOK_EVERY);
    this.atEnd(() => this.#clear());
    this.#applyTheme();
    this.follow({ shown: () => this.#write() });
    this.#begin();
  }

  #clear() {
    clearInterval(this.#timer);
    clearTimeout(this.#waiting);
    clearTimeout(this.#patience);
    this.#tour?.close();
    this.#dialog?.remove();
  }

  /** Where the tabs are wider than their place, as on a telephone, scroll to the one that is shown. */
  #keepTabInSight() {
    const tabs = document.querySelector(".swarm-header nav");
    if (!tabs || this.#tabs === tabs) return;
    this.#tabs = tabs;
    const show = () => {
      const box = tabs.getBoundingClientRect(), tab = tabs.querySelector("[aria-current]")?.getBoundingClientRect();
      if (tab) tabs.scrollLeft += Math.min(tab.left - box.left, 0) + Math.max(tab.right - box.right, 0);
    };
    const changes = new MutationObserver(show), sizes = new ResizeObserver(show);
    changes.observe(tabs, { attributes: true, attributeFilter: ["aria-current"], subtree: true });
    sizes.observe(tabs);
    this.atEnd(() => (changes.disconnect(), sizes.disconnect()));
  }

  /* Theme. */

  get #choice() {
    const choice = localStorage.getItem(THEME);
    return choice in WORDS ? choice : "auto";
  }

  #applyTheme() {
    const choice = this.#choice, { theme } = this.#parts;
    const dark = choice === "auto" ? matchMedia("(prefers-color-scheme: dark)").matches : choice === "dark";
    theme.textContent = SIGNS[choice];
    theme.title = `Theme: ${WORDS[choice]}`;
    theme.setAttribute("aria-label", theme.title);
    for (const one of [this.root.closest(".v-application"), document.getElementById("app")]) {
      one?.classList.toggle("theme--dark", dark);
      one?.classList.toggle("theme--light", !dark);
    }
    this.model.set("dark", dark);
    this.model.save_changes();
  }

  /* Address. */

  #write() {
    const { query, place } = this.model.get("shown");
    if (!query || !place) return;
    if (this.#awaited === place) this.#awaited = null;
    if (this.#awaited !== null) return; // on the way to where Back or Forward leads
    const address = `${location.pathname}?${query}`, known = this.#place ?? history.state?.place ?? place;
    if (known === place) history.replaceState({ ...history.state, place }, "", address);
    else history.pushState({ ...history.state, place }, "", address);
    this.#place = place;
  }

  #visit({ state }) {
    this.#place = state?.place ?? this.#place;
    this.#awaited = this.#place;
    clearTimeout(this.#patience);
    this.#patience = setTimeout(() => ((this.#awaited = null), this.#write()), LONGEST_WAY);
    this.send({ do: "visit", query: location.search });
  }

  async #copy() {
    const { link } = this.#parts;
    await navigator.clipboard.writeText(location.href).then(() => (link.textContent = "Copied"), () => prompt("The link to what is shown", location.href));
    setTimeout(() => (link.textContent = "Link"), SHOWN_FOR);
  }

  /* A reload goes on where the page was. */

  get #player() { return document.querySelector(".swarm-player"); }

  #store() {
    const { step, playing } = this.#player?.dataset ?? {}, speed = this.#player?.querySelector(".swarm-speed input")?.value;
    const left = { query: withoutStep(location.search), step: Number(step ?? 0), playing: playing === "true", speed: Number(speed ?? -1) };
    sessionStorage.setItem(LEFT, JSON.stringify(left));
  }

  #begin() {
    const left = JSON.parse(sessionStorage.getItem(LEFT) ?? "null"), [entry] = performance.getEntriesByType("navigation");
    sessionStorage.removeItem(LEFT);
    const again = entry?.type === "reload" && left?.query === withoutStep(location.search);
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.send({ do: "begin", still, resume: again ? left : null });
    if (this.model.get("tours") && !again && !localStorage.getItem(TOURED)) this.#tourWhenReady();
  }

  /** Begin the tour when the page is there, whose parts come one after the other. */
  #tourWhenReady() {
    if (document.querySelector(".v-application .swarm-chart canvas")) this.#startTour();
    else this.#waiting = setTimeout(() => this.#tourWhenReady(), LOOK_EVERY);
  }

  /* The server. */

  #look() {
    this.#keepTabInSight(); // they may have been made after this view, or anew
    const status = globalThis.solara?.debug?.connectionStatus, gone = this.#parts.gone;
    if (status && status !== "connected" && !gone) this.#showGone();
    else if (status === "connected" && gone) {
      gone.remove();
      this.#parts.gone = null;
    }
  }

  #showGone() {
    const reload = plainButton("Reload", () => location.reload());
    this.#parts.gone = make("div", { class: "swarm-gone", role: "alert" }, make("p", {}, GONE), reload);
    (this.root.closest(".v-application") ?? document.body).append(this.#parts.gone);
  }

  /* Keys and tour. */

  #hear(event) {
    const typing = event.target instanceof Element && event.target.closest("input:not([type=range], [type=checkbox]), textarea, select, [contenteditable]");
    if (event.key !== "?" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.#toggleKeys();
  }

  #toggleKeys() {
    if (this.#dialog?.open) {
      this.#dialog.close();
      return;
    }
    this.#dialog ??= this.#makeDialog();
    this.#dialog.showModal();
  }

  #makeDialog() {
    const rows = this.model.get("key_list").map(([key, what]) => make("tr", {}, make("th", { scope: "row" }, key), make("td", {}, what)));
    const close = plainButton("Close", () => dialog.close());
    const dialog = make("dialog", { class: "swarm-keys", "aria-labelledby": "swarm-keys-title" },
      make("h2", { id: "swarm-keys-title" }, "Keys"), make("table", {}, make("tbody", {}, ...rows)), close);
    this.root.closest(".v-application")?.append(dialog);
    return dialog;
  }

  #startTour() {
    localStorage.setItem(TOURED, "yes");
    this.#tour?.close();
    this.#tour = new Tour(this.model.get("stops"), this.root.closest(".v-application") ?? document.body, () => {
      this.#tour = null;
      this.#parts.tour.focus({ preventScroll: true });
    });
  }
}

/** Stops at parts of the page, one after the other; the page can be used meanwhile. */
class Tour {
  #stops; #at = 0; #card; #marked = null; #done; #listener;

  constructor(stops, root, done) {
    this.#stops = stops.filter(([selector]) => document.querySelector(selector));
    this.#done = done;
    const parts = { text: make("p", { "aria-live": "polite" }), count: make("span", { class: "swarm-hint" }) };
    parts.next = plainButton("Next", () => this.#go(1), { class: "swarm-do" });
    parts.back = plainButton("Back", () => this.#go(-1));
    this.#card = make("section", { class: "swarm-tour", role: "dialog", "aria-label": "Tour of the page", tabindex: "-1" },
      parts.text, make("div", {}, parts.count, parts.back, parts.next, plainButton("End", () => this.close())));
    this.parts = parts;
    root.append(this.#card);
    this.#listener = (event) => {
      if (event.key === "Escape") this.close();
      if (event.key !== "Enter" || event.target !== this.#card) return;
      event.preventDefault(); // else it would press the button that has the focus afterwards
      this.#go(1);
    };
    document.addEventListener("keydown", this.#listener);
    this.#show();
    this.#card.focus({ preventScroll: true });
  }

  close() {
    document.removeEventListener("keydown", this.#listener);
    this.#marked?.classList.remove("swarm-toured");
    this.#card.remove();
    this.#done();
  }

  #go(by) {
    this.#at += by;
    if (this.#at >= this.#stops.length) this.close();
    else this.#show();
  }

  #show() {
    const [selector, text] = this.#stops[this.#at], part = document.querySelector(selector), { text: line, count, back, next } = this.parts;
    this.#marked?.classList.remove("swarm-toured");
    this.#marked = part;
    part?.classList.add("swarm-toured");
    part?.scrollIntoView({ block: "nearest" });
    line.textContent = text;
    count.textContent = `${this.#at + 1} of ${this.#stops.length}`;
    back.disabled = this.#at === 0;
    next.textContent = this.#at === this.#stops.length - 1 ? "Done" : "Next";
    this.#place(part);
  }

  /** Put the card beside the part, where there is room. */
  #place(part) {
    const box = part?.getBoundingClientRect(), { offsetWidth: width, offsetHeight: height } = this.#card, gap = 12;
    if (!box) return;
    const below = box.bottom + gap + height < innerHeight, above = box.top - gap - height > 0;
    const top = below ? box.bottom + gap : above ? box.top - gap - height : Math.max(gap, (innerHeight - height) / 2);
    const beside = box.right + gap + width < innerWidth ? box.right + gap : box.left - gap - width;
    const left = below || above ? box.left : beside;
    this.#card.style.top = `${Math.min(Math.max(top, gap), innerHeight - height - gap)}px`;
    this.#card.style.left = `${Math.min(Math.max(left, gap), innerWidth - width - gap)}px`;
  }
}

export default shownBy(PageBarView);
