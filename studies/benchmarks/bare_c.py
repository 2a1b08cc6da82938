"""A bare C program of the work of a step: compiled on this machine, and begun from the state of a model."""

import math
import shutil
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from mesa_swarm import DifferentialDrive, SwarmModel
from mesa_swarm.control import Avoid, Explore
from mesa_swarm.errors import InvalidValueError
from mesa_swarm_studies.benchmarks.goals import NotMeasuredError, output_of

SOURCE = "bare_swarm.c"
COMPILER, OPTIONS = "cc", ("-O3", "-march=native")
# Columns of the sensors' table: mount, axis, half angle and range, which the program reads; then rays.
SECTOR, RAYS = slice(0, 7), 7
ONLY = 0


class BareEnd(NamedTuple):
    """The swarm after the last step of the program: readings (n, s) of that step, and poses after it.

    `contacts` is how many robots were in contact after a step, in the mean.
    """

    distance: np.ndarray
    kind: np.ndarray
    position: np.ndarray
    heading: np.ndarray
    contacts: float


@dataclass(frozen=True, slots=True)
class BareProgram:
    """The compiled program: what a step of the peers' workload takes when nothing but its work is done."""

    path: Path

    @classmethod
    def compile_into(cls, folder: Path) -> "BareProgram":
        """Compile the program, and store it in a folder.

        Raises
        ------
        NotMeasuredError
            If there is no C compiler, or if it fails.
        """
        if shutil.which(COMPILER) is None:
            raise NotMeasuredError(f"there is no C compiler here: no program is named {COMPILER}")
        program = Path(folder, "bare_swarm")
        with resources.as_file(resources.files(__package__) / SOURCE) as source:
            output_of([COMPILER, *OPTIONS, str(source), "-o", str(program), "-lm"], f"the C compiler {COMPILER}")
        return cls(program)

    def time_steps(self, model: SwarmModel, steps: int, untimed: int = 0) -> float:
        """Return the seconds of processor time of a step, of a number of steps from the state of a model.

        `untimed` steps are taken before these.

        Raises
        ------
        NotMeasuredError
            If the program fails.
        InvalidValueError
            If the model is not one that `start_of` takes.
        """
        with TemporaryDirectory() as folder:
            nanoseconds, _ = self._run(model, Path(folder), untimed, steps)
        return 1e-9 * nanoseconds

    def end_of(self, model: SwarmModel, steps: int) -> BareEnd:
        """Return the swarm of a model after a number of steps, at least 1, of the program; the model does not change.

        Errors are those of `time_steps`.
        """
        swarm = model.swarm
        n, s = swarm.distance.shape
        with TemporaryDirectory() as folder:
            end = Path(folder, "end")
            _, contacts = self._run(model, Path(folder), 0, steps, str(end))
            distance, kind, pose = np.split(np.fromfile(end), [n * s, 2 * n * s])
        kinds, poses = kind.reshape(n, s).astype(np.int8), pose.reshape(n, 3)
        return BareEnd(distance.reshape(n, s), kinds, poses[:, :2], poses[:, 2], contacts)

    def _run(self, model: SwarmModel, folder: Path, untimed: int, steps: int, *end: str) -> tuple[float, float]:
        """Return what the program prints: nanoseconds a step, and robots in contact after it."""
        start = folder / "start"
        start.write_bytes(start_of(model))
        words = [str(self.path), str(start), str(untimed), str(steps), *end]
        nanoseconds, contacts = map(float, output_of(words, "the bare C program").split())
        return nanoseconds, contacts


def start_of(model: SwarmModel) -> bytes:
    """Return the state of a model as the program reads it, see `read_world` in its source.

    Raises
    ------
    InvalidValueError
        If the program does not do what robots of the model do.
    """
    _check_work(model)
    (design,), swarm = model.swarm.table.designs, model.swarm
    sensors = swarm.table.proximity[ONLY, :, SECTOR]
    discs = [(*body.position, body.shape.radius) for body in model.bodies]
    robots = np.column_stack([swarm.position, swarm.heading, swarm.columns["tendency"]])
    counts = [len(robots), len(sensors), len(discs), design.front, design.left, design.right]
    sizes = [*model.map.bounds, design.radius, design.max_speed, _avoided_distance(model)]
    numbers = [np.ravel(np.asarray(part, np.float64)) for part in (sizes, sensors, discs, robots)]
    return np.array(counts, np.int64).tobytes() + np.concatenate(numbers).tobytes()


def _check_work(model: SwarmModel) -> None:
    """Refuse a model whose robots do what the program does not."""
    table = model.swarm.table
    needed = {
        "robots of one design": len(table.designs) == 1,
        "DifferentialDrive()": all(design.drive == DifferentialDrive() for design in table.designs),
        "at most half a radius a step": all(2 * design.max_speed <= design.radius for design in table.designs),
        "wheels that do not slip": not table.slips and not table.slides,
        "sensors that read exactly, in every step": not (table.proximity[..., RAYS].any() or table.noisy or table.slow),
        "discs that stand": all(body.shape.is_disc and body.mode == "fixed" for body in model.bodies),
        "Subsumption(Avoid(distance=...), Explore())": not math.isnan(_avoided_distance(model)),
    }
    if not all(needed.values()):
        missing = ", ".join(what for what, is_so in needed.items() if not is_so)
        raise InvalidValueError(f"the bare C program does other work than this model; expected {missing}")


def _avoided_distance(model: SwarmModel) -> float:
    """Return the distance of Avoid in the control that the program has, NaN for any other control."""
    layers = tuple(getattr(model.control, "layers", ()))
    distance = getattr(layers[0], "distance", math.nan) if layers else math.nan
    is_it = not math.isnan(distance) and layers == (Avoid(distance=distance), Explore())
    return distance if is_it else math.nan
