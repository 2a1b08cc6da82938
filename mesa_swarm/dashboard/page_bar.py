"""What the page asks of the browser: to write its address bar, and which theme the user wants."""

import anywidget
import traitlets


class PageBar(anywidget.AnyWidget):
    """A button that switches between light and dark, and the page's hand on the address bar.

    Parameters
    ----------
    query : str
        Written into the address bar; the page is not loaded anew.
    dark : bool
        What the user chose, or what the system prefers.
    """

    _esm = """
    const KEY = "mesa_swarm.theme", WORDS = { auto: "as the system", light: "light", dark: "dark" };
    const NEXT = { auto: "dark", dark: "light", light: "auto" };
    const SIGNS = { auto: "\\u25D0", light: "\\u2600", dark: "\\u263E" };

    export default {
      render({ model, el }) {
        const system = matchMedia("(prefers-color-scheme: dark)");
        const button = document.createElement("button");
        button.type = "button";
        button.className = "swarm-theme";
        const choice = () => WORDS[localStorage.getItem(KEY)] ? localStorage.getItem(KEY) : "auto";
        const apply = () => {
          const dark = choice() === "auto" ? system.matches : choice() === "dark", page = el.closest(".v-application");
          button.textContent = SIGNS[choice()];
          button.title = `Theme: ${WORDS[choice()]}`;
          button.setAttribute("aria-label", button.title);
          for (const one of [page, document.getElementById("app")]) {
            one?.classList.toggle("theme--dark", dark);
            one?.classList.toggle("theme--light", !dark);
          }
          model.set("dark", dark);
          model.save_changes();
        };
        const write = () => history.replaceState(history.state, "", `${location.pathname}?${model.get("query")}`);
        button.addEventListener("click", () => (localStorage.setItem(KEY, NEXT[choice()]), apply()));
        system.addEventListener("change", apply);
        model.on("change:query", write);
        el.append(button);
        apply();
        if (model.get("query")) write();
        return () => (system.removeEventListener("change", apply), model.off("change:query", write));
      },
    };
    """
    query = traitlets.Unicode("").tag(sync=True)
    dark = traitlets.Bool(False).tag(sync=True)
