"""Continuing a run with other parameters, between two steps, without a recording."""

from collections.abc import Iterator
from typing import Any, TypeVar, cast

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, shortened, unknown_name
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.robots_part import role_of
from mesa_swarm.model.state import quick_fingerprint
from mesa_swarm.recording.attributes import own_attributes
from mesa_swarm.recording.provenance import parameters_of_run, provenance_of, rebuild_model
from mesa_swarm.recording.transfer import changed_settings, take_over
from mesa_swarm.robots.robot import Robot

Model = TypeVar("Model", bound=EngineModel)
# What a run changes of its fires: the other columns follow from the parameters.
OF_FIRES = ("temperature", "out", "out_step")


def continued(model: Model, /, **changes: object) -> Model:
    """Return a model that continues the run of another one with other parameters.

    A model is made with these, and takes over the state of the run, as by `resume`: the robots where they are, the
    memory of layers, random streams, counters. Its observers continue with it: a recording notes a change by hand.

    Parameters
    ----------
    model : EngineModel
        Between two steps; it is not to be used afterwards.
    **changes
        New values of the model's parameters.

    Raises
    ------
    InvalidValueError
        If a change would only have an effect from the first step of a run on, or makes another world.
    UnknownNameError
        If there is no such parameter.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> model = continued(Boids(rng=1).run(20), noise=0.1)
    >>> model.steps, model.given[1]["noise"]
    (20, 0.1)
    """
    parameters = parameters_of_run(model)
    odd = sorted(set(changes) - parameters.keys())
    if odd:
        raise UnknownNameError(unknown_name(f"parameter of {type(model).__name__}", odd[0], parameters))
    origin = provenance_of(model, rerun=True)
    new, fresh = rebuild_model(origin, type(model), **changes), rebuild_model(origin, type(model))
    continue_with(new, model, fresh, tuple(changes))
    return cast(Model, new)


def continue_with(new: EngineModel, old: EngineModel, fresh: EngineModel, names: tuple[str, ...]) -> None:
    """Continue the run of `old` with `new`, made with other values of the parameters of these names.

    `fresh` is `old` before its first step. A change that would have no effect, or another one than on a new run, is
    refused, and `old` is as it was.
    """
    if _differs_at_start(new, fresh) or _hidden_by_run(new, old, fresh):
        raise InvalidValueError(
            f"{shortened(' and '.join(names))} belongs to the beginning of a run; make a new model, or reset, with it"
        )
    take_over(new, old, fresh)
    hand_over(old, new, [f"parameter {name}" for name in names])


def match_robots(model: EngineModel, like: EngineModel) -> None:
    """Add robots at free places, or remove the last ones, until there are as many of each design and group as `like`.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> model = Boids(n_robots=20, rng=1).run(5)
    >>> match_robots(model, Boids(n_robots=22, rng=1))
    >>> len(model.run(5).robots)
    22
    """
    there, targets = _by_kind(model), _by_kind(like)
    model.remove_robots([robot for kind, robots in there.items() for robot in robots[len(targets.get(kind, ())) :]])
    for kind, robots in targets.items():
        lacking = len(robots) - len(there.get(kind, ()))
        if lacking > 0:
            model.add_robots(robots[0].design, lacking, group=robots[0].group)


def _by_kind(model: EngineModel) -> dict[tuple[str, str], list[Robot]]:
    """Return the robots by the name of their design and their group."""
    groups: dict[tuple[str, str], list[Robot]] = {}
    for robot in model.swarm.agents:
        groups.setdefault((robot.design.name, robot.group), []).append(robot)
    return groups


def hand_over(old: EngineModel, new: EngineModel, what: list[str]) -> None:
    """Let the observers of a model continue with another one, which differs in what is named."""
    observers, callees = list(old.observers), old.observers.complete
    old.observers = ()
    new.observers.extend(observers)
    for observer in callees:
        observer.replaced(old, new, what)


def _differs_at_start(new: EngineModel, fresh: EngineModel) -> bool:
    """Return whether the models begin in states that other parameters do not change any more."""
    mine, other = dict(_of_start(new)), dict(_of_start(fresh))
    # What only one of them has, such as the wear of imperfect robots, begins when it is added.
    return any(mine[name] != other[name] for name in mine.keys() & other.keys())


def _of_start(model: EngineModel) -> Iterator[tuple[tuple, bytes]]:
    """Yield the state at the beginning of a run, by name and shape."""
    tables = {"robots": model.swarm.columns, "fires": model.fires.columns}
    yield ("robots",), str(len(model.swarm)).encode()
    for name, column in tables.pop("robots").items():
        if role_of(name) == "state":
            yield (name, column.shape), column.tobytes()
    for prefix, table in tables.items():
        yield from (((prefix, name), table[name].tobytes()) for name in OF_FIRES)
    for body in model.displaced:
        yield ("body", body.unique_id), np.array(body.pose).tobytes()
    for name, field in model.fields.items():
        yield ("field", name, field.values.shape), field.values.tobytes()
    for name, value in model.parts.state.values.items():
        yield ("state", name), quick_fingerprint(value)


def _hidden_by_run(new: EngineModel, old: EngineModel, fresh: EngineModel) -> bool:
    """Return whether the parameters would change attributes or settings that the run has changed itself."""
    mine, now, first = map(own_attributes, (new, old, fresh))
    both = mine.keys() & now.keys() & first.keys()
    by_hand = changed_settings(old, fresh)
    return any(key in by_hand for key in changed_settings(new, fresh)) or any(
        _differ(mine[name], first[name]) and _differ(now[name], first[name]) for name in both
    )


def _differ(first: Any, second: Any) -> bool:
    return first is not second and quick_fingerprint(first) != quick_fingerprint(second)
