"""A model before its first step as a page has it: an image of its arrays, and where in it what is."""

from collections.abc import Callable, Iterator
from itertools import takewhile
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import ExportError
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.kernels.block import ADDRESSES, note_blocks
from mesa_swarm.kernels.event_rows import EventBuffer
from mesa_swarm.kernels.measuring import ONLY
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.plan import Driver
from mesa_swarm.learning.learner import LearningLayer
from mesa_swarm.live.edits import (
    DiscsInHand,
    Hand,
    fires_in_hand,
    put_disc,
    put_robot,
    reads_bodies,
    set_fire,
    spare_discs,
)
from mesa_swarm.live.fingerprint import Fingerprint, digest_pieces
from mesa_swarm.live.image import Functions, Image, clean_memory
from mesa_swarm.model.driving import ENGINE_MODEL, driver_of, kernels_of_stages, measure_in_place
from mesa_swarm.physics.crowd import PairArrays

# The address of images: below are constants of functions, and their stack.
BASE = 2**18
CURE = "write it as functions of arrays: @process, read of a sensor, compiled_stage of a part, stops, measures"
# Room for pairs of robots near each other: all, or this many a robot where that is less.
PAIRS = 24


# Blocks are noted in one place for all threads.
ONE_AT_A_TIME = RLock()


class Start(NamedTuple):
    """A model before its first step.

    Parameters
    ----------
    image : Image
    places : dict
        Where in it what is, in numbers and names for JSON.
    begun : bytes
        The image after what Python does in the first step, of learners; empty where it does nothing. What the kernels
        do that `places` name in "begins" is as it was.
    """

    image: Image
    places: dict[str, Any]
    begun: bytes


def begin_rules(model: Any) -> None:
    """Let rules be what they are now, as their first step would."""
    for arbiter in model.control.arbiters if model.control is not None else ():
        for layer in arbiter.layers:
            if isinstance(layer, Behaviour):
                layer.begin()


def list_learners(model: Any) -> list[LearningLayer]:
    """Return the layers that learn."""
    arbiters = model.control.arbiters if model.control is not None else ()
    return [layer for arbiter in arbiters for layer in arbiter.layers if isinstance(layer, LearningLayer)]


def begin_learning(model: Any, image: Image, beginnings: list[Kernel]) -> bytes:
    """Let learners begin with what they know, as their first step would, and return what the image is then.

    What these kernels do, which write arrays and draw, is left as it was: a page calls them.
    """
    learners = list_learners(model)
    if not learners:
        return b""
    for learner in learners:
        learner.begin()
    before = np.frombuffer(image.content, np.uint8)
    after = np.frombuffer(image.written_anew(), np.uint8).copy()
    for kernel in beginnings:
        for place, length in image.places_of(kernel.kept):
            after[place : place + length] = before[place : place + length]
    return b"" if np.array_equal(before, after) else after.tobytes()


def refuse_python(model: Any) -> None:
    """Raise an error that names what keeps a model from being a page, if anything does."""
    obstacles = list(list_obstacles(model))
    if obstacles:
        reasons = "; ".join(dict.fromkeys(obstacles))
        raise ExportError(f"{type(model).__name__} cannot run on a page: {reasons}; {CURE}")


def list_obstacles(model: Any) -> Iterator[str]:
    """Iterate over what keeps a model from being a page, in a few words each."""
    for kind in takewhile(lambda kind: kind.__module__ != ENGINE_MODEL, type(model).__mro__):
        if "step" in vars(kind):
            yield f"{kind.__name__}.step is a method in Python; declare parts, processes and measures instead"
    for part, stage in model.parts.plan.stages:
        if stage.kernel is None:
            yield f"{stage.name} ({part}) in Python{f': {stage.python}' if stage.python else ''}"
    for condition in type(model).conditions:
        if measure_in_place(model, condition.of) is None:
            yield f"stops by {condition.of}, a property in Python"
    yield from list_rules_in_python(model)


