"""Controllers from outside: saved policies, ONNX graphs, Stable-Baselines3's learners, functions of observations."""

import inspect
import json
import os
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mesa_swarm.base.errors import (
    LONGEST_NAME,
    BehaviourError,
    InvalidValueError,
    LearningError,
    SwarmError,
    check_name,
    error_line,
    shortened,
    without_middle,
)
from mesa_swarm.base.extras import require_extra
from mesa_swarm.base.files import show_path
from mesa_swarm.base.streams import Seed
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.environments.task import Task
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.experiments.fingerprints import files_hash
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.learning.actions import ACTIONS, describe_value
from mesa_swarm.learning.fire_learning import LearnFires, SkillPolicy
from mesa_swarm.learning.fire_wheels import FireWheelPolicy, LearnFireWheels
from mesa_swarm.learning.onnx_files import OnnxPolicy, is_own, onnx_session
from mesa_swarm.learning.policy import Policy, PolicyLayer
from mesa_swarm.learning.policy_files import load_policy, unreadable_archive
from mesa_swarm.model.gallery import is_address, object_at
from mesa_swarm.world.arena import pause_collection

Act = Callable[[np.ndarray], np.ndarray]
OfFires = TypeVar("OfFires", SkillPolicy, FireWheelPolicy)
# A temperature at which the best of two values is always chosen.
COLDEST = 1e-12
FORMS = "file.npz, file.onnx, sb3.zip, package.module:callable or ./file.py:callable"
# The algorithm of Stable-Baselines3 by the module of its policies.
ALGORITHMS = {"sac": "SAC", "td3": "TD3", "dqn": "DQN"}
# Parts and settings that every file of Stable-Baselines3 has: what lacks one is never given to it.
SB3_PARTS = ("data", "policy.pth", "_stable_baselines3_version")
SB3_SETTINGS = ("policy_class", "observation_space", "action_space")
# It packs files without compressing them, and its settings are a few kB of JSON, which take 20 times as much memory.
MOST_PARTS, MOST_TIMES, LARGEST_SB3, LARGEST_DATA = 64, 100, 1 << 30, 1 << 23


@dataclass(frozen=True, kw_only=True, slots=True)
class Controller:
    """A controller that a benchmark can drive robots by: an arbiter, or a function of observations.

    Parameters
    ----------
    name : str
        Of its row in tables.
    control : Arbiter, optional
        Drives all robots of a world, as in ``TaskWorld(task=task, control=controller.control)``.
    make : callable, optional
        Returns a new function of observations, for one world; see `actor`.
    width : int, optional
        How many observations of a robot it takes, None if that is not known.

    Raises
    ------
    InvalidValueError
        If it has neither or both of `control` and `make`.

    Examples
    --------
    >>> ahead = Controller(name="ahead", make=lambda: lambda seen: np.ones((len(seen), 2)))
    >>> ahead.actor("continuous")(np.zeros((1, 9), np.float32))
    array([[1., 1.]])
    """

    name: str
    control: Arbiter | None = None
    make: Callable[[], Act] | None = None
    width: int | None = None

    def __post_init__(self) -> None:
        check_name("name", self.name)
        if (self.control is None) == (self.make is None):
            raise InvalidValueError(f"controller {self.name}: expected either a control or a make")

    def actor(self, actions: str | int, numbers: int = 2) -> Act:
        """Return a function of observations for one world.

        Parameters
        ----------
        actions : "continuous", 4 or 8
            Of the task, ``task.actions``.
        numbers : int
            How many numbers a continuous action of the task has, ``task.numbers``.

        Returns
        -------
        callable
            Takes observations, float32 (n, width), and returns actions: numbers (n, `numbers`) from -1 to 1, larger
            ones cut off, or, where they are numbered, whole numbers (n,). Where a continuous action is two wheel
            speeds, a controller may return whole numbers (n,) from 0 to 7 as well, those of the thesis's actions
            (8.1). It raises `BehaviourError` if the controller fails or returns anything else, and `InvalidValueError`
            if it takes another number of observations.

        Raises
        ------
        InvalidValueError
            If it is driven by `control`.
        """
        if self.make is None:
            raise InvalidValueError(f"{self.name} has no function of observations; drive robots by its control")
        act = self.make()

        def checked(observations: np.ndarray) -> np.ndarray:
            width = observations.shape[1]
            if self.width not in (None, width):
                raise InvalidValueError(
                    f"{self.name} takes {self.width} observations of a robot and the task has {width}; use the task, "
                    "encoding and design that it was trained with"
                )
            try:
                returned = act(observations)
            except SwarmError:
                raise
            except (Exception, SystemExit) as error:  # foreign code may raise anything
                raise BehaviourError(without_middle(f"{self.name} failed: {error_line(error)}")) from error
            found = _actions_of(returned, len(observations), actions, numbers)
            if found is None:
                raise BehaviourError(
                    without_middle(
                        f"{self.name} returned {describe_value(returned)} for {len(observations)} robots; expected "
                        f"{_wanted(actions, numbers)}"
                    )
                )
            return found

        return checked


