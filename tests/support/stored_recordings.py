"""Recordings in `tests/recording/files` that were made with version 0.3.0, the first of engine bits 2, and how.

Each has 58 steps, and checkpoints at the beginning and after 20 and 40 of them, about 80 kB each. They are made again,
with the code of any checkout, by

    python tests/support/stored_recordings.py FOLDER

in the folder of that checkout, with it and `tests` of this one in PYTHONPATH.
"""

import sys
from pathlib import Path

if not __package__:  # run as a program
    sys.path.insert(0, str(Path(__file__).parents[1]))

from mesa_swarm import SwarmModel
from mesa_swarm.model.gallery import find_model
from support.stored_world import StoredWorld

FILES = Path(__file__).parents[1] / "recording" / "files"
STEPS, CHECKPOINT_EVERY = 58, 20
# The parameters of what was recorded; a name is that of a model of the gallery, or of `StoredWorld`.
RECORDED = {
    "cooperative_transport": {"n_robots": 5, "resistance": 0.5, "rng": 59},
    "shepherding": {"n_sheep": 8, "rng": 2},
    "q_learning": {"n_robots": 3, "memory": "table", "shared": "yes", "rng": 5},
    "puck_clustering": {"n_robots": 3, "rows": 1, "rng": 4},
    "stored_world": {"rng": 1},
}


def path_of(name: str, folder: Path = FILES) -> Path:
    return folder / f"{name}_0.3.0.arrow"


def class_of(name: str) -> type[SwarmModel]:
    return StoredWorld if name == "stored_world" else find_model(name)


def begun(name: str) -> SwarmModel:
    """Return a model as it was when its recording began."""
    return class_of(name)(**RECORDED[name])


def stepped(model: SwarmModel, last: int = STEPS) -> SwarmModel:
    """Take steps until this many are done, and return the model."""
    while model.completed < last:
        model.step()
    return model


def write(folder: Path) -> None:
    """Record all of them."""
    for name in RECORDED:
        model = begun(name)
        with model.record(path_of(name, folder), checkpoint_every=CHECKPOINT_EVERY):
            stepped(model)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
