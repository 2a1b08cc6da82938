"""Mesa's clock: its newer versions keep a schedule of events beside the count of steps."""

from mesa_swarm.errors import RecordingError
from mesa_swarm.observed_world import ObservedWorld

MOST_STEPS = 100_000_000


def set_clock(model: ObservedWorld, steps: int) -> None:
    """Let Mesa count so many steps, in which nothing happens.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> set_clock(model, 30)
    >>> model.steps, model.completed
    (30, 0)
    """
    if type(steps) is not int or not model.steps <= steps <= MOST_STEPS:
        raise RecordingError(f"{steps!r:.40} is no count of steps")
    user_step, model._user_step = model._user_step, lambda: None
    try:
        if not hasattr(model, "_default_schedule"):
            model.steps = steps
        while model.steps < steps:
            model.step()
    finally:
        model._user_step = user_step


def has_own_events(model: ObservedWorld) -> bool:
    """Tell whether anything besides the step is scheduled."""
    if not hasattr(model, "_default_schedule"):
        return False
    others = [generator for generator in model._event_generators if generator is not model._default_schedule]
    waiting = [event for event in model._event_list._events if not event.CANCELED]
    return bool(others) or len(waiting) > 1 or model.time != model.steps