def list_rules_in_python(model: Any) -> Iterator[str]:
    """Iterate over rules and layers that decide in Python."""
    control = model.parts["control"]
    if control.arbiter is not None:
        for reason in control.reasons():
            yield f"{reason} decides in Python"


def make_start(make: Callable[[], Any], functions: Functions) -> tuple[Any, Start]:
    """Make a model and return it with what a page begins with.

    Raises
    ------
    ExportError
        If something in its step is Python, in one line that names it.
    """
    with ONE_AT_A_TIME, clean_memory(), note_blocks() as notes:
        model = make()
        begin_rules(model)
        model.parts.bodies.let_roam(spare_discs(model))
        model.parts.robots.devices.bind(model)
        model.parts.events.buffer.wraps[ONLY] = True
        model.parts.replan()
        refuse_python(model)
        make_room_for_pairs(model)
        settle_at_start(model)
        model.parts.replan()
        driver, sensing = driver_of(model, model.parts.plan, ()), kernels_of_stages(model.parts.plan)[0][0]
        fingerprint = Fingerprint(model)
        streams = [stream for _, stream in model.streams.items()]
        addresses = {address: function for function, address in ADDRESSES.items()}
        hand, lighter = Hand(model), fires_in_hand(model) if len(model.fires) else None
        discs = DiscsInHand(model, fingerprint.described) if spare_discs(model) else None
        functions.place_of(digest_pieces)
        functions.place_of(put_robot)
        functions.place_of(put_disc)
        beginnings = [kernel for learner in list_learners(model) if (kernel := learner.beginning()) is not None]
        edits = [hand.block, *([] if lighter is None else [lighter]), *([] if discs is None else [discs.block])]
        begins = [kernel.kept for kernel in beginnings]
        image = Image([driver._block, fingerprint.block, *edits, *begins], notes, addresses, streams, functions, BASE)
        places = _places(model, driver, sensing, fingerprint, image, functions)
        places["hand"] = [functions.place_of(put_robot), image.address_of(hand.block.numbers), len(hand.block.numbers)]
        places["hand_at"] = image.address_of(hand.place)
        if lighter is not None:
            numbers = lighter.numbers
            places["lighter"] = [functions.place_of(set_fire), image.address_of(numbers), len(numbers)]
        if discs is not None and not reads_bodies(model, image):
            places["discs"] = _describe_discs(discs, fingerprint, image, functions)
        places["begins"] = [
            [functions.place_of(kernel.function), image.address_of(kernel.block), len(kernel.block)]
            for kernel in beginnings
        ]
        begun = begin_learning(model, image, beginnings)
    return model, Start(image, places, begun)


def settle_at_start(model: Any) -> None:
    """Do before the first step what Python does in it: look whether robots overlap anything.

    Raises
    ------
    ExportError
        If they do: they would be moved when they have read their sensors.
    """
    swarm, robots = model.swarm, model.parts.robots
    if swarm.disturbed:
        before = swarm.columns["position"].copy()
        robots.engine.settle(swarm, model.parts.bodies.scene())
        swarm.disturbed = False
        if not np.array_equal(before, swarm.columns["position"]):
            raise ExportError("robots overlap at the start; place them where they are free for a page")


