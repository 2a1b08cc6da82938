"""A button with which a file is handed over, in pieces, so that large ones get through."""

from typing import Protocol

import anywidget
import traitlets

from mesa_swarm.dashboard.downloads import PIECE


class Receiver(Protocol):
    """Whoever takes a file: piece by piece, and may refuse."""

    def begin_upload(self, name: str, size: int) -> bool:
        """Return whether a file may come."""

    def take(self, piece: bytes) -> bool:
        """Take a piece; return whether more may come."""

    def end_upload(self) -> None:
        """Take note that all has come."""


class FilePicker(anywidget.AnyWidget):
    """A button that opens the browser's choice of files.

    Parameters
    ----------
    label : str
    accept : str
        Endings of names, as HTML has them.
    """

    _esm = """
    export default {
      render({ model, el }) {
        const file = document.createElement("input"), button = document.createElement("button");
        Object.assign(file, { type: "file", accept: model.get("accept"), hidden: true });
        file.setAttribute("aria-label", model.get("label"));
        Object.assign(button, { type: "button", textContent: model.get("label") });
        let chosen = null, from = 0;
        const next = async () => {
          const part = await chosen.slice(from, from + model.get("piece")).arrayBuffer();
          from += part.byteLength;
          model.send({ do: "piece", last: from >= chosen.size }, undefined, [part]);
        };
        const hear = (message) => chosen && (message.go ? next() : (chosen = null));
        button.addEventListener("click", () => file.click());
        file.addEventListener("change", () => {
          [chosen, from] = [file.files[0], 0];
          if (chosen) model.send({ do: "begin", name: chosen.name, size: chosen.size });
          file.value = "";
        });
        model.on("msg:custom", hear);
        el.append(file, button);
        return () => model.off("msg:custom", hear);
      },
    };
    """
    label = traitlets.Unicode("Upload").tag(sync=True)
    accept = traitlets.Unicode("").tag(sync=True)
    piece = traitlets.Int(PIECE).tag(sync=True)


class Upload:
    """Lets a button hand its files to a receiver.

    Parameters
    ----------
    picker : FilePicker
    receiver : Receiver
    """

    def __init__(self, picker: FilePicker, receiver: Receiver) -> None:
        self.picker, self.receiver = picker, receiver
        self._hear = lambda _, message, buffers: self.act(message, buffers)
        picker.on_msg(self._hear)

    def act(self, message: dict, buffers: list) -> None:
        """Do what the browser asks for."""
        match message.get("do"):
            case "begin":
                goes_on = self.receiver.begin_upload(str(message.get("name", "")), int(message.get("size", 0)))
                self.picker.send({"go": goes_on})
            case "piece" if buffers:
                goes_on = self.receiver.take(bytes(buffers[0])) and not message.get("last")
                self.picker.send({"go": goes_on})
                if message.get("last"):
                    self.receiver.end_upload()

    def close(self) -> None:
        """Part them."""
        self.picker.on_msg(self._hear, remove=True)
