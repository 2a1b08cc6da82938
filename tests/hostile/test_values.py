"""Wrong values for everything that takes values: each is accepted and works, or is refused in one line."""

import dataclasses
import inspect
import math
import warnings
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import mesa_swarm.control
from mesa_swarm import AGENT9, AGENT_FIRE, Radio, RobotDesign, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.control import Subsumption, VectorSum
from mesa_swarm.experiments.sampling import Sample
from mesa_swarm.fire.constants import design_constants
from mesa_swarm.learning import Evolution, Fitness, HebbianLearning, PolicyLayer, QLearning, QPolicy, WireFittedQ
from mesa_swarm.model.gallery import find_model, model_names
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.model.reporters import held
from mesa_swarm.robots.design import all_round
from mesa_swarm.robots.drive import DifferentialDrive, HolonomicDrive
from mesa_swarm.robots.imperfections import MEASURED, Imperfection, Imperfections
from mesa_swarm.robots.sensors import LineSensor, ProximitySensor, RadiationSensor, bump_sensor, laser_sensor
from mesa_swarm.searches.evolved_controllers import Trial
from mesa_swarm_studies.benchmarks.learn_bench import Benchmark
from support.hostile import attack

pytestmark = pytest.mark.slow


class Unfriendly:
    """What raises whatever is done with it."""

    def _refuse(self, *given):
        raise RuntimeError("a line\nand another")

    __float__ = __int__ = __index__ = __repr__ = __str__ = __array__ = _refuse


class Named:
    def __repr__(self):
        return "many\nlines " * 100


def endless():
    """Return a list that holds itself."""
    circle = []
    circle.append(circle)
    return circle


def nested(depth):
    found = []
    for _ in range(depth):
        found = [found]
    return found


WRONG = {
    "huge whole number": 10**400,
    "number too long to write": 10**5000,
    "negative huge": -(10**400),
    "NaN": math.nan,
    "infinity": math.inf,
    "minus infinity": -math.inf,
    "1e308": 1e308,
    "smallest": 5e-324,
    "minus zero": -0.0,
    "minus one": -1,
    "a half": 0.5,
    "two": 2,
    "true": True,
    "none": None,
    "text": "text",
    "number in text": "1",
    "no text": "",
    "lines": "a\nb\nc",
    "long text": "x" * 1_000_000,
    "null byte": "\0",
    "half a surrogate": "\udcff",
    "bytes": b"1",
    "complex": 1 + 2j,
    "Decimal": Decimal("0.5"),
    "huge Decimal": Decimal("1e400"),
    "signalling Decimal": Decimal("sNaN"),
    "Fraction": Fraction(1, 3),
    "huge Fraction": Fraction(10**400),
    "numpy integer": np.int64(2**62),
    "numpy byte": np.uint8(3),
    "numpy half": np.float16(np.inf),
    "numpy single": np.float32(0.25),
    "numpy long": np.longdouble("1e4000"),
    "numpy NaT": np.datetime64("NaT", "s"),
    "numpy scalar array": np.array(0.5),
    "numpy array of one": np.array([0.5]),
    "array": np.arange(3.0),
    "array of NaN": np.full((2, 2), np.nan),
    "array of objects": np.array([10**400, None], object),
    "list": [1, 2],
    "list of huge": [10**400, 10**400],
    "ragged list": [[1], [2, 3]],
    "nested list": nested(2000),
    "endless list": endless(),
    "tuple": (0.5, 0.5),
    "tuple of NaN": (math.nan, math.nan),
    "tuple of texts": ("a", "b"),
    "tuple of three": (10.0, 10.0, 10**400),
    "empty tuple": (),
    "dict": {"a": 1},
    "set": {1, 2},
    "generator": (x for x in range(2)),
    "class": int,
    "function": len,
    "object": object(),
    "unfriendly": Unfriendly(),
    "many lines": Named(),
    "class of a part": ProximitySensor,
}


def world(**settings):
    model = SwarmModel(map="openspace", rng=1, **settings)
    model.add_robots(AGENT_FIRE, poses=[(100, 100, 0.0), (115, 100, 1.0)])
    model.add_fire((300, 300), radius=20)
    model.add_load(disc((200, 100), 15), resistance=1.5)
    return model


def driven(layer):
    """Let a layer drive robots as their only one, and as one of two."""
    for control in (Subsumption(layer), VectorSum(layer)):
        model = SwarmModel(map="openspace", rng=1)
        drive = DifferentialDrive() if getattr(layer, "commands_wheels", True) else HolonomicDrive()
        model.add_robots(all_round(8, drive=drive), poses=[(100, 100, 0.0), (115, 100, 1.0)])
        model.control = control
        model.run(2)


def carried(sensor):
    built(dataclasses.replace(AGENT9, sensors=(sensor,)))


