"""Masked arrays, whose mask NumPy drops where it makes a plain array: masked numbers as NaN instead."""

from itertools import chain

import numpy as np

# Arrays have no more.
MOST_AXES = 64
# Types of numbers that may be NaN, or become such.
NUMBERS = "biufcO"


def fill_masked(value: object) -> np.ndarray:
    """Return a value as `numpy.asarray` does, but masked numbers as NaN, also those of arrays within lists.

    Examples
    --------
    >>> fill_masked(np.ma.array([1, 2], mask=[False, True]))
    array([ 1., nan])
    >>> fill_masked([1, 2])
    array([1, 2])
    """
    if isinstance(value, np.ma.MaskedArray):
        mask = np.ma.getmaskarray(value)
        is_whole = value.dtype.kind not in NUMBERS or not mask.any()
        return np.asarray(value.data) if is_whole else np.where(mask, np.nan, value.data)
    if isinstance(value, (list, tuple)) and holds_masked(value):
        return np.asarray([fill_masked(item) for item in value])
    return np.asarray(value)


def holds_masked(value: object) -> bool:
    """Return whether a value is a masked array, or a list or tuple with one somewhere in it.

    Examples
    --------
    >>> holds_masked([(1.0, np.ma.masked)]), holds_masked([(1.0, 2.0)])
    (True, False)
    """
    items = [value]
    for _ in range(MOST_AXES):  # level by level: ten thousand poses take milliseconds
        kinds = set(map(type, items))
        if any(issubclass(kind, np.ma.MaskedArray) for kind in kinds):
            return True
        if not any(issubclass(kind, (list, tuple)) for kind in kinds):
            return False
        items = list(chain.from_iterable(item for item in items if isinstance(item, (list, tuple))))
    return False
