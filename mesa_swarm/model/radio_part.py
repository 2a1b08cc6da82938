"""The part `radio`: what robots broadcast to each other."""

from collections.abc import Iterator, Mapping
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.kernels.draws import words_of
from mesa_swarm.kernels.part import Column, Itself, Kernel, Part, Phase, Stage
from mesa_swarm.physics.broadcasts import NO_WORDS, Channel
from mesa_swarm.robots.radio import Radio

SENT_AND_HEARD = ("sent_goal", "heard_layer", "heard_task", "heard_from", "heard_goal")


class RadioPart(Part):
    """How robots broadcast.

    Attributes
    ----------
    channel : Channel or None
        None where robots do not communicate.
    """

    name = "radio"
    first = settings = ("radio",)

    def __init__(self, model: Any, radio: Radio | None) -> None:
        self.model = model
        self.channel: Channel | None = None
        self.set_radio(radio)

    @property
    def radio(self) -> Radio | None:
        """The radio of all robots, None without one."""
        return None if self.channel is None else self.channel.radio

    def set_radio(self, radio: Radio | None) -> None:
        """Let robots broadcast in another way; all messages are cleared."""
        if radio is not None and not isinstance(radio, Radio):
            raise InvalidValueError(f"communication is {shortened(radio)}; expected Radio(...) or None")
        for beacon in () if radio is None else radio.beacons:
            self.model.parts.bodies.checked_point(beacon)
        self.channel = None if radio is None else Channel(radio)
        self.model.swarm.set_messages({} if radio is None else radio.columns())
        self.model.swarm.clear_messages()
        self.model.parts.replan()

    def columns(self) -> Mapping[str, Column]:
        """Return what robots have sent and heard."""
        columns = self.model.swarm.columns
        names = (*SENT_AND_HEARD, *(name for name in columns if name.startswith(("send.", "heard."))))
        return {name: Column(columns[name], "robots") for name in names}

    def stages(self) -> Iterator[Stage]:
        """Exchange what was published after the previous step."""
        if self.channel is not None:
            yield Stage(Phase.EXCHANGE, self.exchange, "robots hear each other", self.kernel())

    def parameters(self) -> Radio | None:
        """Return the radio."""
        return self.radio

    def mark(self) -> dict[str, Any]:
        """Return the radio, which may be replaced by hand."""
        return {"channel": Itself(self.channel)}

    def store(self) -> dict[str, Any]:
        """Return the radio."""
        return {"radio": self.radio}

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, unless it is the same."""
        if stored.get("radio", self.radio) != self.radio:
            self.set_radio(stored["radio"])

    def exchange(self) -> None:
        """Let robots hear what the others have sent."""
        self.kernel().run(self.model.completed + 1, len(self.model.swarm))

    def kernel(self) -> Kernel:
        """Return what lets robots hear what the others have sent, of which some may be lost by chance."""
        channel: Any = self.channel
        loses = channel.radio.loss_probability > 0
        words = words_of(self.model.streams["communication"]) if loses else NO_WORDS
        return channel.kernel(self.model.swarm, self.model.parts.bodies.scene(), words)
