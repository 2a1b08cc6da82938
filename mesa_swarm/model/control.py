"""The part `control`: the arbiter that drives robots, its layers, and what is stored to explain their decisions."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, cast

import numpy as np

from mesa_swarm.control.arbiter import Arbiter, driver
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.team import Key, Team, robots_of
from mesa_swarm.errors import BehaviourError, InvalidValueError, asked, shortened
from mesa_swarm.kernels.part import Column, Itself, Part, Phase, Stage
from mesa_swarm.model.state import Checkpointed, attributes_of, refuse_attributes
from mesa_swarm.physics.own_devices import clear_actions
from mesa_swarm.physics.radio import send_goals
from mesa_swarm.robots.actuators import ACT
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import clear_unused, limit_command, speeds_in_words
from mesa_swarm.robots.snapshots import Snapshots

# Columns that arbiters and layers write.
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")
# Attributes of arbiters that follow from what they are made of.
OF_ARBITERS = ("layers", "weights", "others")
WRITTEN = ("command", "last_command", "layer", "task", "goal")


def is_compiled(layer: Any) -> bool:
    """Return whether a layer decides by compiled code: one of the package, or a rule that Numba compiles."""
    if isinstance(layer, Behaviour):
        return not layer.rule.is_plain
    return type(layer).__module__.startswith(OURS)


class Known:
    """What robots know, as arbiters take it; made anew when columns are replaced."""

    senses: Senses | None = None
    version: int = -1

    def __reduce__(self) -> tuple:
        return type(self), ()


class ControlPart(Part):
    """What drives the robots; arbiters and layers own their columns.

    Attributes
    ----------
    arbiter : Arbiter or None
    snapshots : Snapshots or None
        What `SwarmModel.watch` stores.
    """

    name = "control"
    first = settings = ("arbiter",)

    def __init__(self, model: Any) -> None:
        self.model, self.swarm = model, model.swarm
        self.arbiter: Arbiter | None = None
        self.snapshots: Snapshots | None = None
        self.made = Known()

    def columns(self, by_label: bool = True) -> Mapping[str, Column]:
        """Return what the control has written, and the memory of arbiters and layers, by their names.

        Those of a team are named by the label of the arbiter too, unless `by_label` is False.
        """
        columns, names = self.swarm.columns, self.names_of_memory(by_label)
        written = {name: columns[name] for name in (*WRITTEN, *(name for name in columns if name.startswith(ACT)))}
        remembered = {name: columns[of_swarm] for of_swarm, name in names.items()}
        return {name: Column(column, "robots") for name, column in {**written, **remembered}.items()}

    def labelled_arbiters(self) -> Iterator[tuple[str, Any]]:
        """Iterate over the arbiters of the control, each with its label, "" where it is the only one."""
        control: Any = self.arbiter
        if control is not None:
            yield from zip(getattr(control, "labels", ("",)), getattr(control, "arbiters", (control,)), strict=True)

    def prefixes(self, by_label: bool = True) -> dict[tuple[str, str, int], str]:
        """Return with what the names of the swarm's columns of each layer begin, and of each arbiter, whose name is "".

        By the label of the arbiter, the name, and its place among those of this name. What an arbiter has itself, such
        as the states of a machine, begins with the index of its first layer.
        """
        count, prefixes, first = Counter[tuple[str, str]](), {}, 0
        for label, arbiter in self.labelled_arbiters():
            key, begin = (label if by_label else ""), (f".{label}" if label else "")
            names = [("", f"{first}{begin}")]
            names += [(layer.name, f"{index}{begin}.{layer.name}") for index, layer in enumerate(arbiter.layers, first)]
            for name, prefix in names:
                prefixes[key, name, count[key, name]] = prefix
                count[key, name] += 1
            first += len(arbiter.layers)
        return prefixes

    def names_of_memory(self, by_label: bool = True) -> dict[str, str]:
        """Return the swarm's names of columns of memory, each with that by its layer: ``Explore.turn``."""
        prefixes = {prefix: key for key, prefix in self.prefixes(by_label).items()}
        longest_first = sorted(prefixes, key=len, reverse=True)
        found = {}
        for name in self.swarm.columns:
            prefix = next((p for p in longest_first if name[:1].isdigit() and name.startswith(f"{p}.")), None)
            if prefix is not None:
                label, layer, place = prefixes[prefix]
                owner = " ".join(
                    word for word in (f"{label}:" * bool(label), layer, str(place + 1) * (place > 0)) if word
                )
                found[name] = f"{owner}{name.removeprefix(prefix)}".lstrip(".")
        return found

    def stages(self) -> Iterator[Stage]:
        """Decide; store what `watch` asks for."""
        if self.arbiter is not None:
            yield Stage(Phase.DECIDE, self.decide, "layers decide", compiled="layers", python=self.in_python())
        if self.snapshots is not None:
            yield Stage(Phase.PROCESS, self.snapshots.note, "heat is stored to explain decisions", python="watch()")
            yield Stage(Phase.COLLECT, self.store_snapshot, "decisions are stored", python="watch()")

    def parameters(self) -> Arbiter | None:
        """Return the arbiter, of which rules count by their source."""
        return self.arbiter

    def mark(self) -> dict[str, Any]:
        """Return the arbiter, which may be replaced by hand."""
        return {"control": Itself(self.arbiter)}

    def store(self) -> dict[str, Any]:
        """Return the arbiter, and what custom arbiters and layers hold besides their columns, by their place.

        A layer that stores itself, such as a learner, is named whole.
        """
        stored: dict[str, Any] = {"arbiter": self.arbiter}
        for key, owner, values in self._owners():
            if values is None:
                stored[key] = owner
            else:
                stored |= {f"{key} {name}": value for name, value in values.items() if value is not self.swarm}
        return stored

    def word_of(self, name: str) -> str:
        """Return whose attribute a stored value is."""
        key, _, attribute = name.rpartition(" ")
        owners = {key: owner for key, owner, _ in self._owners()}
        if name in owners:
            return f"layer {owners[name].name}"
        return f"layer {owners[key].name}'s {attribute}" if key in owners and key.startswith("layer") else name

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned; an arbiter that is the same stays."""
        if "arbiter" in stored and stored["arbiter"] is not self.arbiter:
            self.set_control(stored["arbiter"])
        owners = {key: (owner, values) for key, owner, values in self._owners()}
        for name, value in stored.items():
            key, _, attribute = name.rpartition(" ")
            if name == "arbiter" or owners.get(name, (None, {}))[1] is None:
                continue
            if key not in owners:
                raise InvalidValueError(f"the control has no {shortened(key)[1:-1]}")
            owner, values = owners[key]
            if values is None or type(owner).__module__.startswith(OURS):
                raise InvalidValueError(f"{type(owner).__name__} has no state of its own")
            refuse_attributes(owner, [attribute])
            object.__setattr__(owner, attribute, value)

    def _owners(self) -> Iterator[tuple[str, Any, dict[str, Any] | None]]:
        """Iterate over arbiters and layers by their place, with their attributes; None for what stores itself."""
        if self.arbiter is None:
            return
        for place, arbiter in enumerate(getattr(self.arbiter, "arbiters", ())):
            values = {} if type(arbiter).__module__.startswith(OURS) else vars(arbiter)
            yield f"arbiter {place}", arbiter, {n: v for n, v in values.items() if n not in OF_ARBITERS}
        for place, layer in enumerate(getattr(self.arbiter, "layers", ())):
            if isinstance(layer, Checkpointed):
                yield f"layer {place}", layer, None
            elif not type(layer).__module__.startswith(OURS):
                yield f"layer {place}", layer, getattr(layer, "__dict__", {})

    def in_python(self) -> str:
        """Return the names of layers that are not compiled: rules that run as plain Python, classes of a user's."""
        layers = getattr(self.arbiter, "layers", ())
        plain = [layer for layer in layers if not is_compiled(layer)]
        return ", ".join(dict.fromkeys(str(layer.name) for layer in plain))

    def arrays_of_layers(self) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
        """Iterate over the arrays that custom layers have as attributes, by the place of the layer."""
        for place, layer in enumerate(getattr(self.arbiter, "layers", ())):
            own = {} if type(layer).__module__.startswith("mesa_swarm.") else attributes_of(layer)
            arrays = {name: value for name, value in own.items() if isinstance(value, np.ndarray)}
            if arrays:
                yield f"layer {place}", arrays

    def set_control(self, control: Arbiter | Mapping[Key, Arbiter | None] | None) -> None:
        """Let another arbiter drive the robots; their memory and messages are cleared."""
        if isinstance(control, Mapping) and not isinstance(control, Team):
            control = Team(control)
        if control is not None and (isinstance(control, type) or asked(control, "bound") is None):
            raise InvalidValueError(
                f"control is {shortened(control)}; expected an arbiter such as Subsumption(Avoid(), Explore())"
            )
        if isinstance(control, Arbiter):
            control.check_robots(robots_of(self.swarm))
        before = self.arbiter
        if isinstance(before, Arbiter):
            before.unbind()
        try:
            self._drive_by(control)
        except Exception:
            self._drive_by(before)
            raise

    def _drive_by(self, control: Arbiter | None) -> None:
        self.swarm.forget()
        self.swarm.columns["command"].fill(0.0)
        self.swarm.columns["layer"].fill(-1)
        self.swarm.clear_messages()
        if self.snapshots is not None:
            self.snapshots.forget()  # layer indices changed
        self.arbiter = None if control is None else control.bound(self.swarm, self.model.streams)
        self._note_memory()
        self.model.parts.replan()

    def watch(self, snapshots: Snapshots) -> None:
        """Store what robots know and do in the next steps."""
        self.snapshots = snapshots
        self._note_memory()
        self.model.parts.replan()

    def _note_memory(self) -> None:
        """Let snapshots store what explains the decisions of the control."""
        if self.snapshots is not None:
            self.snapshots.noted = getattr(self.arbiter, "noted", ())

    def store_snapshot(self) -> None:
        """Store what robots know and do, if a row is due."""
        snapshots: Any = self.snapshots
        if snapshots.trigger.is_due(self.model._completed):
            snapshots.append(self.model._completed)

    def check_driven(self, design: RobotDesign, group: str) -> None:
        """Refuse robots that the control is not for."""
        if isinstance(self.arbiter, Arbiter):
            self.arbiter.check_robots([(design, group)])

    def decide(self) -> None:
        """Let every robot decide on what it knows."""
        swarm, control, channel = self.swarm, self.arbiter, self.model._parts.radio.channel
        columns, table = swarm.columns, swarm.table
        command, layer = columns["command"], columns["layer"]
        columns["task"].fill(-1)
        columns["goal"].fill(np.nan)
        if table.actions:
            clear_actions(swarm)
        if channel is not None:
            channel.begin_decision(swarm)
        columns["last_command"][:] = command
        control.decide(self._senses(), command, layer)  # type: ignore[union-attr]
        if table.mixed:
            clear_unused(command, columns["design"], table.numbers)
        wrong = limit_command(command, columns["max_speed"], columns["design"], table.sideways)
        if wrong >= 0:
            self._refuse(wrong, int(layer[wrong]))
        if channel is not None:
            send_goals(columns["position"], columns["heading"], columns["goal"], columns["sent_goal"])

    def _senses(self) -> Senses:
        made = self.made
        if made.senses is None or made.version != self.swarm.version:
            made.senses, made.version = Senses.of(self.swarm), self.swarm.version
        return made.senses

    def _refuse(self, row: int, layer: int) -> None:
        robot, name = self.swarm.agents[row], driver(cast(Arbiter, self.arbiter), layer)
        raise BehaviourError(
            f"{name} commanded NaN to robot {robot.unique_id} in step {self.model.steps}; "
            f"expected {speeds_in_words(robot.design.numbers)}"
        )
