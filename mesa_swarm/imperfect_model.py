"""ImperfectModel: what makes robots imperfect, and the parameters for it that every model takes."""

import inspect
import os
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.mesa_model import GIVEN, declares, known_of_scenario, without_scenario
from mesa_swarm.open_model import OpenModel
from mesa_swarm.parameters import Dial, Noise, Slip
from mesa_swarm.physics.imperfect import Imperfect
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.imperfections import MEASURED, Imperfection, Imperfections, together
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.streams import Seed
from mesa_swarm.world.map import Map

# Half of its speed is what a slipping wheel loses.
SLIP_MAGNITUDE = 0.5
# Parameters of `ImperfectModel` that every model takes, whatever its constructor declares.
COMMON = ("noise", "slip", "imperfections")


class ImperfectModel(OpenModel):
    """A world whose robots may be imperfect; `EngineModel` adds the step.

    The constructor of every subclass takes `noise`, `slip` and `imperfections`, whether it declares them or not, and
    so do all programs that set parameters: sliders, jobs, sweeps, comparisons, `mesa.batch_run`. A subclass that
    declares one of these names has its own parameter of that name instead.

    Parameters
    ----------
    noise : float
        Relative error of every sensor: the reading x becomes x (1 + noise z), z from a normal distribution; 0 to 1.
    slip : float
        Probability, per wheel and step, that a wheel rolls at half its speed, 0 to 1.
    imperfections : float
        A place of the dial from ideal robots, 0, to `MEASURED`, 1. It adds to the other two.
    """

    _stored_apart: ClassVar[tuple[str, ...]] = ("_imperfect",)
    _sensed: tuple | None = None

    def __init_subclass__(cls, **named: Any) -> None:
        """Let the constructor of the class take the parameters that every model takes."""
        super().__init_subclass__(**named)
        # A class of several bases may inherit its constructor from one and a default of these parameters from another.
        if "__init__" in cls.__dict__ or len(cls.__bases__) > 1:
            cls.__init__ = _with_common(cls)  # type: ignore[method-assign]

    def __init__(
        self,
        *,
        map: str | os.PathLike | Map,
        rng: Seed,
        noise: Noise = 0.0,
        slip: Slip = 0.0,
        imperfections: Dial = 0.0,
        scale: Scale | None,
    ) -> None:
        given = {"noise": noise, "slip": slip, "imperfections": imperfections, **self.__dict__.pop("_common", {})}
        for name, value in given.items():
            if name == "imperfections" and isinstance(value, Imperfections):
                raise InvalidValueError(
                    f"imperfections is {shortened(value)}; expected a number from 0, ideal robots, to 1, MEASURED; "
                    "give an object to the model that was made: model.imperfections = Imperfections(...)"
                )
            check_number(name, value, minimum=0, maximum=1)
        super().__init__(map=map, rng=rng, scale=scale)
        self._imperfect: Imperfect | None = None
        disturbed = Imperfections(
            sensing=Imperfection(error=given["noise"]), slip_probability=given["slip"], slip_magnitude=SLIP_MAGNITUDE
        )
        found = together(MEASURED.at(given["imperfections"]), disturbed)
        if found is not None:
            self.imperfections = found

    @property
    def imperfections(self) -> Imperfections | None:
        """How the robots differ from ideal ones, or None; may be changed between steps.

        The parameters `noise`, `slip` and `imperfections` of a model set it; a value set later replaces all three.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel
        >>> from mesa_swarm.robots.imperfections import ROBOTARIUM
        >>> model = SwarmModel(noise=0.1, rng=1)
        >>> model.imperfections.sensing.error
        0.1
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
        self.swarm.drop_body_columns()
        self.swarm.battery_life = 0.0 if imperfections is None else float(imperfections.battery)
        if imperfections is not None:
            key = self.streams["imperfections"].integers(2**64, dtype=np.uint64)
            self._imperfect = Imperfect(imperfections, self.swarm, int(key))

    def prepare_failures(self) -> None:
        """Make what failures of single robots need, see `Robot.fail`."""
        if self._imperfect is None:
            self.imperfections = Imperfections()
        self.swarm.add_failures()

    def _equip(self, design: RobotDesign) -> None:
        if design.battery and self._imperfect is None:
            self.imperfections = Imperfections()


def _with_common(cls: type) -> Callable[..., None]:
    """Return the constructor of a class so that it takes the common parameters too, each as its bases do.

    Values of those that it does not declare skip it, and go to the next class that declares them.
    """
    constructor = _declared(cls.__dict__.get("__init__", cls.__init__))  # type: ignore[misc]
    signature = inspect.signature(constructor)
    missing = {name: _inherited(cls, name) for name in COMMON if name not in signature.parameters}

    @wraps(constructor)
    def extended(self: Any, *given: Any, **named: Any) -> None:
        if "scenario" in named and "scenario" not in signature.parameters:
            self.__dict__[GIVEN] = named["scenario"]
            if declares(type(self), "scenario"):
                named = known_of_scenario({*signature.parameters, *missing}, named)
            else:
                named = without_scenario(type(self), named)
        taken = {name: named.pop(name) for name in missing if name in named}
        common = {**taken, **self.__dict__.pop("_common", {})}  # what the outermost constructor is given counts
        replaced = {name: value for name, value in common.items() if name not in missing}
        if len(replaced) < len(common):
            self.__dict__["_common"] = {name: value for name, value in common.items() if name in missing}
        if replaced:
            bound = signature.bind_partial(self, *given, **named)
            bound.arguments.update(replaced)
            given, named = bound.args[1:], bound.kwargs
        constructor(self, *given, **named)

    extended.declared = constructor  # type: ignore[attr-defined]
    extended.__signature__ = _extended(signature, missing)  # type: ignore[attr-defined]
    return extended


def _declared(constructor: Callable[..., None]) -> Callable[..., None]:
    """Return a constructor as its class declares it, without the parameters that `_with_common` adds."""
    declared: Callable[..., None] = getattr(constructor, "declared", constructor)
    return declared


def _inherited(cls: type, name: str) -> inspect.Parameter:
    """Return a common parameter with the default and the annotation of the next class that declares it."""
    for base in cls.__mro__[1:]:
        known = _parameters(_declared(base.__dict__["__init__"])) if "__init__" in base.__dict__ else {}
        if name in known and known[name].default is not inspect.Parameter.empty:
            return known[name].replace(kind=inspect.Parameter.KEYWORD_ONLY)
    raise LookupError(name)  # never: `ImperfectModel` declares all of them


def _parameters(constructor: Callable[..., None]) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a constructor, with annotations that are not texts if they can be evaluated."""
    try:
        return inspect.signature(constructor, eval_str=True).parameters
    except Exception:  # annotations of a user's may be any expression
        return inspect.signature(constructor).parameters


def _extended(signature: inspect.Signature, more: dict[str, inspect.Parameter]) -> inspect.Signature:
    """Return a signature with more keyword parameters, before what takes all others."""
    own = list(signature.parameters.values())
    place = next((i for i, one in enumerate(own) if one.kind is one.VAR_KEYWORD), len(own))
    return signature.replace(parameters=[*own[:place], *more.values(), *own[place:]])
