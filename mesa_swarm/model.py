"""SwarmModel: a Mesa model of robots in a world, and its step, written once."""

import os
from collections.abc import Mapping
from typing import Self

import mesa
import numpy as np

from mesa_swarm.control.arbiter import Arbiter, check_drives, driver
from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    asked,
    check_choice,
    check_count,
    check_number,
    shortened,
)
from mesa_swarm.fire.burning import burn
from mesa_swarm.fire.constants import FireConstants, design_constants
from mesa_swarm.physics.engine import CompiledEngine, Engine
from mesa_swarm.physics.imperfect import Imperfect
from mesa_swarm.physics.radio import Channel, send_goals
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.progress import progress_bar
from mesa_swarm.recorded_world import RecordedWorld
from mesa_swarm.robots.drive import limit_command
from mesa_swarm.robots.imperfections import Imperfections
from mesa_swarm.robots.radio import Radio
from mesa_swarm.streams import Seed
from mesa_swarm.world.map import Map

ENGINES: dict[str, type[Engine]] = {"compiled": CompiledEngine, "shapely": ShapelyEngine}


class SwarmModel(RecordedWorld):
    """A world of robots, obstacles and fires, advanced step by step.

    Parameters
    ----------
    map : str, path or Map
        A built-in map (original, sparse, openspace, openspace_fire), a file (.toml, .svg, .map), or a Map.
    rng : int, SeedSequence, Generator or None
        Seed of everything random. The same seed gives the same bits.
    engine : str
        "compiled", or "shapely": slow and readable, the oracle of the first.
    turn_angle_degrees : float
        A robot whose travel is farther than this from the normal of a flat face that it meets is turned
        parallel to it; 0 to 90.
    fire_constants : FireConstants, optional
        From `design_constants`, whose defaults are used otherwise.
    extinguish_range : float
        A robot whose body is this near to a fire's edge can fight it and takes its heat, at least 0.
    history_every : int
        Steps between two rows of `fires.history`; 0 keeps none.
    collect_every : int
        Steps between two rows of `datacollector`, 1 for each step; 0 collects nothing.
    communication : Radio, optional
        How robots broadcast to each other; by default they do not.
    model_reporters, agent_reporters : dict, optional
        More of what Mesa's DataCollector collects, besides `collisions` and
        `total_collisions`.

    Attributes
    ----------
    swarm : Swarm
        The robots' columns.
    fires : Fires
        The fires' columns.
    space : Arena
    datacollector : mesa.DataCollector

    Examples
    --------
    >>> from mesa_swarm import AGENT9, SwarmModel
    >>> from mesa_swarm.control import Avoid, Explore, Subsumption
    >>> model = SwarmModel(map="original", rng=1)
    >>> robots = model.add_robots(AGENT9, 5)
    >>> model.control = Subsumption(Avoid(distance=15), Explore())
    >>> model.run(10).steps
    10
    """

    def __init__(
        self,
        *,
        map: str | os.PathLike | Map = "openspace",
        rng: Seed = None,
        engine: str = "compiled",
        turn_angle_degrees: float = 60.0,
        fire_constants: FireConstants | None = None,
        extinguish_range: float = 10.0,
        history_every: int = 1,
        collect_every: int = 1,
        communication: Radio | None = None,
        model_reporters: dict | None = None,
        agent_reporters: dict | None = None,
    ) -> None:
        self._turn_angle = np.radians(check_number("turn_angle_degrees", turn_angle_degrees, minimum=0, maximum=90))
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self._engine: Engine = ENGINES[check_choice("engine", engine, ENGINES)]()
        super().__init__(map=map, rng=rng, history_every=history_every)
        self.fire_constants = design_constants() if fire_constants is None else fire_constants
        self.communication = communication
        self.collect_every = collect_every
        self._imperfect: Imperfect | None = None
        self.collisions = 0
        self.total_collisions = 0
        self._senses: Senses | None = None
        self._senses_version = -1
        self._sensed: tuple | None = None
        self._noise: tuple | None = None
        for name, given in (("model_reporters", model_reporters), ("agent_reporters", agent_reporters)):
            if given is not None and not isinstance(given, Mapping):
                raise InvalidValueError(f"{name} is {shortened(given)}; expected a dict of reporters by name")
        reporters = {"collisions": "collisions", "total_collisions": "total_collisions"}
        self.datacollector = mesa.DataCollector(
            model_reporters={**reporters, **(model_reporters or {})}, agent_reporters=agent_reporters
        )

    def __repr__(self) -> str:
        counts = f"{len(self.swarm)} robots, {len(self.fires)} fires"
        return f"<{type(self).__name__} on map {self.map.name}, step {self.steps}: {counts}>"

    @property
    def collect_every(self) -> int:
        """Steps between two rows of `datacollector`, 0 for no rows at all; may be changed between steps.

        A row of the usual two numbers takes 50 bytes: 10 million steps with ``collect_every=1`` take half a gigabyte.
        Rows are collected after the steps that it divides; `mesa.batch_run` needs one after each step.

        Examples
        --------
        >>> model = SwarmModel(rng=1, collect_every=10).run(40)
        >>> len(model.datacollector.get_model_vars_dataframe())
        4
        """
        return self._collect_every

    @collect_every.setter
    def collect_every(self, steps: int) -> None:
        self._collect_every = check_count("collect_every", steps)

    @property
    def fire_constants(self) -> FireConstants:
        """The constants of the fires and of the heat in robots; may be changed between steps."""
        return self._fire_constants

    @fire_constants.setter
    def fire_constants(self, constants: FireConstants) -> None:
        if not isinstance(constants, FireConstants):
            raise InvalidValueError(
                f"fire_constants is {shortened(constants)}; expected what design_constants() returns"
            )
        self._fire_constants = constants

    @property
    def communication(self) -> Radio | None:
        """How robots broadcast to each other, or None; may be changed between steps, and then all is unheard."""
        return None if self._channel is None else self._channel.radio

    @communication.setter
    def communication(self, radio: Radio | None) -> None:
        if radio is not None and not isinstance(radio, Radio):
            raise InvalidValueError(f"communication is {shortened(radio)}; expected Radio(...) or None")
        for beacon in () if radio is None else radio.beacons:
            self._checked_point(beacon)
        self._channel = None if radio is None else Channel(radio)
        self.swarm.hush()

    @property
    def imperfections(self) -> Imperfections | None:
        """How far the robots are from ideal ones, or None; may be changed between steps.

        Examples
        --------
        >>> from mesa_swarm.robots.imperfections import ROBOTARIUM
        >>> model = SwarmModel(rng=1)
        >>> model.imperfections = ROBOTARIUM.at(0.5)
        >>> model.imperfections.sensing.dropout
        0.0175
        """
        return None if self._imperfect is None else self._imperfect.imperfections

    @imperfections.setter
    def imperfections(self, imperfections: Imperfections | None) -> None:
        if imperfections is not None and not isinstance(imperfections, Imperfections):
            raise InvalidValueError(f"imperfections is {shortened(imperfections)}; expected Imperfections(...) or None")
        self._sensed, self._imperfect = None, None
        self.swarm.shed()
        if imperfections is not None:
            key = self.streams["imperfections"].integers(2**64, dtype=np.uint64)
            self._imperfect = Imperfect(imperfections, self.swarm, int(key))

    @property
    def control(self) -> Arbiter | None:
        """What drives the robots: an arbiter such as `Subsumption`, or None."""
        return self._control

    @control.setter
    def control(self, control: Arbiter | None) -> None:
        if control is not None and (isinstance(control, type) or asked(control, "bound") is None):
            raise InvalidValueError(
                f"control is {shortened(control)}; expected an arbiter such as Subsumption(Avoid(), Explore())"
            )
        if isinstance(control, Arbiter):
            check_drives(control, [self.swarm.designs[d] for d in np.unique(self.swarm.design)])
        before = self._control
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
        self.swarm.hush()
        if self._snapshots is not None:
            self._snapshots.forget()  # what layer 0 was it is no longer
        self._control = None if control is None else control.bound(self.swarm, self.streams)

    # ---- the step

    def step(self) -> None:
        """Advance the world by one step.

        ==========  ================================================  ===========================================
        phase       reads                                             writes
        ==========  ================================================  ===========================================
        sense       position, heading, obstacles, fires               distance, kind, radiation, line
        exchange    layer, task, sent_goal, pose, obstacles           heard_layer, heard_task, heard_from, heard_goal
        decide      what robots know (`control.Senses`)               command, layer, task, goal, sent_goal
        move        command, loads                                    loads, position, heading
        resolve     position, obstacles, fires                        position, heading, slip, collided, contacts
        burn        position                                          fires' temperature, robots' temperature, fire
        collect     everything                                        datacollector, history
        ==========  ================================================  ===========================================

        Every robot acts on what was published after the previous step; nothing depends on their order.
        Without `communication` there is no exchange, and no goal is sent.
        """
        self.sense()
        self._exchange()
        self._decide()
        self._move()
        self._burn()
        self._completed += 1
        self._collect()

    def sense(self) -> None:
        """Read all sensors in the world as it is now; reading twice gives the same."""
        scene = self._current_scene()
        state = (self._completed, self.swarm.version, scene)
        if self._sensed == state and not self.swarm.disturbed:
            return
        self._engine.sense(self.swarm, scene, self._completed, self._noise_draws())
        if self._imperfect is not None:
            self._imperfect.spoil_readings(self.swarm, self._completed)
        self._sensed = state

    def run(self, steps: int, progress: bool = False) -> Self:
        """Take so many steps, fewer if the model stops running, and return the model.

        Parameters
        ----------
        steps : int
        progress : bool
            Whether to show a bar with the time left and the time of day at which it is done.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).run(3).steps
        3
        """
        with progress_bar(check_count("steps", steps), "steps", progress) as bar, self._observed_run():
            for _ in range(bar.total):
                if not self.running:
                    break
                self.step()
                bar.update()
        return self

    def _exchange(self) -> None:
        if self._channel is None:
            return
        loses = self._channel.radio.loss_probability > 0
        word = self.streams["communication"].integers(2**64, dtype=np.uint64) if loses else np.uint64(0)
        self._channel.exchange(self.swarm, self._current_scene(), word)

    def _decide(self) -> None:
        columns = self.swarm.columns
        command, layer = columns["command"], columns["layer"]
        if self._control is None:
            return
        columns["task"].fill(-1)
        columns["goal"].fill(np.nan)
        if self._senses is None or self._senses_version != self.swarm.version:
            self._senses = Senses.of(self.swarm)
            self._senses_version = self.swarm.version
        columns["last_command"][:] = command
        self._control.decide(self._senses, command, layer)
        wrong = limit_command(command, columns["max_speed"], columns["design"], self.swarm.table.sideways)
        if wrong >= 0:
            name = driver(self._control, int(layer[wrong]))
            raise BehaviourError(
                f"{name} commanded NaN to robot {self.swarm.agents[wrong].unique_id} in step {self.steps}; "
                "expected two finite wheel speeds"
            )
        if self._channel is not None:
            send_goals(columns["position"], columns["heading"], columns["goal"], columns["sent_goal"])

    def _move(self) -> None:
        scene, table = self._current_scene(), self.swarm.table
        for load in self._loads:
            load.rest()
        if not len(self.swarm):
            return
        if self.swarm.disturbed:
            self._engine.settle(self.swarm, scene)
            self.swarm.disturbed = False
        draws = self.streams["slip"].random((len(self.swarm), 2)) if table.slips else None
        if self._imperfect is None:
            self._engine.move(self.swarm, scene, self._turn_angle, draws)
            return
        with self._imperfect.driving(self.swarm, self._completed):
            self._engine.move(self.swarm, scene, self._turn_angle, draws)

    def _burn(self) -> None:
        if not self._burns:
            return
        if self._snapshots is not None:
            self._snapshots.note()
        columns, fires, c = self.swarm.columns, self.fires.columns, self.fire_constants
        scene = self._current_scene()
        went_out = burn(
            columns["position"],
            columns["radius"],
            scene.fires,
            fires["area"],
            (c.k1, c.k2, c.k3, c.k4, c.leave, c.join),
            self.extinguish_range,
            self.steps,
            fires["temperature"],
            fires["out"],
            fires["out_step"],
            fires["robots"],
            columns["temperature"],
            columns["heat"],
            columns["hot"],
            columns["fire"],
        )
        if went_out:
            scene.statics.mark_burning(~fires["out"])

    def _collect(self) -> None:
        self.collisions = int(np.count_nonzero(self.swarm.columns["collided"]))
        self.total_collisions += self.collisions
        history = self.fires.history
        if self._burns and history.every and self._completed % history.every == 0:
            fires = self.fires
            history.append(self.steps, fires.temperature, fires.robots, fires.out)
        if self._snapshots is not None and self._completed % self._snapshots.every == 0:
            self._snapshots.append(self._completed)
        if self._collect_every and self._completed % self._collect_every == 0:
            self.datacollector.collect(self)
        for observer in list(self.observers):
            observer.after_step(self, self._completed)

    # ---- small parts

    def _noise_draws(self) -> np.ndarray | None:
        """Return this step's draws for the sensors' errors, the same ones however often it is sensed."""
        if not self.swarm.table.noisy:
            return None
        shape, stream = self.swarm.distance.shape, self.streams["noise"]
        if self._noise is None or self._noise[0] != self._completed:
            self._noise = (self._completed, stream.bit_generator.state, None)
        step, before, draws = self._noise
        if draws is None or draws.shape != shape:
            # Robots may have come or gone since somebody looked: as if nobody had.
            stream.bit_generator.state = before
            draws = stream.random(shape)
            self._noise = (step, before, draws)
        return draws
