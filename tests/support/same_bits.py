"""Digests of twenty worlds and results of the models of the gallery, to the last bit, and a file that stores them.

The numbers in `same_bits.json` were made with version 0.3.0, the first of engine bits 2. They may only be made anew
where a change of bits is intended, `ENGINE_BITS` is raised, and the message of that commit states which, and why:

    python tests/support/same_bits.py OUT.json

This file, `bit_worlds` and `bit_parts` use public names that the old code has as well. To make the numbers with
another checkout, run the same command in its folder, with this folder and `tests` of this checkout in PYTHONPATH.
"""

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

if not __package__:  # run as a program
    sys.path.insert(0, str(Path(__file__).parents[1]))

from mesa_swarm import SwarmModel
from mesa_swarm.model.gallery import find_model, gallery_names
from support.bit_worlds import STEPS, STEPS_OF, WORLDS

STORED = Path(__file__).with_suffix(".json")
SEEDS = (1, 2)
STEPS_OF_RESULTS = 200
POSES = ("position", "heading", "aim", "aim_heading", "blocked", "carried")

# ---- worlds


def digest(value: Any) -> str:
    """Return a digest of an array, with its type and shape, or of a plain value."""
    if isinstance(value, np.ndarray):
        content = f"{value.dtype.str} {value.shape} ".encode() + np.ascontiguousarray(value).tobytes()
    else:
        content = json.dumps(plain(value)).encode()
    return blake2b(content, digest_size=16).hexdigest()


def plain(value: Any) -> Any:
    """Return a value as texts, lists and dicts, real numbers with all their bits, whatever types NumPy gave them."""
    if isinstance(value, np.ndarray):
        return [value.dtype.str, list(value.shape), value.tobytes().hex()]
    if isinstance(value, Mapping):
        return {str(name): plain(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, float | np.floating):
        return float(value).hex()
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    return value


def columns_of(model: SwarmModel) -> Iterator[tuple[str, Any]]:
    """Yield all columns of a model, what lasts of its run, and its random streams, each with a name."""
    yield from ((f"swarm.{name}", column) for name, column in model.swarm.columns.items())
    yield from ((f"fires.{name}", column) for name, column in model.fires.columns.items())
    yield from ((f"movers.{name}", getattr(model.movers, name)) for name in POSES)
    for name in ("pose", "resistance", "moved", "pushers"):
        yield f"loads.{name}", [getattr(load, name) for load in model.loads]
    yield from ((f"fields.{name}", np.array(field.values)) for name, field in model.fields.items())
    yield from ((f"events.{name}", series) for name, series in model.events.arrays().items())
    yield "state", dict(model.state)
    yield "history", [model.fires.history.steps, model.fires.history.temperature, model.fires.history.robots]
    yield from ((f"streams.{name}", state) for name, state in model.streams.state().items())
    yield "streams of Mesa", [model.rng.bit_generator.state, model.random.getstate()]
    yield from ((f"rows.{name}", values[-3:]) for name, values in model.datacollector.model_vars.items())
    yield "rows of agents", last_row_of_agents(model)
    yield "steps", [model.steps, model.completed, model.total_collisions]


def last_row_of_agents(model: SwarmModel) -> list:
    """Return what was collected of each agent in the last row, in order of the agents' numbers."""
    if not model.datacollector.agent_reporters:
        return []
    table = model.datacollector.get_agent_vars_dataframe()
    last = table.loc[table.index.get_level_values(0).max()]
    return sorted([int(number), *map(str, row)] for number, row in zip(last.index, last.to_numpy(), strict=True))


def columns_digest(model: SwarmModel) -> dict[str, str]:
    """Return a digest of each column of a model, and of all else that its steps change, by name."""
    return {name: digest(value) for name, value in columns_of(model)}


def digests_of_world(name: str) -> dict[str, str]:
    """Return the digests of one of the worlds after its steps."""
    model = WORLDS[name]()
    for _ in range(STEPS_OF.get(name, STEPS)):  # not run: it stops when all fires are out
        model.step()
    return columns_digest(model)


def differing(stored: Mapping[str, Any], found: Mapping[str, Any], aliases: Mapping[str, str] | None = None) -> list:
    """Return the names of what differs, is missing or is new; `aliases` are present names by stored ones."""
    renamed = {(aliases or {}).get(name, name): value for name, value in stored.items()}
    names = [*renamed, *(name for name in found if name not in renamed)]
    return [name for name in names if name not in renamed or name not in found or renamed[name] != found[name]]


# ---- results of the gallery


def results() -> dict[str, Callable[[], dict[str, Any]]]:
    """Return what runs each model of the gallery with each seed, by a name such as "boids, seed 1"."""
    pairs = [(name, seed) for name in gallery_names() for seed in SEEDS]
    return {f"{name}, seed {seed}": lambda name=name, seed=seed: result_of(name, seed) for name, seed in pairs}


def result_of(name: str, seed: int) -> dict[str, Any]:
    """Return the reporters' last values, and the results, of a model of the gallery with its defaults."""
    model = find_model(name)(rng=seed)
    for _ in range(STEPS_OF_RESULTS):
        model.step()
    rows = {f"reporter {name}": values[-1] for name, values in model.datacollector.model_vars.items()}
    return plain(rows | {f"result {name}": value for name, value in model.results().items()})


# ---- the file


def stored() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the stored digests of the worlds, and the stored results."""
    return json.loads(STORED.read_text(encoding="utf-8"))


def write(path: Path) -> None:
    """Write the digests of all worlds and all results to a file."""
    content = {
        "worlds": {name: digests_of_world(name) for name in WORLDS},
        "results": {name: run() for name, run in results().items()},
    }
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
