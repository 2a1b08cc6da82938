"""The part `control`: the arbiter that drives robots, its layers, and what is stored to explain their decisions."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, check_count, read_attribute, shortened
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.control.arbiter import Arbiter, Clearing, Turns, kernel_of_stage, name_driver
from mesa_swarm.control.explain import Explanation, explanation
from mesa_swarm.control.layer import Senses
from mesa_swarm.control.team import Key, Team, robots_of
from mesa_swarm.kernels.part import Column, Itself, Kernel, Part, Phase, Prepared, Stage
from mesa_swarm.model.state import Checkpointed, attributes_of, refuse_attributes
from mesa_swarm.robots.actuators import ACT
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import limit_command, speeds_in_words
from mesa_swarm.robots.radio import SEND
from mesa_swarm.robots.robot import Robot
from mesa_swarm.robots.snapshots import DECISIONS, Snapshots, check_watched

# Columns that arbiters and layers write.
OURS = ("mesa_swarm.control.", "mesa_swarm.fire.")
# Attributes of arbiters that follow from what they are made of.
OF_ARBITERS = ("layers", "weights", "others")
WRITTEN = ("command", "last_command", "layer", "task", "goal")


def is_frozen(layer: Any) -> bool:
    """Return whether the parameters of a layer cannot be set after it was made."""
    return getattr(getattr(layer, "__dataclass_params__", None), "frozen", False)


class Parameters:
    """The attributes of an arbiter or a layer, and parameters of a rule, which may be set by hand."""

    def __init__(self, owner: Any) -> None:
        self.owner, self.values = owner, dict(getattr(owner, "__dict__", {}))
        self.parameters = dict(getattr(owner, "parameters", {}))

    def has_changed(self) -> bool:
        """Return whether an attribute or parameter has been replaced or changed."""
        try:
            changed = getattr(self.owner, "__dict__", {}) != self.values
        except ValueError:  # of arrays, which are compared only where they are not the same object
            return True
        return changed or getattr(self.owner, "parameters", self.parameters) != self.parameters


class ControlCache(Prepared):
    """What robots know, as arbiters take it, made anew when columns are replaced; and what may change by hand."""

    senses: Senses | None = None
    version: int = -1
    owners: Sequence[Parameters] = ()
    planned: Kernel | None = None


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
        self.cache = ControlCache()

    def columns(self, by_label: bool = True) -> Mapping[str, Column]:
        """Return what the control has written, and the memory of arbiters and layers, by their names.

        Those of a team are named by the label of the arbiter too, unless `by_label` is False.
        """
        columns, names = self.swarm.columns, self.names_of_memory(by_label)
        outputs = {name: columns[name] for name in (*WRITTEN, *(name for name in columns if name.startswith(ACT)))}
        remembered = {name: columns[of_swarm] for of_swarm, name in names.items()}
        return {name: Column(column, "robots") for name, column in {**outputs, **remembered}.items()}

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
        names = {}
        for name in [name for name in self.swarm.columns if name[:1].isdigit()]:
            prefix = next((p for p in longest_first if name.startswith(f"{p}.")), None)
            if prefix is not None:
                label, layer, place = prefixes[prefix]
                owner = " ".join(
                    word for word in (f"{label}:" * bool(label), layer, str(place + 1) * (place > 0)) if word
                )
                names[name] = f"{owner}{name.removeprefix(prefix)}".lstrip(".")
        return names

    def stages(self) -> Iterator[Stage]:
        """Decide; store what `watch` asks for."""
        if self.arbiter is not None:
            self.cache.planned, reasons = self.kernel(), ", ".join(self.reasons())
            kernel = None if reasons else self.cache.planned
            yield Stage(Phase.DECIDE, self.decide, "layers decide", kernel, compiled="layers", python=reasons)
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
        content: dict[str, Any] = {"arbiter": self.arbiter}
        for key, owner, values in self._owners():
            if values is None:
                content[key] = owner
            else:
                content |= {f"{key} {name}": value for name, value in values.items() if value is not self.swarm}
        return content

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

    def arrays_of_layers(self) -> Iterator[tuple[str, dict[str, np.ndarray]]]:
        """Iterate over the arrays that custom layers have as attributes, by the place of the layer."""
        for place, layer in enumerate(getattr(self.arbiter, "layers", ())):
            attributes = {} if type(layer).__module__.startswith("mesa_swarm.") else attributes_of(layer)
            arrays = {name: value for name, value in attributes.items() if isinstance(value, np.ndarray)}
            if arrays:
                yield f"layer {place}", arrays

    def set_control(self, control: Arbiter | Mapping[Key, Arbiter | None] | None) -> None:
        """Let another arbiter drive the robots; their memory and messages are cleared."""
        if isinstance(control, Mapping) and not isinstance(control, Team):
            control = Team(control)
        if control is not None and (isinstance(control, type) or read_attribute(control, "bound") is None):
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

    def watch(
        self, last: int | None = 100, *, every: int | Trigger = 1, columns: tuple[str, ...] = DECISIONS
    ) -> Snapshots:
        """Store what robots know and do in the next steps, and return the store.

        Watching again begins with an empty store; `last=None` stores every step, and memory grows without end.

        Parameters
        ----------
        last : int or None
            How many snapshots to store; the oldest are dropped.
        every : int
            Steps from one to the next.
        columns : tuple of str
            Of the swarm, those that `explain` needs by default.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> snapshots = model.watch(last=50)
        >>> len(model.run(60).watched)
        50
        """
        self.snapshots = Snapshots(self.swarm, last=last, every=every, columns=columns)
        self._note_memory()
        self.model.parts.replan()
        return self.snapshots

    def explain(self, robot: Robot, step: int | None = None) -> Explanation:
        """Return why a robot did what it did in the last step, or in another stored one; call `watch` first.

        Parameters
        ----------
        robot : Robot
            One of `model.robots`.
        step : int, optional

        Returns
        -------
        Explanation
            As a text one sentence: what the robot did, the layer that won, the readings that triggered it.

        Raises
        ------
        InvalidValueError
            If `watch` was not called, columns are missing, control is None, or the step is not stored.
        RemovedRobotError
            If the robot was removed.

        Examples
        --------
        >>> from mesa_swarm import AGENT9, SwarmModel
        >>> from mesa_swarm.control import Avoid, Explore, Subsumption
        >>> model = SwarmModel(rng=1)
        >>> (robot,) = model.add_robots(AGENT9, poses=[(765, 300, 0.0)], tendency="left")
        >>> model.control = Subsumption(Avoid(distance=10.5), Explore())
        >>> snapshots = model.watch()
        >>> print(model.run(1).explain(robot))
        step 1: robot 5 turns left while moving; Avoid: front sensor 10.0 (an obstacle) < 10.5
        """
        if not isinstance(robot, Robot) or robot.model is not self.model:
            raise InvalidValueError(f"robot is {shortened(robot)}; expected one of this model's robots")
        row, snapshots = robot.alive(), check_watched(self.snapshots, DECISIONS, "explain")
        if self.arbiter is None:
            raise InvalidValueError("control is None, which explains nothing; set model.control")
        moment = int(snapshots.steps[-1]) if step is None else check_count("step", step)
        return explanation(self.arbiter, self.swarm, snapshots, row, moment, self.model.kinds)

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

    def kernel(self) -> Kernel:
        """Return what decides, made anew when columns, layers or their parameters have changed."""
        cache, arbiter, channel = self.cache, cast(Any, self.arbiter), self.model._parts.radio.channel
        crew = self.model.parts.robots.engine.crew
        state = self.swarm.version, self.swarm.regrouped, Itself(arbiter), channel, crew and crew.parts
        if cache.kernel is None or cache.state != state or any(owner.has_changed() for owner in cache.owners):
            cache.kernel = kernel_of_stage(
                arbiter, self._senses(), self.swarm, self._cleared(), channel is not None, self._refuse_nan
            )
            owners = (owner for owner in cache.kernel.kept[0].owners() if not is_frozen(owner))
            cache.state, cache.owners = state, [*map(Parameters, owners)]
        return cache.kernel

    def _cleared(self) -> list[Clearing]:
        """Return the columns that are set to a value before robots decide: of actuators that do not hold, of messages.

        What robots send is what they set in each decision, NaN for nothing.
        """
        columns, table, channel = self.swarm.columns, self.swarm.table, self.model._parts.radio.channel
        actions = [(f"{ACT}{name}", 0.0) for name, (_, holds) in table.actions.items() if not holds]
        messages = [(f"{SEND}{name}", math.nan) for name, _ in channel.radio.message] if channel is not None else []
        return [Clearing(columns[name].reshape(-1), value) for name, value in (*actions, *messages)]

    def reasons(self) -> list[str]:
        """Return what makes Python due where robots decide: rules that are not compiled, classes of a user's."""
        turns: Turns = self.kernel().kept[0]
        return [*dict.fromkeys(turns.python)]

    def decide(self) -> None:
        """Let every robot decide on what it knows."""
        kernel = self.kernel()
        if kernel is not self.cache.planned:  # rules are compiled in their first step
            self.model.parts.replan()
        kernel.run(self.model.steps, len(self.swarm))

    def _senses(self) -> Senses:
        cache = self.cache
        if cache.senses is None or cache.version != self.swarm.version:
            crew = self.model.parts.robots.engine.crew
            cache.senses, cache.version = Senses.of(self.swarm, crew), self.swarm.version
        return cache.senses

    def _refuse_nan(self) -> None:
        """Raise an error for the robot for which a layer has commanded NaN."""
        columns, sideways = self.swarm.columns, self.swarm.table.sideways
        row = limit_command(columns["command"], columns["max_speed"], columns["design"], sideways)
        robot, name = self.swarm.agents[row], name_driver(cast(Arbiter, self.arbiter), int(columns["layer"][row]))
        raise BehaviourError(
            f"{name} commanded NaN to robot {robot.unique_id} in step {self.model.steps}; "
            f"expected {speeds_in_words(robot.design.numbers)}"
        )
