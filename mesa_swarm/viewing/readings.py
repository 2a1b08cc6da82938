"""What is said of a model beside its picture, and of what went wrong in it."""

from typing import Any

from mesa_swarm.errors import SwarmError
from mesa_swarm.fire.model import FireModel

LONGEST_ERROR = 300


def readings_of(model: FireModel) -> tuple[tuple[str, str], ...]:
    """Return the numbers that are shown above the picture, each with its name.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> readings_of(SwarmModel(rng=1))
    (('Robots', '0'), ('Collisions', '0 now, 0 in all'))
    """
    fires, collisions = model.fires, f"{model.collisions:,} now, {model.total_collisions:,} in all"
    if not len(fires):
        return ("Robots", f"{len(model.swarm):,}"), ("Collisions", collisions)
    burning, fighting = int((~fires.out).sum()), int((model.swarm.fire >= 0).sum())
    return (
        ("Fires burning", f"{burning} of {len(fires)}"),
        ("Robots at fires", f"{fighting} of {len(model.swarm):,}"),
        ("Collisions", collisions),
    )


def in_words(problem: Exception) -> str:
    r"""Return one line that says what went wrong: ours as they are, others by name.

    Examples
    --------
    >>> in_words(ZeroDivisionError("nothing left\nto share"))
    'ZeroDivisionError: nothing left'
    """
    line = (str(problem).splitlines() or [""])[0]
    line = line if isinstance(problem, SwarmError) else f"{type(problem).__name__}: {line}"
    # A file's name may hold what ends a text or turns its direction.
    return "".join(letter if letter.isprintable() else "\ufffd" for letter in line[:LONGEST_ERROR])


def value_text(value: Any) -> str:
    """Return a value as it is shown.

    Examples
    --------
    >>> value_text(0.1 + 0.2), value_text("A")
    ('0.3', 'A')
    """
    return f"{value:.4g}" if isinstance(value, float) else str(value)