def built(design):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(design, poses=[(100, 100, 0.0), (300, 300, 1.0)])
    model.run(2)


def heard(radio):
    world(communication=radio).run(2)


def imperfect(imperfections):
    model = world()
    model.imperfections = imperfections
    model.run(2)


def burnt(constants):
    world(fire_constants=constants).run(2)


def added(shape):
    SwarmModel(map="openspace", rng=1).add_obstacle(shape)


# What is made, the arguments that it must have, and what is done with it.
LAYERS = [getattr(mesa_swarm.control, name) for name in mesa_swarm.control.__all__]
LAYERS = [layer for layer in LAYERS if dataclasses.is_dataclass(layer) and hasattr(layer, "decide")]
LEARNERS = [QLearning, WireFittedQ, HebbianLearning]
MODELS = [find_model(name) for name in model_names()]


def arguments(function):
    """Return the names of what a function or class takes."""
    listed = inspect.signature(function).parameters.items()
    return [name for name, each in listed if each.kind not in (each.VAR_KEYWORD, each.VAR_POSITIONAL)]


def ran(model):
    model.run(2)


def seeded(sample):
    sample.settings(find_model("fire_fighting"))


Subject = tuple[Callable, dict, Callable]
NOTHING = lambda made: None  # noqa: E731 - shorter than a function that does nothing
SUBJECTS: list[Subject] = [
    *((layer, {}, driven) for layer in (*LAYERS, *LEARNERS)),
    (PolicyLayer, {"policy": QPolicy.untrained(AGENT9, rng=np.random.default_rng(1)), "explore": True}, NOTHING),
    (Evolution, {"start": [0.5, 0.5], "sigma": 1.0, "population": 4, "seed": 1}, NOTHING),
    (Fitness, {}, NOTHING),
    (ProximitySensor, {}, carried),
    (RadiationSensor, {}, carried),
    (LineSensor, {}, carried),
    (laser_sensor, {}, carried),
    (bump_sensor, {}, carried),
    (all_round, {}, built),
    (RobotDesign, {}, built),
    (AGENT9.with_slip, {"probability": 0.1, "magnitude": 0.5}, built),
    (Radio, {}, heard),
    (Imperfection, {}, lambda one: imperfect(Imperfections(driving=one))),
    (Imperfections, {}, imperfect),
    (MEASURED.at, {"dial": 1}, imperfect),
    (Imperfection(error=0.5).at, {"dial": 1}, lambda one: imperfect(Imperfections(driving=one))),
    (design_constants, {}, burnt),
    (disc, {"centre": (100, 100), "radius": 5}, added),
    (rectangle, {"corner": (100, 100), "opposite": (200, 200)}, added),
    (polygon, {"outline": [(100, 100), (200, 100), (100, 200)]}, added),
    (Trial, {}, NOTHING),
    (Benchmark, {}, NOTHING),
    (Sample, {"kind": "sobol", "ranges": {"n_robots": (1, 2)}, "points": 2}, seeded),
    (held, {}, NOTHING),
    (SwarmModel, {"map": "openspace", "rng": 1}, ran),
    *((model, {"rng": 1}, ran) for model in MODELS),
]


def attempts(subjects):
    """Yield named inputs: each argument of each subject with each wrong value in its place."""
    for make, base, then in subjects:
        for argument in arguments(make):
            for name, value in WRONG.items():
                yield f"{make.__qualname__}({argument}={name})", (make, {**base, argument: value}, then)


def made(attempt):
    make, given, then = attempt
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one = make(**given)
        if dataclasses.is_dataclass(one):
            assert repr(one)
            assert one == dataclasses.replace(one)
        then(one)


# Attributes that may be set, of what is in a world.
SETTABLE = {
    "robots": ("position", "pos", "heading", "max_speed", "tendency", "temperature"),
    "loads": ("position", "resistance"),
    "fires": ("position", "temperature"),
    "obstacles": ("position", "pos"),
    "": ("fire_constants", "communication", "imperfections", "control"),
}


def assigned(attempt):
    """Set an attribute of something in a world, and let the world go on."""
    owner, name, value = attempt
    model = world()
    setattr(getattr(model, owner)[0] if owner else model, name, value)
    model.run(2)


def in_pose(value, place):
    return tuple(value if k == place else 50.0 for k in range(3))


