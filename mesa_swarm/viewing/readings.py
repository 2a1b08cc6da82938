"""Numbers that are shown beside the picture of a model."""

from typing import Any

from mesa_swarm.fire.model import FireModel


def readings_of(model: FireModel) -> tuple[tuple[str, str], ...]:
    """Return the numbers that are shown above the picture, each with its name."""
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
    """Return a value as it is shown."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