def played(controller: Controller | Arbiter, task: Task, rng: Seed) -> dict[str, float]:
    """Drive all robots of a task's world by a controller for an episode; return what `TaskWorld.play` returns."""
    driver = Controller(name="control", control=controller) if isinstance(controller, Arbiter) else controller
    if driver.control is None:
        return TaskWorld(task=task, rng=rng).play(driver.actor(task.actions, task.numbers))
    return TaskWorld(task=task, rng=rng, control=driver.control).play()


def _wanted(actions: str | int, numbers: int) -> str:
    """Return in words what a controller has to return."""
    if not isinstance(actions, str):
        return f"whole numbers (n,) from 0 to {actions - 1}"
    return f"finite numbers (n, {numbers})" + (f", or whole numbers (n,) from 0 to {len(ACTIONS) - 1}" * (numbers == 2))


def _actions_of(returned: object, robots: int, actions: str | int, numbers: int) -> np.ndarray | None:
    """Return actions as an array for this number of robots, None if they are anything else."""
    try:
        array = fill_masked(returned)
    except ValueError:  # rows of different lengths
        return None
    if isinstance(actions, str):
        if array.dtype.kind in "iuf" and array.shape == (robots, numbers) and np.isfinite(array).all():
            return np.clip(array.astype(np.float64), -1.0, 1.0)
        return ACTIONS[array] if numbers == 2 and _are_numbered(array, robots, len(ACTIONS)) else None
    return array if _are_numbered(array, robots, actions) else None


def _are_numbered(array: np.ndarray, robots: int, count: int) -> bool:
    """Return whether an array has the number of an action, 0 to `count` - 1, for each robot."""
    return array.dtype.kind in "iu" and array.shape == (robots,) and bool(((array >= 0) & (array < count)).all())


def load_controller(spec: str | os.PathLike[str], *, greedy: bool = False) -> Controller:
    """Return the controller in a file, or of a module.

    Parameters
    ----------
    spec : str or Path
        - ``file.npz``, of `save_policy`, and ``file.onnx``, of `export_onnx`: drive robots by their readings.
        - Any other ``file.onnx``: a graph whose first input is (n, width) and whose first output is (n, k), or (n,)
          whole numbers, such as PyTorch's export of a policy.
        - ``file.zip``, of Stable-Baselines3 (PPO, A2C, SAC, TD3, DQN): acts without random choices. Loading one can
          run code that it contains: load only files that you trust.
        - ``package.module:name`` or ``./file.py:name``: an arbiter, a function of observations (n, width), or a class
          without arguments, which is made anew for each world, so that it can remember; it is called, or has a method
          ``act``.
    greedy : bool
        Whether policies of `save_policy` and `export_onnx` always take their best action.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError
        If there is no such file, module or name, or it is not a controller.
    SwarmError
        If a package is missing; the error gives the command that installs it.

    Examples
    --------
    >>> load_controller("math:hypot").name
    'math:hypot'
    """
    if not isinstance(spec, str | os.PathLike):
        raise InvalidValueError(f"the controller is {shortened(spec)}; expected {FORMS}")
    text = os.fspath(spec)
    load = LOADERS.get(Path(text).suffix) if isinstance(text, str) else None
    if load is not None:
        return load(Path(text), greedy)
    if is_address(text):
        return _of_address(text)
    raise InvalidValueError(f"the controller is {shortened(text)}; expected {FORMS}")


