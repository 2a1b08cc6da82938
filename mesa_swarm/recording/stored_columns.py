"""Stored columns on their way back into a model: their form, and what compiled functions cannot take."""

import numpy as np

from mesa_swarm.control.arbiter import MOST_LAYERS
from mesa_swarm.errors import RecordingError, shortened
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.plain import Packed
from mesa_swarm.robots.design import LARGEST_RADIUS


def lay_columns(columns: dict[str, np.ndarray], told: dict, packed: Packed) -> None:
    """Write stored columns into those of a model, which must have the same form."""
    if told.keys() != columns.keys():
        odd = sorted(told.keys() ^ columns.keys())
        raise RecordingError(f"column {shortened(odd[0])} is only in one of the two")
    values = {name: packed.unpack(column) for name, column in told.items()}
    for name, column in columns.items():
        value = values[name]
        if not isinstance(value, np.ndarray) or value.dtype != column.dtype or value.shape != column.shape:
            raise RecordingError(f"column {name} has another form")
    for name, column in columns.items():
        column[...] = values[name]


def check_columns(model: ObservedWorld) -> None:
    """Refuse what compiled functions, which check nothing, would take for a row of an array or a place."""
    robots, fires, designs = model.swarm.columns, model.fires.columns, model.swarm.designs
    for name, count in (("design", len(designs)), ("fire", len(model.fires)), ("layer", MOST_LAYERS)):
        if not ((robots[name] >= (0 if name == "design" else -1)) & (robots[name] < count)).all():
            raise RecordingError(f"column {name} names one that there is not")
    radius, fastest = (np.array([getattr(d, name) for d in designs]) for name in ("radius", "max_speed"))
    low, high = np.reshape(model.map.bounds, (2, 2))
    own = robots["design"]
    sound = {
        "position": all(((c["position"] >= low) & (c["position"] <= high)).all() for c in (robots, fires)),
        "heading": np.isfinite(robots["heading"]).all(),
        "number": len(np.unique(robots["number"])) == len(model.swarm),
        "command": np.isfinite(robots["command"]).all(),
        "radius": not len(own) or (robots["radius"] == radius[own]).all(),
        "max_speed": not len(own) or ((robots["max_speed"] >= 0) & (robots["max_speed"] <= fastest[own])).all(),
        "radius of fires": ((fires["radius"] > 0) & (fires["radius"] <= LARGEST_RADIUS)).all(),
    }
    wrong = [name for name, fits in sound.items() if not fits]
    if wrong:
        raise RecordingError(f"column {wrong[0]} holds what cannot be")


def lay_history(model: ObservedWorld, told: list) -> None:
    """Give the history of fires its rhythm and its places; its rows are collected."""
    history = model.fires.history
    every, places, fires = told
    numbers = all(type(number) is int and number >= 0 for number in (every, fires, *places))
    if not numbers or len(places) != len(model.fires) or any(place >= fires for place in places) or fires > 1e7:
        raise RecordingError("the history of fires is none")
    history.every, history._places, history._fires = every, list(places), fires
