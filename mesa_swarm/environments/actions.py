"""Actions of a learner: wheel speeds, or one of the thesis's four or eight actions."""

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_flag, shortened
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.learning.actions import ACTIONS

CONTINUOUS = "continuous"
CHOICES = (CONTINUOUS, 4, 8)


def checked_choice(actions: str | int) -> str | int:
    """Return `actions` if it is "continuous", 4 or 8."""
    if isinstance(actions, bool) or not isinstance(actions, (str, int)) or actions not in CHOICES:
        raise InvalidValueError(f"actions is {shortened(actions)}; expected 'continuous', 4 or 8")
    return actions


def checked_clip(actions: str | int, clip: object) -> bool:
    """Return whether wheel speeds are to be clipped; there is nothing to clip in numbers of actions."""
    if check_flag("clip", clip) and not isinstance(actions, str):
        raise InvalidValueError(f"clip is True for actions={actions}; expected False: only wheel speeds can be clipped")
    return bool(clip)


def shares(
    actions: str | int, commands: ArrayLike, shape: tuple[int, ...], clip: bool = False, numbers: int = 2
) -> np.ndarray:
    r"""Return each robot's wheel speeds as shares of its greatest speed, and what follows, shape (\*shape, numbers).

    Where `actions` is "continuous", `commands` are such numbers, each from -1 to 1; otherwise they are numbers of
    actions, of this shape: (n,), or (worlds, n), and the result has two columns. An error names the robot whose action
    is out of range; with `clip` numbers beyond -1 and 1 become these, and only NaN is out of range.
    """
    if isinstance(actions, str):  # CONTINUOUS, the only word
        expectation = "two wheel speeds" if numbers == 2 else f"{numbers} numbers, two of them wheel speeds,"
        wheels = _array(commands, (*shape, numbers), expectation.rstrip(","))
        if clip:
            wheels = np.clip(wheels, -1.0, 1.0)
        if not (np.abs(wheels) <= 1.0).all():  # also refuses NaN
            raise _refused(wheels, ~(np.abs(wheels) <= 1.0).all(axis=-1), f"{expectation} from -1 to 1")
        return wheels
    indices = _array(commands, shape, "the number of an action")
    is_action = np.isin(indices, np.arange(actions))
    if not is_action.all():
        raise _refused(indices, ~is_action, f"the number of an action, a whole number from 0 to {actions - 1}")
    return ACTIONS[indices.astype(np.intp)]


def _array(commands: ArrayLike, shape: tuple[int, ...], what: str) -> np.ndarray:
    try:
        array = np.asarray(fill_masked(commands), dtype=float)
    except (TypeError, ValueError):
        raise InvalidValueError(f"actions are {shortened(commands)}; expected {what} for each robot") from None
    if array.shape != shape:
        raise InvalidValueError(f"actions have shape {array.shape}; expected {shape}: {what} for each robot")
    return array


def _refused(array: np.ndarray, wrong: np.ndarray, expectation: str) -> InvalidValueError:
    where = tuple(map(int, np.argwhere(wrong)[0]))
    robot = f"robot {where[-1]}" + (f" in world {where[0]}" if len(where) > 1 else "")
    return InvalidValueError(f"the action of {robot} is {shortened(array[where])}; expected {expectation}")
