"""Parameters that every model takes, whatever its constructor declares."""

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

from mesa_swarm.model.mesa_model import GIVEN, declares, parameters_of_scenario, without_scenario

# Parameters of the base that each class shows as its own, with a slider.
COMMON = ("noise", "slip", "imperfections")
# Parameters that each class takes as well, without showing them: how a model is computed, collected and described.
ALSO = (
    *("engine", "threads", "turn_angle_degrees", "collect_every", "history_every", "communication", "scale"),
    *("fire_constants", "extinguish_range", "model_reporters", "agent_reporters"),
)


def with_common(cls: type, shows_all: bool = False) -> Callable[..., None]:
    """Return the constructor of a class so that it takes the common parameters too, each as its bases do.

    Values of those that it does not declare skip it, and go to the next class that declares them. Its signature has
    those of `COMMON`, and with `shows_all` the others too.
    """
    constructor = _find_original(cls.__dict__.get("__init__", cls.__init__))  # type: ignore[misc]
    signature = inspect.signature(constructor)
    inherited = {name: _find_inherited(cls, name) for name in (*COMMON, *ALSO) if name not in signature.parameters}
    additions = {name: parameter for name, parameter in inherited.items() if parameter is not None}
    visible = {name: parameter for name, parameter in additions.items() if shows_all or name in COMMON}

    @wraps(constructor)
    def extended(self: Any, *arguments: Any, **keywords: Any) -> None:
        if "scenario" in keywords and "scenario" not in signature.parameters:
            self.__dict__[GIVEN] = keywords["scenario"]
            if declares(type(self), "scenario"):
                keywords = parameters_of_scenario({*signature.parameters, *additions}, keywords)
            else:
                keywords = without_scenario(type(self), keywords)
        settings = {name: keywords.pop(name) for name in additions if name in keywords}
        common = {**settings, **self.__dict__.pop("_common", {})}  # what the outermost constructor is given counts
        overrides = {name: value for name, value in common.items() if name not in additions}
        if len(overrides) < len(common):
            self.__dict__["_common"] = {name: value for name, value in common.items() if name in additions}
        if overrides:
            binding = signature.bind_partial(self, *arguments, **keywords)
            binding.arguments.update(overrides)
            arguments, keywords = binding.args[1:], binding.kwargs
        constructor(self, *arguments, **keywords)

    extended.declared = constructor  # type: ignore[attr-defined]
    extended.whole = _extend_signature(signature, additions)  # type: ignore[attr-defined]
    extended.__signature__ = _extend_signature(signature, visible)  # type: ignore[attr-defined]
    return extended


def _find_original(constructor: Callable[..., None]) -> Callable[..., None]:
    """Return a constructor as its class declares it, without the parameters that `with_common` adds."""
    declared: Callable[..., None] = getattr(constructor, "declared", constructor)
    return declared


def whole_signature(model_class: Any) -> inspect.Signature:
    """Return the signature of a class with all parameters that it takes, those of `ALSO` too, without `self`."""
    whole: inspect.Signature | None = getattr(model_class.__init__, "whole", None)
    if whole is None:
        return inspect.signature(model_class)
    return whole.replace(parameters=list(whole.parameters.values())[1:])


def _find_inherited(cls: type, name: str) -> inspect.Parameter | None:
    """Return a common parameter with the default and the annotation of the next class that declares it."""
    for base in cls.__mro__[1:]:
        parameters = _parameters(_find_original(base.__dict__["__init__"])) if "__init__" in base.__dict__ else {}
        if name in parameters and parameters[name].default is not inspect.Parameter.empty:
            return parameters[name].replace(kind=inspect.Parameter.KEYWORD_ONLY)
    return None  # of fires, in a class without them


def _parameters(constructor: Callable[..., None]) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of a constructor, with annotations that are not texts if they can be evaluated."""
    try:
        return inspect.signature(constructor, eval_str=True).parameters
    except Exception:  # annotations of a user's may be any expression
        return inspect.signature(constructor).parameters


def _extend_signature(signature: inspect.Signature, more: dict[str, inspect.Parameter]) -> inspect.Signature:
    """Return a signature with more keyword parameters, before what takes all others."""
    present = list(signature.parameters.values())
    place = next((i for i, p in enumerate(present) if p.kind is p.VAR_KEYWORD), len(present))
    return signature.replace(parameters=[*present[:place], *more.values(), *present[place:]])
