"""Numbers that are shown beside the picture of a model."""

from typing import Any

from mesa_swarm.fire.model import FireModel


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


def value_text(value: Any) -> str:
    """Return a value as it is shown.

    Examples
    --------
    >>> value_text(0.1 + 0.2), value_text("A")
    ('0.3', 'A')
    """
    return f"{value:.4g}" if isinstance(value, float) else str(value)
