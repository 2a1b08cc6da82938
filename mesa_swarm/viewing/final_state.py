"""What figures show of a finished run: its last step, and what was collected on the way."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.frames import Frame, frame_of
from mesa_swarm.viewing.scene import Scene, scene_of


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FinalState:
    """A model after its last step, as plain arrays that travel between processes."""

    frame: Frame
    scene: Scene
    # steps (k,), temperature and robots (k, f) of the fires; the last row is the present.
    history: dict[str, np.ndarray]
    # Numbers that the DataCollector collected of the model, by name; steps from one to the next.
    series: dict[str, np.ndarray]
    collect_every: int


def final_state_of(model: EngineModel) -> FinalState:
    """Return the state of a model as it is now, with what was collected until then."""
    # Of rows that a class has collected by itself the steps are not known.
    rows = model.datacollector.model_vars if model.collect_every else {}
    collected = {name: _column(values) for name, values in rows.items()}
    return FinalState(
        frame=frame_of(model),
        scene=scene_of(model),
        history=_history(model),
        series={name: column for name, column in collected.items() if column.dtype.kind in "biuf" and column.ndim == 1},
        collect_every=model.collect_every,
    )


def _column(values: list) -> np.ndarray:
    """Return collected values as an array, of numbers if all are numbers or missing: None, NaN or masked."""
    try:
        array = fill_masked(values)
        return array.astype(float) if array.dtype.kind == "O" else array
    except (TypeError, ValueError):  # such as lists of unequal length
        return np.empty(0, object)


def _history(model: EngineModel) -> dict[str, np.ndarray]:
    """Return the fires' history with the present as its last row, which is else missing between two rows."""
    fires, history = model.fires, model.fires.history
    tables = {name: getattr(history, name) for name in ("steps", "temperature", "robots")}
    if len(tables["steps"]) and tables["steps"][-1] < model.steps:
        now = {"steps": model.steps, "temperature": fires.temperature, "robots": np.where(fires.out, -1, fires.robots)}
        tables = {name: np.concatenate([table, [now[name]]]) for name, table in tables.items()}
    return tables
