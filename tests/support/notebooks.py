"""A notebook's page without a notebook: a widget of this process shown in a browser, and what both send each other."""

from base64 import b64encode
from typing import Any

from mesa_swarm.viewing.canvas_widget import SwarmCanvas
from support.waiting import wait_until

# What JupyterLab does for a widget: `kernel` is the other side, `open_view` an output.
PAGE = """async ({ script, css, traits }) => {
  const signal = () => {
    const heard = new Set(), emit = (...news) => heard.forEach((act) => act(null, ...news));
    return { connect: (act) => heard.add(act), disconnect: (act) => heard.delete(act), emit };
  };
  const { default: widget } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const style = document.createElement("style"), listeners = {}, model = {
    get: (name) => traits[name] ?? null,
    set: (name, value) => { traits[name] = value; },
    save_changes: () => kernel.outbox.push({ trait: "selected", value: traits.selected }),
    on: (name, act) => (listeners[name] ??= new Set()).add(act),
    off: (name, act) => listeners[name]?.delete(act),
    send: (message) => kernel.outbox.push(message),
    widget_manager: { kernel: { statusChanged: signal(), disposed: signal() } },
  };
  const view = { model: { get comm_live() { return kernel.live; } } }; // with which anywidget calls listeners
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  style.textContent = css;
  document.head.append(style);
  const fire = (name, ...given) => [...(listeners[name] ?? [])].forEach((act) => act.apply(view, given));
  window.kernel = {
    outbox: [], live: true, ...model.widget_manager.kernel,
    deliver: (message, buffers) => fire("msg:custom", message, buffers.map(bytes)),
    change: (name, value) => { traits[name] = value; fire(`change:${name}`); },
    set_live: (live) => {
      kernel.live = live;
      fire("comm_live_update");
    },
  };
  window.open_view = (width, height) => {
    const output = document.createElement("div"), el = document.createElement("div");
    output.className = "output";
    output.style.cssText = `width: ${width}px; height: ${height}px`;
    el.classList.toggle("jupyter-widgets-disconnected", !kernel.live);
    output.append(el);
    document.body.append(output);
    el.stop = widget.render({ model, el });
  };
}"""


class FakeNotebook:
    """Shows a canvas on a page; `exchange` passes messages, as a kernel does between cells."""

    def __init__(self, page: Any, canvas: SwarmCanvas, live: bool = True) -> None:
        self.page, self.canvas = page, canvas
        self.listening = True
        self._outgoing: list[tuple[dict, list[str]]] = []
        canvas.send = self._send
        canvas.observe(lambda change: page.evaluate("one => kernel.change('selected', one)", change["new"]), "selected")
        traits = {name: getattr(canvas, name) for name in ("options", "selected", "picture")}
        page.evaluate(PAGE, {"script": canvas._esm, "css": canvas._css, "traits": traits})
        if not live:
            page.evaluate("kernel.set_live(false)")

    def open_view(self, width: int = 800, height: int = 500) -> Any:
        """Show the canvas in another output, and return its element."""
        self.page.evaluate("([width, height]) => open_view(width, height)", [width, height])
        views = self.page.locator(".output .swarm-player")
        return views.nth(views.count() - 1)

    def exchange(self) -> None:
        """Deliver what Python has sent, and hear what the page has."""
        outgoing, self._outgoing = self._outgoing, []
        for message, buffers in outgoing:
            self.page.evaluate("([message, buffers]) => kernel.deliver(message, buffers)", [message, buffers])
        for message in self.page.evaluate("kernel.outbox.splice(0)"):
            if "trait" in message:
                self.canvas.selected = message["value"]
            else:
                self.canvas._hear(message)

    def wait(self, view: Any, condition: str) -> None:
        """Exchange messages until a condition on `player`, the data of a view, holds."""

        def holds() -> bool:
            self.exchange()
            return bool(view.evaluate(f"(one) => {{ const player = one.dataset; return {condition}; }}"))

        wait_until(holds)

    def _send(self, message: dict, buffers: list | None = None) -> None:
        self._outgoing.append((message, [b64encode(one).decode() for one in buffers or ()]))