CALLS = {
    "add_robots n": lambda model, value: model.add_robots(AGENT9, value),
    "add_robots design": lambda model, value: model.add_robots(value, 1),
    "add_robots poses": lambda model, value: model.add_robots(AGENT9, poses=value),
    "add_robots a pose": lambda model, value: model.add_robots(AGENT9, poses=[value]),
    "add_robots x": lambda model, value: model.add_robots(AGENT9, poses=[in_pose(value, 0)]),
    "add_robots y": lambda model, value: model.add_robots(AGENT9, poses=[in_pose(value, 1)]),
    "add_robots heading": lambda model, value: model.add_robots(AGENT9, poses=[in_pose(value, 2)]),
    "add_robots tendency": lambda model, value: model.add_robots(AGENT9, 1, tendency=value),
    "add_robots tendencies": lambda model, value: model.add_robots(AGENT9, 1, tendency=[value]),
    "add_obstacle": lambda model, value: model.add_obstacle(value),
    "add_load": lambda model, value: model.add_load(value, resistance=1.0),
    "add_load resistance": lambda model, value: model.add_load(disc((500, 500), 10), resistance=value),
    "add_fire": lambda model, value: model.add_fire(value, radius=10),
    "add_fire x": lambda model, value: model.add_fire((value, 100), radius=10),
    "add_fire radius": lambda model, value: model.add_fire((500, 500), radius=value),
    "add_fire area": lambda model, value: model.add_fire((500, 500), area=value),
    "add_fire radius and area": lambda model, value: model.add_fire((500, 500), radius=5, area=value),
    "add_fire temperature": lambda model, value: model.add_fire((500, 500), radius=5, temperature=value),
    "remove_robots": lambda model, value: model.remove_robots(value),
    "remove_robots one": lambda model, value: model.remove_robots([value]),
    "run": lambda model, value: model.run(value) if not isinstance(value, np.integer) else None,
    "position x": lambda model, value: setattr(model.robots[0], "position", (value, 100)),
    "agent_positions": lambda model, value: model.space.agent_positions.__setitem__(0, value),
    "robots near": lambda model, value: model.robots[0].get_neighbors_in_radius(value),
    "robots nearest": lambda model, value: model.robots[0].get_nearest_neighbors(value),
    "explain": lambda model, value: model.explain(value),
    "watch": lambda model, value: model.watch(value),
    "weights": lambda model, value: VectorSum(mesa_swarm.control.Avoid(), weights=value),
    "a weight": lambda model, value: VectorSum(mesa_swarm.control.Avoid(), weights=[value]),
    "layers": lambda model, value: Subsumption(value),
    "bound layers": lambda model, value: Subsumption(mesa_swarm.control.Avoid(), value),
    "beacons": lambda model, value: setattr(model, "communication", Radio(beacons=[(value, 1)])),
}


def called(attempt):
    name, value = attempt
    model = world()
    CALLS[name](model, value)
    model.run(2)


def set_by_text(attempt):
    parameter, text = attempt
    parameter.parse(text)


def set_by_value(attempt):
    parameter, value = attempt
    parameter.checked(value)


# What is tried with every wrong value: how, and with which inputs.
def _assigned():
    for owner, names in SETTABLE.items():
        for name in names:
            for wrong, value in WRONG.items():
                yield f"{owner}.{name} = {wrong}", (owner, name, value)


def _called():
    return ((f"{name}: {wrong}", (name, value)) for name in CALLS for wrong, value in WRONG.items())


def _set_by_value():
    for model in MODELS:
        for parameter in parameters_of(model).values():
            for wrong, value in WRONG.items():
                yield f"{model.__name__}.{parameter.name} = {wrong}", (parameter, value)


TEXTS = (
    "",
    "nan",
    "1e999",
    "-1e999",
    "9" * 400,
    "9" * 5000,
    "1_000",
    "0x10",
    "true",
    "None",
    "\0",
    "x" * 100_000,
    "a\nb",
)
TEXTS += ("1e308", "-0", "\u0663", "1" * 20, "1e15", "../../etc/passwd", "\udcff", "1,2", "[1]", "{}", " 5 ", "5.0")


def _set_by_text():
    for model in MODELS:
        for parameter in parameters_of(model).values():
            for text in TEXTS:
                yield f"{model.__name__}.{parameter.name} = {text[:20]!r}", (parameter, text)


KINDS = {
    "values: parts and constructors": (made, lambda: attempts(SUBJECTS)),
    "values: attributes": (assigned, _assigned),
    "values: methods": (called, _called),
    "values: parameters in files": (set_by_value, _set_by_value),
    "values: parameters as text": (set_by_text, _set_by_text),
}


@pytest.mark.parametrize("area", KINDS)
def test_a_wrong_value_is_refused_in_one_line_or_works(area, tally, amount):
    work, inputs = KINDS[area]
    listed = list(inputs())
    chosen = np.random.default_rng(1).permutation(len(listed))[: amount(60, len(listed))]
    model = world(communication=Radio(occlusion=True, loss_probability=0.5))
    model.imperfections = MEASURED
    model.run(2)  # compiles what many of them use
    # At first use a layer compiles its kernels, which takes some seconds.
    tally(area).add(attack(work, [listed[k] for k in sorted(chosen)], refusals=SwarmError, cpu=30, memory=900))
