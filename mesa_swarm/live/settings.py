"""What a parameter of a model changes in its image, so that a page can change it while the model runs.

A model is continued with other values of the parameter before its first step, as `continued` does in Python, and the
images are compared. Where they differ by the value itself, as a number of 8 bytes, a page writes any other value there;
where they differ otherwise, by an angle in radians for instance, it has the bytes of each position of the slider.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.live.image import Functions
from mesa_swarm.live.starts import Start, make_start
from mesa_swarm.model.parameters import Choice, Parameter, Slider

# The most positions of a slider, the most whose bytes are stored, and the most bytes of each.
MOST_POSITIONS, MOST_STORED, MOST_BYTES = 101, 21, 4096
REAL, WHOLE = "f8", "i8"
FORMS = {REAL: "<d", WHOLE: "<q"}


class Change(NamedTuple):
    """What another value of a parameter changes.

    Parameters
    ----------
    copies : dict of str to list of int
        Where the value itself is: addresses by the type of the number.
    places : list of int
        Addresses of other bytes that differ.
    bytes : dict of value to list of int
        What these are, by the value; empty if there are none.
    """

    copies: dict[str, list[int]]
    places: list[int]
    bytes: dict[Any, list[int]]


def positions_of(parameter: Parameter) -> list[Any]:
    """Return the values that a control offers, at most `MOST_POSITIONS` of a slider.

    Examples
    --------
    >>> positions_of(Parameter("n", 2, int, Slider(1, 3, 1)))
    [1, 2, 3]
    """
    control = parameter.control
    if isinstance(control, Choice):
        return list(control.options)
    if not isinstance(control, Slider):
        return []
    count = round((control.maximum - control.minimum) / control.step) + 1
    stride = -(-(count - 1) // (MOST_POSITIONS - 1)) or 1
    values = [round(control.minimum + k * control.step, 12) for k in range(0, count, stride)]
    return [parameter.kind(value) for value in values]


def find_change(
    values: Sequence[Any], value: Any, start: Start, make: Callable[[Any], Any], functions: Functions
) -> Change | None:
    """Return what a parameter changes, None if that is more than numbers in the image.

    Parameters
    ----------
    values : sequence of numbers or texts
        Those that the parameter may have.
    value : number or text
        The one that the start has.
    start : Start
    make : callable
        Returns a model that continues that of the start with another value, before its first step.
    functions : Functions
    """
    trial = functions.copy()

    def content_for(other: Any) -> np.ndarray | None:
        try:
            found = make_start(lambda: make(other), trial)[1]
        except SwarmError:
            return None
        same = found.places == start.places and len(found.image.content) == len(start.image.content)
        return np.frombuffer(found.image.content, np.uint8) if same else None

    others = [other for other in values if other != value]
    if not others:
        return None
    base = content_for(value)  # scratch of a model that continues another is not that of one that begins
    if base is None:
        return None
    probes = [others[len(others) // 3], others[-1]]
    contents = [content_for(other) for other in probes]
    if any(content is None for content in contents):
        return None
    copies, explained = _find_copies(base, value, probes, contents)  # type: ignore[arg-type]
    differs = np.zeros(len(base), bool)
    for content in contents:
        differs |= content != base
    if not (differs & ~explained).any():
        change: Change | None = Change(copies, [], {})
    else:
        change = _tabulate(base, value, others, content_for, copies, explained)
    if change is not None:
        functions.places.update(trial.places)
    return change


def _find_copies(
    base: np.ndarray, value: Any, probes: Sequence[Any], contents: Sequence[np.ndarray]
) -> tuple[dict[str, list[int]], np.ndarray]:
    """Return where the value itself is, and which bytes these are."""
    explained, copies = np.zeros(len(base), bool), dict[str, list[int]]()
    for form, pattern in FORMS.items() if isinstance(value, (int, float)) else ():
        if form == WHOLE and any(float(number) != int(number) for number in (value, *probes)):
            continue
        kind = float if form == REAL else int
        texts = [struct.pack(pattern, kind(number)) for number in (value, *probes)]
        found = set(_places(base.tobytes(), texts[0]))
        for content, text in zip(contents, texts[1:], strict=True):
            found &= set(_places(content.tobytes(), text))
        for place in sorted(found):
            explained[place : place + 8] = True
        copies[form] = sorted(found)
    return copies, explained


def _places(content: bytes, text: bytes) -> list[int]:
    places, at = [], content.find(text)
    while at >= 0:
        places.append(at)
        at = content.find(text, at + 1)
    return places


def _tabulate(
    base: np.ndarray,
    value: Any,
    others: Sequence[Any],
    content_for: Callable[[Any], np.ndarray | None],
    copies: dict[str, list[int]],
    explained: np.ndarray,
) -> Change | None:
    """Return a change with the bytes of each position."""
    stride = -(-len(others) // MOST_STORED)
    stored = others if isinstance(value, str) else [*others[::stride], *others[-1:]]
    contents = {other: content_for(other) for other in dict.fromkeys(stored)}
    known = {other: content for other, content in contents.items() if content is not None}
    differs = np.zeros(len(base), bool)
    for content in known.values():
        differs |= content != base
    places = np.flatnonzero(differs & ~explained)
    if len(places) > MOST_BYTES:
        return None
    rows = {other: content[places].tolist() for other, content in known.items()}
    bytes_of_values = {value: base[places].tolist(), **rows}
    return Change(copies, places.tolist(), bytes_of_values)
