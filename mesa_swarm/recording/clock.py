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
    if has_own_events(model):
        _let_pass(model, steps)
    elif not hasattr(model, "_default_schedule"):
        model.steps = steps
    else:
        model._default_schedule.pause()
        model.steps, model.time = steps, float(steps)
        model._default_schedule.resume()


def has_own_events(model: ObservedWorld) -> bool:
    """Tell whether anything besides the step is scheduled."""
    if not hasattr(model, "_default_schedule"):
        return False
    step = model._default_schedule
    others = [generator for generator in model._event_generators if generator is not step]
    # While the step is being taken, its own event is not among those that wait.
    waiting = [event for event in model._event_list._events if not event.CANCELED and event is not step._current_event]
    return bool(others) or bool(waiting) or model.time != model.steps


def _let_pass(model: ObservedWorld, steps: int) -> None:
    """Take steps in which the model does nothing, so that events of its own come when they are due."""
    user_step, model._user_step = model._user_step, lambda: None
    try:
        while model.steps < steps:
            model.step()
    finally:
        model._user_step = user_step