def content_of(address: str) -> str:
    """Return a fingerprint of a controller from outside: of its own file, or of the module where it is written.

    Modules that are part of the interpreter have none; their fingerprint is empty.
    """
    if not is_address(address):
        return files_hash([Path(address)])
    found = object_at(address)
    module = inspect.getmodule(found if hasattr(found, "__module__") else type(found))
    file = getattr(module, "__file__", None)
    return files_hash([Path(file)]) if file else ""


def control_of(policy: Policy | SkillPolicy | FireWheelPolicy, *, greedy: bool = False) -> Arbiter:
    """Return a control by which a policy drives robots frozen: skills below `Avoid`, all others alone.

    Parameters
    ----------
    policy : Policy, SkillPolicy or FireWheelPolicy
    greedy : bool
        Whether it always takes its best action.

    Raises
    ------
    InvalidValueError, LearningError
        If it is not a policy, or untrained.
    """
    if isinstance(policy, SkillPolicy):
        return Subsumption(Avoid(fires="never"), LearnFires(start=_cold(policy, greedy), frozen=True))
    if isinstance(policy, FireWheelPolicy):
        return Subsumption(LearnFireWheels(start=_cold(policy, greedy), frozen=True))
    return Subsumption(PolicyLayer(policy=policy, greedy=greedy))


def _cold(policy: OfFires, greedy: bool) -> OfFires:
    return replace(policy, temperature=COLDEST) if greedy else policy


def _of_npz(file: Path, greedy: bool) -> Controller:
    policy: Any = load_policy(file)
    return Controller(name=_short_name(file), control=control_of(policy, greedy=greedy))


def _of_onnx(file: Path, greedy: bool) -> Controller:
    session = onnx_session(file)
    if is_own(session):
        policy: Any = OnnxPolicy.of(session, show_path(file))
        return Controller(name=_short_name(file), control=Subsumption(PolicyLayer(policy=policy, greedy=greedy)))
    inputs = session.get_inputs()
    shape = list(inputs[0].shape or ()) if len(inputs) == 1 else []
    if len(shape) != 2 or inputs[0].type != "tensor(float)" or isinstance(shape[0], int):
        found = ", ".join(f"{value.name} {value.type} {value.shape}" for value in inputs)
        raise LearningError(
            without_middle(
                f"{show_path(file)} has the inputs {found}; expected one of float32 (n, width), with any n: export "
                "it with a dynamic first axis"
            )
        )
    name, output = inputs[0].name, session.get_outputs()[0].name

    def act(observations: np.ndarray) -> np.ndarray:
        return np.asarray(session.run([output], {name: observations.astype(np.float32, copy=False)})[0])

    return Controller(name=_short_name(file), make=lambda: act, width=shape[1] if isinstance(shape[1], int) else None)


def _of_sb3(file: Path, greedy: bool) -> Controller:
    algorithm = algorithm_of(file)
    require_extra("stable_baselines3", "sb3", f"{show_path(file)} needs", "stable-baselines3")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other versions of packages
            model = getattr(import_module("stable_baselines3"), algorithm).load(file, device="cpu")
    except (Exception, SystemExit) as error:  # pickles raise anything
        text = f"{show_path(file)} cannot be loaded as {algorithm}: {error_line(error)}"
        raise LearningError(without_middle(text)) from None
    shape: Any = model.observation_space.shape
    if shape is None or len(shape) != 1:
        raise LearningError(f"{show_path(file)} takes observations of shape {shape}; expected (width,)")

    def act(observations: np.ndarray) -> np.ndarray:
        return np.asarray(model.predict(observations, deterministic=True)[0])

    return Controller(name=_short_name(file), make=lambda: act, width=shape[0])


