/* How widgets build their part of the page, and which theme it has. Put before their modules. */

/** Return an element with attributes and children; a function as attribute listens. */
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** Return Vuetify's page around an element. Widgets are built before they are put on a page, so that none may be around
    them yet; a page of Vuetify has but one, whereas in JupyterLab there may be others beside them. */
function pageAround(element) {
  const lab = document.body.dataset.jpThemeLight;
  return element.closest(".v-application") ?? (lab ? null : document.querySelector(".v-application"));
}

/** The theme that surrounds an element: of a Vuetify page, of JupyterLab, else of the system. */
function themeAround(element) {
  const page = pageAround(element);
  if (page) return page.classList.contains("theme--dark") ? "dark" : "light";
  const lab = document.body.dataset.jpThemeLight;
  if (lab) return lab === "false" ? "dark" : "light";
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}

/** Act whenever that theme changes, and once the element is on its page; return how to stop. */
function watchTheme(element, act) {
  const observer = new MutationObserver(act), query = matchMedia("(prefers-color-scheme: dark)");
  const observe = () => {
    for (const one of [pageAround(element), document.body]) {
      if (one) observer.observe(one, { attributes: true, attributeFilter: ["class", "data-jp-theme-light"] });
    }
    act();
  };
  const asked = requestAnimationFrame(observe);
  query.addEventListener("change", act);
  return () => {
    cancelAnimationFrame(asked);
    observer.disconnect();
    query.removeEventListener("change", act);
  };
}

/** Show over a part of the page why it cannot be used any more; what it shows stays. An empty text takes that back. */
function showGone(root, text) {
  root.querySelector(":scope > .swarm-gone")?.remove();
  root.classList.toggle("swarm-is-gone", Boolean(text));
  for (const child of root.children) child.inert = Boolean(text);
  if (text) root.append(make("p", { class: "swarm-gone", role: "alert" }, text));
}
