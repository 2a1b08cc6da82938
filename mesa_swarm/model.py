"""SwarmModel: a Mesa model of robots in a world, and its step, written once."""

import os
from hashlib import blake2b

import mesa
import numpy as np
from tqdm.auto import tqdm

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import BehaviourError, InvalidValueError, check_choice, check_count, check_number
from mesa_swarm.fire.burning import burn
from mesa_swarm.fire.constants import FireConstants, design_constants
from mesa_swarm.physics.contacts import Contacts
from mesa_swarm.physics.engine import CompiledEngine, Engine
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.robots.drive import limit_command
from mesa_swarm.world.map import Map
from mesa_swarm.world_model import World

ENGINES: dict[str, type[Engine]] = {"compiled": CompiledEngine, "shapely": ShapelyEngine}
# Indices that depend on the order in which things were created say nothing of the state.
NOT_HASHED = frozenset({"number", "design", "contact_index"})


class SwarmModel(World):
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
    model_reporters, agent_reporters : dict, optional
        More of what Mesa's DataCollector collects after every step, besides `collisions` and
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
        rng=None,
        engine: str = "compiled",
        turn_angle_degrees: float = 60.0,
        fire_constants: FireConstants | None = None,
        extinguish_range: float = 10.0,
        history_every: int = 1,
        model_reporters: dict | None = None,
        agent_reporters: dict | None = None,
    ) -> None:
        self._turn_angle = np.radians(check_number("turn_angle_degrees", turn_angle_degrees, minimum=0, maximum=90))
        self.extinguish_range = check_number("extinguish_range", extinguish_range, minimum=0, maximum=1e9)
        self._engine: Engine = ENGINES[check_choice("engine", engine, ENGINES)]()
        super().__init__(map=map, rng=rng, history_every=history_every)
        self.fire_constants = design_constants() if fire_constants is None else fire_constants
        self.collisions = 0
        self.total_collisions = 0
        self._control = None
        self._senses: Senses | None = None
        self._senses_version = -1
        self._completed = 0
        self._sensed: tuple | None = None
        self._noise: tuple | None = None
        reporters = {"collisions": "collisions", "total_collisions": "total_collisions"}
        self.datacollector = mesa.DataCollector(
            model_reporters={**reporters, **(model_reporters or {})}, agent_reporters=agent_reporters
        )

    @property
    def fire_constants(self) -> FireConstants:
        """The constants of the fires and of the heat in robots; may be changed between steps."""
        return self._fire_constants

    @fire_constants.setter
    def fire_constants(self, constants: FireConstants) -> None:
        if not isinstance(constants, FireConstants):
            raise InvalidValueError(f"fire_constants is {constants!r:.60}; expected what design_constants() returns")
        self._fire_constants = constants

    @property
    def control(self):
        """What drives the robots: an arbiter such as `Subsumption`, or None."""
        return self._control

    @control.setter
    def control(self, control) -> None:
        if control is not None and (isinstance(control, type) or not hasattr(control, "bound")):
            raise InvalidValueError(
                f"control is {control!r:.60}; expected an arbiter such as Subsumption(Avoid(), Explore())"
            )
        self.swarm.forget()
        self.swarm.columns["command"].fill(0.0)
        self.swarm.columns["layer"].fill(-1)
        self._control = None if control is None else control.bound(self.swarm, self.streams)

    # ---- the step

    def step(self) -> None:
        """Advance the world by one step.

        ==========  ================================================  ===========================================
        phase       reads                                             writes
        ==========  ================================================  ===========================================
        sense       position, heading, obstacles, fires               distance, kind, radiation, line
        decide      what robots know (`control.Senses`)               command, layer
        move        command, loads                                    loads, position, heading
        resolve     position, obstacles, fires                        position, heading, slip, collided, contacts
        burn        position                                          fires' temperature, robots' temperature, fire
        collect     everything                                        datacollector, history
        ==========  ================================================  ===========================================

        Every robot acts on what was published after the previous step; nothing depends on their order.
        """
        self.sense()
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
        self._sensed = state

    def run(self, steps: int, progress: bool = False) -> "SwarmModel":
        """Take so many steps, fewer if the model stops running, and return the model.

        Parameters
        ----------
        steps : int
        progress : bool
            Whether to show a bar with the time left.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).run(3).steps
        3
        """
        for _ in tqdm(range(check_count("steps", steps)), disable=not progress, unit="step"):
            if not self.running:
                break
            self.step()
        return self

    def _decide(self) -> None:
        columns = self.swarm.columns
        command, layer = columns["command"], columns["layer"]
        if self._control is None:
            return
        if self._senses_version != self.swarm.version:
            self._senses = Senses.of(self.swarm)
            self._senses_version = self.swarm.version
        self._control.decide(self._senses, command, layer)
        wrong = limit_command(command, columns["max_speed"])
        if wrong >= 0:
            name = self._control.layers[layer[wrong]].name if layer[wrong] >= 0 else "no layer"
            raise BehaviourError(
                f"{name} commanded NaN to robot {self.swarm.agents[wrong].unique_id} in step {self.steps}; "
                "expected two finite wheel speeds"
            )

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
        self._engine.move(self.swarm, scene, self._turn_angle, draws)

    def _burn(self) -> None:
        if not self._burns:
            return
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
        self.datacollector.collect(self)

    # ---- what one reads after the step

    @property
    def contacts(self) -> "Contacts":
        """The deepest contact of every robot that collided in the last step."""
        return Contacts.of(self.swarm, self._obstacles, self.fires.agents)

    def state_hash(self) -> str:
        """Return a fingerprint of the published state: equal for equal runs, on every machine and Python.

        All sensors are read first, so that having looked at the readings or not makes no difference.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> SwarmModel(rng=1).state_hash() == SwarmModel(rng=1).state_hash()
        True
        """
        self.sense()
        digest = blake2b(digest_size=16)
        digest.update(f"{self._completed}".encode())
        for load in self._loads:
            digest.update(np.array([*load.pose, load.resistance]))
        for prefix, columns in (("robots", self.swarm.columns), ("fires", self.fires.columns)):
            for name, column in sorted(columns.items()):
                if name not in NOT_HASHED:
                    digest.update(f"{prefix}.{name} {column.shape}".encode())
                    digest.update(np.ascontiguousarray(column + 0 if column.dtype.kind == "f" else column))
        return digest.hexdigest()

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