def algorithm_of(file: Path) -> str:
    """Return which algorithm of Stable-Baselines3 saved a file, without running code that it contains.

    Raises
    ------
    LearningError
        If the file is missing or not one of its files, or unpacks to far more than it takes on disk.
    """
    try:
        if why := unreadable_archive(file, LARGEST_SB3):
            raise ValueError(why)
        saved = _settings_of(file)
        module = str(saved["policy_class"]["__module__"])
    except FileNotFoundError:
        raise LearningError(f"there is no file {show_path(file)}; expected one that Stable-Baselines3 saved") from None
    except LearningError:
        raise
    except Exception as error:  # zip, zlib and JSON raise many kinds
        why = str(error) if type(error) is ValueError else f"it is damaged ({type(error).__name__})"
        text = f"{show_path(file)} is not a file that Stable-Baselines3 saved: {why}"
        raise LearningError(without_middle(text)) from None
    known = next((name for part, name in ALGORITHMS.items() if f".{part}." in module), None)
    return known or ("PPO" if "clip_range" in saved else "A2C")


def _settings_of(file: Path) -> dict:
    """Return the settings in a file of Stable-Baselines3; sizes are checked before anything is unpacked."""
    with zipfile.ZipFile(file) as archive:
        members = {member.filename: member for member in archive.infolist()}
        if missing := [name for name in SB3_PARTS if name not in members]:
            raise ValueError(f"it has no {missing[0]}")
        if len(members) > MOST_PARTS or len(members) < len(archive.infolist()):
            raise ValueError(f"it has more than {MOST_PARTS} parts, or two of one name")
        unpacked, packed = sum(member.file_size for member in members.values()), file.stat().st_size
        if unpacked > min(LARGEST_SB3, MOST_TIMES * packed) or members["data"].file_size > LARGEST_DATA:
            raise ValueError(f"its {packed:,} bytes unpack to {unpacked:,}, or its settings to more than a few MB")
        if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members.values()):
            raise ValueError("it is compressed by another method")
        with pause_collection():  # of objects of which there may be millions
            saved = json.loads(archive.read("data"))
    if not isinstance(saved, dict) or not all(isinstance(saved.get(name), dict) for name in SB3_SETTINGS):
        raise ValueError(f"its settings have no {', '.join(SB3_SETTINGS)}")
    return saved


def _of_address(address: str) -> Controller:
    found = object_at(address)
    if isinstance(found, Arbiter):
        return Controller(name=_short_name(address), control=found)
    if not callable(found):
        raise InvalidValueError(
            without_middle(
                f"{address} is {shortened(found)}; expected a function of observations, a class or an arbiter"
            )
        )
    make = partial(_made, address, found) if inspect.isclass(found) else lambda: found
    return Controller(name=_short_name(address), make=make)


def _short_name(spec: str | Path) -> str:
    """Return the name of a controller: without the folders, which differ between machines and may be long."""
    return without_middle(Path(spec).name, LONGEST_NAME)


def _made(address: str, kind: type) -> Act:
    """Return the function of a new object of a class."""
    try:
        made: Any = kind()
    except (Exception, SystemExit) as error:  # foreign code may raise anything
        raise BehaviourError(without_middle(f"{address} cannot be made: {error_line(error)}")) from error
    act = getattr(made, "act", made)
    if not callable(act):
        raise InvalidValueError(f"{address} has no method act and cannot be called; give the class one of them")
    return act


LOADERS: dict[str, Callable[[Path, bool], Controller]] = {".npz": _of_npz, ".onnx": _of_onnx, ".zip": _of_sb3}
