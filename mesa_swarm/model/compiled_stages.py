"""Stages of a part of a user's own, made of functions of arrays that are compiled, as processes are."""

import inspect
from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any

import numpy as np

from mesa_swarm.base.errors import BehaviourError, InvalidValueError, SwarmError, UnknownNameError, unknown_name
from mesa_swarm.kernels.block import Block
from mesa_swarm.kernels.custom_functions import compile_custom
from mesa_swarm.kernels.custom_kernels import CHANCE, STEP, STREAM, kernel_of_function
from mesa_swarm.kernels.draws import Stream, stream_of
from mesa_swarm.kernels.part import Context, Kernel, Part, Phase, Stage
from mesa_swarm.model.process_rule import CHANGEABLE, lock_array
from mesa_swarm.robots.devices import extract_reason


def compiled_stage(
    context: Context,
    part: Part,
    phase: Phase,
    function: Callable[..., None],
    name: str,
    *,
    every: int = 1,
    **numbers: float,
) -> Stage:
    """Return a stage of a part that calls a function of arrays, compiled, so that `run` takes no step more slowly.

    Yield it from the `stages` of a part. The function is called with what its parameters name: columns and attributes
    of the part, arrays and numbers; columns of the swarm, such as `position`; `step`, the number of the step; `chance`,
    a number from 0 to 1 drawn from the stream of the part's name; `stream`, from which `draw_number` draws more; and
    the numbers that are given here.

    Parameters
    ----------
    context : Context
        That `bind` of the part was given.
    part : Part
    phase : Phase
    function : function
        It changes columns of the part in place; of those of the swarm temperature and tendency, others are locked.
    name : str
        A few words for `print(model.plan)`.
    every : int
        Steps from one call to the next.
    **numbers
        Further parameters of the function.

    Raises
    ------
    UnknownNameError
        If a parameter names nothing.
    InvalidValueError
        If it cannot be compiled; the message has the reason.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, Column, Part, Phase, SwarmModel
    >>> def add(command, driven):
    ...     for i in range(len(driven)):
    ...         driven[i] += abs(command[i, 0] + command[i, 1]) / 2
    >>> class Odometer(Part):
    ...     name = "odometer"
    ...
    ...     def __init__(self):
    ...         self.driven = np.zeros(0)
    ...
    ...     def bind(self, context):
    ...         self.context = context
    ...
    ...     def columns(self):
    ...         return {"driven": Column(self.driven, "robots")}
    ...
    ...     def stages(self):
    ...         yield compiled_stage(self.context, self, Phase.PROCESS, add, "adds up ways")
    >>> model = SwarmModel(rng=1)
    >>> odometer = model.add_part(Odometer())
    >>> robots = model.add_robots(AGENT9, 2)
    >>> model.run(3).parts["odometer"].driven
    array([0., 0.])
    """
    function = getattr(function, "py_func", function)
    if not isinstance(function, FunctionType):
        raise InvalidValueError(f"stage {name} of part {part.name} got {function!r:.60}; expected a function of arrays")
    takes = tuple(inspect.signature(function).parameters)
    known = {**_arrays_of(context.model, part), **numbers}
    for parameter in takes:
        if parameter not in (*known, STEP, CHANCE, STREAM):
            raise UnknownNameError(unknown_name(f"parameter of {function.__name__}", parameter, sorted(known)))
    values = {parameter: known[parameter] for parameter in takes if parameter not in (STEP, CHANCE, STREAM)}
    for parameter, value in values.items():
        if isinstance(value, np.ndarray) and not value.flags.c_contiguous:
            cure = f"set it to np.ascontiguousarray({parameter})"
            raise InvalidValueError(f"{parameter} of part {part.name} is not in C order in memory; {cure}")
    made = kernel_of_function(function, takes, values)
    if made.code is None:
        raise InvalidValueError(f"stage {name} of part {part.name} cannot be compiled: {extract_reason(made.problem)}")
    draws = {CHANCE, STREAM} & set(takes)
    stream = stream_of(context.streams[part.name]) if draws else Stream(0, 0)
    block = Block(made.arrays(*values.values(), stream))
    fail = partial(_fail, context.model, part, name, function, takes, values)
    kernel = Kernel(made.code, block.numbers, block, fail)
    return Stage(phase, partial(_run, context.model, kernel), name, kernel, every)


def _arrays_of(model: Any, part: Part) -> dict[str, Any]:
    """Return columns of the swarm, and attributes and columns of a part, by name."""
    of_swarm = model.swarm.columns.items()
    swarm = {name.replace(".", "_"): array if name in CHANGEABLE else lock_array(array) for name, array in of_swarm}
    attributes = {name: value for name, value in vars(part).items() if isinstance(value, (int, float, np.ndarray))}
    return {**swarm, **attributes, **{name: column.array for name, column in part.columns().items()}}


def _run(model: Any, kernel: Kernel) -> None:
    kernel.run(model.steps, len(model.swarm))


def _fail(model: Any, part: Part, name: str, function: Any, takes: tuple[str, ...], values: dict, code: int) -> None:
    """Raise the error of the function, which is called once more for it."""
    stream = stream_of(model.streams[part.name])
    special = {STEP: int(model.steps), CHANCE: 0.5, STREAM: stream}
    try:
        compile_custom(function)(*[values.get(parameter, special.get(parameter)) for parameter in takes])
    except SwarmError:
        raise
    except Exception as error:
        problem = " ".join(f"{type(error).__name__}: {error}".split())
        raise BehaviourError(f"{name} ({part.name}) failed in step {model.steps}: it raised {problem}") from error
    raise BehaviourError(f"{name} ({part.name}) failed in step {model.steps}: it raised an error")
