"""The plan of a step: all stages in their order."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from mesa_swarm.kernels.part import Part, Phase, Stage


class Plan(NamedTuple):
    """The stages of a step, in the order of phases, and within a phase of parts.

    Parameters
    ----------
    stages : tuple of (str, Stage)
        Each with the name of its part.
    version : tuple
        Of the robots' columns, and the scene of bodies, for which it was made.
    calls, collecting : tuples of callables
        What a step calls before it is counted as completed, and afterwards.
    besides : tuple of str
        What in Python each step calls besides its stages: the `step` of a class, observers, a data collector.

    Examples
    --------
    >>> from mesa_swarm.model.engine_model import EngineModel
    >>> print(EngineModel(rng=1).plan)
    phase    part       what                                    how
    sense    robots     robots read their sensors               compiled: sense_proximity; Python: no proximity sensors
    move     bodies     driven bodies begin their ways          compiled: run_in_turn
    move     robots     robots move, and contacts are resolved  compiled: travel_pieces; Python: no robots
    resolve  bodies     bodies rest, and are carried along      compiled: run_in_turn
    process  fields     fields diffuse and evaporate            compiled: advance_fields
    process  processes  processes take place                    compiled: run_in_turn
    collect  robots     collisions are counted                  compiled: count_collided
    besides: datacollector after each step
    """

    stages: tuple[tuple[str, Stage], ...]
    version: Any
    calls: tuple[Callable[[], None], ...]
    collecting: tuple[Callable[[], None], ...]
    besides: tuple[str, ...] = ()

    @classmethod
    def of(cls, parts: Iterable[Part], version: Any, completed: Callable[[], int]) -> "Plan":
        """Return the plan of these parts; `completed` returns how many steps were completed."""
        stages = [(part.name, stage) for part in parts for stage in part.stages()]
        stages.sort(key=lambda pair: pair[1].phase)  # stable: in the order of parts
        calls = [(stage.phase is Phase.COLLECT, call_when_due(stage, completed)) for _, stage in stages]
        advancing = tuple(call for collects, call in calls if not collects)
        return cls(tuple(stages), version, advancing, tuple(call for collects, call in calls if collects))

    def __str__(self) -> str:
        """Return a table of the stages, what is compiled, and what makes Python due."""
        rows = [("phase", "part", "what", "how"), *(_row(part, stage) for part, stage in self.stages)]
        widths = [max(len(row[column]) for row in rows) for column in range(3)]
        lines = ["  ".join((*map(str.ljust, row, widths), row[3])) for row in rows]
        lines += [f"besides: {reason}" for reason in self.besides]
        return "\n".join(line.rstrip() for line in lines)


def _row(part: str, stage: Stage) -> tuple[str, str, str, str]:
    every = "" if stage.every == 1 else f" every {stage.every} steps"
    function: Any = stage.kernel and stage.kernel.function
    names = function.__name__ if function else stage.compiled
    compiled = f"compiled: {names}" if names else ""
    python = f"Python: {stage.python}" if stage.python else "" if compiled else "Python"
    return stage.phase.name.lower(), part, f"{stage.name}{every}", "; ".join(way for way in (compiled, python) if way)


def call_when_due(stage: Stage, completed: Callable[[], int]) -> Callable[[], None]:
    """Return what calls a stage in the steps that its interval divides; `completed` steps were taken before."""
    if stage.every == 1:
        return stage.call
    ahead = 0 if stage.phase is Phase.COLLECT else 1  # steps are counted before what is collected

    def call() -> None:
        if (completed() + ahead) % stage.every == 0:
            stage.call()

    return call
