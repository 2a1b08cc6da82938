"""What added parts show: columns of robots, discs, and pictures of values, for recordings and viewers."""

from collections.abc import Mapping

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, shortened
from mesa_swarm.kernels.part import Part, Shown
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import COLOUR
from mesa_swarm.world.fields import MOST_CELLS, MOST_PIXELS, ScalarField, average_blocks, levels_of

# Values of a robot in a column that is recorded without being named.
MOST_VALUES = 8


class PartPicture:
    """Values of a part over the whole map, with what recordings and viewers ask of a field."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values
        self.peak, self.total = float(values.max(initial=0.0)), float(values.sum())

    def levels(self, most: int = MOST_PIXELS) -> np.ndarray:
        """Return the values as a picture of at most this many pixels, see `levels_of`."""
        return levels_of(average_blocks(self.values, most), self.peak)


def columns_of_parts(model: EngineModel) -> dict[str, np.ndarray]:
    """Return the columns of added parts that have a row a robot, named as in "boards.last_read"."""
    return {
        f"{part.name}.{name}": column.array
        for part in model.parts.added()
        for name, column in part.columns().items()
        if column.rows == "robots"
    }


def robot_columns(model: EngineModel) -> dict[str, np.ndarray]:
    """Return all columns that have a row a robot: those of the swarm, and those of added parts."""
    of_parts = columns_of_parts(model)
    return {**of_parts, **model.swarm.columns} if of_parts else model.swarm.columns


def narrow_columns(model: EngineModel) -> list[str]:
    """Return the names of those columns of added parts that are numbers, one or a few of a robot."""
    return [
        name
        for name, array in columns_of_parts(model).items()
        if array.dtype.kind in "biuf" and 0 < np.prod(array.shape[1:], dtype=int) <= MOST_VALUES
    ]


def shown_of(model: EngineModel) -> list[Shown]:
    """Return what each added part shows, checked, without those that show nothing."""
    pairs = [(part, part.shown()) for part in model.parts.added()]
    return [_check_picture(part, picture) for part, picture in pairs if picture is not None]


def with_discs(model: EngineModel) -> list[Shown]:
    """Return what is shown of the parts that have discs; their places in this list number them in tables."""
    return [picture for picture in shown_of(model) if picture.discs is not None]


def discs_of(model: EngineModel) -> np.ndarray:
    """Return the discs of all added parts, shape (k, 4): the place of the part in `with_discs`, x, y and radius."""
    tables = [picture.discs for picture in with_discs(model) if picture.discs is not None]
    numbered = [np.insert(discs, 0, place, axis=1) for place, discs in enumerate(tables)]
    return np.concatenate([np.empty((0, 4)), *numbered])


def pictures_of(model: EngineModel) -> Mapping[str, ScalarField | PartPicture]:
    """Return the fields of a model by name, and after them the pictures that added parts show."""
    pictures: dict[str, ScalarField | PartPicture] = dict(model.fields)
    for part_picture in shown_of(model):
        if part_picture.values is not None:
            name = part_picture.name if part_picture.name not in pictures else f"{part_picture.name} of a part"
            pictures[name] = PartPicture(part_picture.values)
    return pictures


def _check_picture(part: Part, picture: Shown) -> Shown:
    """Return what a part shows with arrays of floats; of discs those that can be drawn."""
    if not isinstance(picture, Shown):
        raise _unexpected(part, picture, "an object of mesa_swarm.kernels.part.Shown")
    if not isinstance(picture.name, str) or not picture.name:
        raise _unexpected(part, picture.name, "a name")
    if not isinstance(picture.colour, str) or (picture.colour and not COLOUR.fullmatch(picture.colour)):
        raise _unexpected(part, picture.colour, "a colour of # and six hexadecimal digits")
    discs = None if picture.discs is None else _discs(part, picture.discs)
    values = None if picture.values is None else _values(part, picture.values)
    return picture._replace(discs=discs, values=values)


def _discs(part: Part, discs: np.ndarray) -> np.ndarray:
    table = np.asarray(discs, float)
    if table.ndim != 2 or table.shape[1] != 3:
        raise _unexpected(part, f"discs of shape {table.shape}", "rows of x, y and radius")
    return table[np.isfinite(table).all(axis=1) & (table[:, 2] > 0)]


def _values(part: Part, values: np.ndarray) -> np.ndarray:
    picture = np.asarray(values, float)
    if picture.ndim != 2 or not 0 < picture.size <= MOST_CELLS:
        raise _unexpected(part, f"values of shape {picture.shape}", f"rows and columns of 1 to {MOST_CELLS:,} values")
    return np.maximum(np.nan_to_num(picture, posinf=0.0), 0.0)


def _unexpected(part: Part, value: object, expectation: str) -> InvalidValueError:
    return InvalidValueError(f"part {part.name} shows {shortened(value)}; expected {expectation}")