def make_room_for_pairs(model: Any) -> None:
    """Make room for all pairs of robots that can be near each other, since a page makes no more."""
    n = len(model.swarm)
    engine = model.parts.robots.engine
    engine._prepare(model.swarm, model.parts.bodies.scene())
    crowd = engine._crowd
    count = min(n * (n - 1) // 2 + 1, PAIRS * n)
    if count > len(crowd.near.room):
        crowd.near = PairArrays.of(count)._replace(state=crowd.near.state)
        crowd._pairs.replace(crowd.near)


def _places(
    model: Any, driver: Driver, sensing: Kernel, fingerprint: Fingerprint, image: Image, functions: Functions
) -> dict[str, Any]:
    find = image.address_of
    places: dict[str, Any] = {
        "end": image.end,
        "robots": len(model.swarm),
        "driver": [find(driver.numbers), len(driver.numbers)],
        "progress": find(driver.progress),
        "stop": find(model.driving.flag),
        "sense": [functions.place_of(sensing.function), find(sensing.block), len(sensing.block)],
        "digest": [functions.place_of(digest_pieces), find(fingerprint.block.numbers), len(fingerprint.block.numbers)],
        "hash": find(fingerprint.out),
        "columns": dict(_list_columns(model, find)),
        "counts": [[find(count), most] for most, count in _list_counts(model) if find(count) is not None],
    }
    fires = _describe_fires(model, find)
    if fires:
        places["fires"] = fires
    events = model.parts.events
    if events.reported:
        columns = {name: find(getattr(events.buffer, name)) for name in EventBuffer._fields}
        places["events"] = {"names": list(events.reported), "most": len(events.buffer.step), **columns}
    places["shown"] = list(_list_shown(model, find))
    places["moving"] = list(_list_moving(model, find))
    rows = model.driving.rows
    if rows is not None:
        table: Any = rows
        places["rows"] = {
            "names": table._names,
            "whole": [bool(whole) for whole in table._whole],
            "table": find(table._table),
            "steps": find(table._steps),
            "count": find(table._count),
            "failed": find(table._failed),
        }
    return places


def _list_columns(model: Any, find: Callable[[np.ndarray], int | None]) -> Iterator[tuple[str, list[Any]]]:
    """Iterate over the columns that are in the image: address, type and shape of each, by name."""
    for part_name, part in model.parts.items():
        for name, column in part.columns().items():
            key = name if part_name == "robots" or column.rows == "robots" else f"{part_name}.{name}"
            place = find(column.array)
            if place is not None and column.array.flags.c_contiguous:
                yield key, [place, column.array.dtype.str[1:], list(column.array.shape)]


def _describe_fires(model: Any, find: Callable[[np.ndarray], int | None]) -> dict[str, Any]:
    """Return where fires are, and where in the image their temperatures, visitors and ends are."""
    fires: Any = getattr(model, "fires", None)
    if not fires:
        return {}
    table, rows = fires.table, fires.rows
    return {
        "discs": np.column_stack([table.position[rows], table.radius[rows]]).tolist(),
        "temperature": [find(table.temperature[row : row + 1]) for row in rows.tolist()],
        "out": find(fires.own["out"]),
        "robots": find(fires.own["robots"]),
    }


def _describe_discs(discs: DiscsInHand, fingerprint: Fingerprint, image: Image, functions: Functions) -> dict[str, Any]:
    """Return what discs come and go by, and which piece of the fingerprint is of bodies, and where."""
    find: Any = image.address_of
    values: Any = discs.block._values
    return {
        "put": [functions.place_of(put_disc), find(discs.block.numbers), len(discs.block.numbers)],
        "at": find(discs.place),
        "table": find(values.discs),
        "own": list(discs.own),
        "spare": discs.spare,
        "largest": discs.largest,
        "bounds": list(discs.bounds),
        "piece": find(fingerprint.pieces[fingerprint.place]),
        "described": find(discs.described),
    }


def _list_shown(model: Any, find: Callable[[np.ndarray], int | None]) -> Iterator[list[int]]:
    """Iterate over discs that parts show and that a compiled stage keeps up to date: where they are, and how many."""
    for part in model.parts.added():
        shown = part.shown()
        place = None if shown is None or shown.discs is None else find(shown.discs)
        if place is not None:
            yield [place, len(shown.discs)]


def _list_moving(model: Any, find: Callable[[np.ndarray], int | None]) -> Iterator[list[Any]]:
    """Iterate over bodies that move: the id of each, and where its place and its heading are."""
    table = model.parts.bodies.table
    for row, body in enumerate(table.agents):
        if body.mode != "fixed":
            yield [body.unique_id, find(table.position[row : row + 1]), find(table.heading[row : row + 1])]


def _list_counts(model: Any) -> Iterator[tuple[int, np.ndarray]]:
    """Iterate over the buffers that pages empty: how many steps fill each, and where it counts them."""
    if "fires" in model.parts and len(model.fires):
        yield model.fires.history.room


__all__ = ["Start", "list_obstacles", "make_start"]
