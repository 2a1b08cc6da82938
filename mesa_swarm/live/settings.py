"""What a parameter of a model changes in its image, so that a page can change it while the model runs.

A model is continued with other values of the parameter before its first step, as `continued` does in Python, and the
images are compared. Where they differ by the value itself, as a number of 8 bytes, a page writes any other value there;
where they differ otherwise, by an angle in radians for instance, it has the bytes of each position of the slider.
"""

import struct
from bisect import bisect_right
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.live.image import Functions
from mesa_swarm.live.starts import BASE, Start, make_start
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


class Facts(NamedTuple):
    """What is known of a parameter: the values that it may have, the present one, and what others change."""

    values: Sequence[Any]
    value: Any
    change: Change


def positions_of(parameter: Parameter, present: Any = None) -> list[Any]:
    """Return the values that a control offers, about `MOST_POSITIONS` of a slider, with its ends and the present value.

    Examples
    --------
    >>> positions_of(Parameter("n", 2, int, Slider(1, 3, 1)))
    [1, 2, 3]
    >>> positions_of(Parameter("rate", 0.5, float, Slider(0, 1, 0.001)), 0.999)[-3:]
    [0.99, 0.999, 1.0]
    """
    control = parameter.control
    if isinstance(control, Choice):
        return list(control.options)
    if not isinstance(control, Slider):
        return []
    count = round((control.maximum - control.minimum) / control.step) + 1
    stride = -(-(count - 1) // (MOST_POSITIONS - 1)) or 1
    values = {round(control.minimum + k * control.step, 12) for k in range(0, count, stride)} | {control.maximum}
    if isinstance(present, (int, float)) and control.minimum <= present <= control.maximum:
        values.add(present)
    return sorted({parameter.kind(value) for value in values})


class Trials:
    """Images of models that continue one before its first step, with other values of its parameters.

    Parameters
    ----------
    start : Start
        Of the model.
    make : callable
        Returns the model that continues it with other values.
    functions : Functions
        Those of the page; what values need besides is added when a change is found.
    """

    def __init__(self, start: Start, make: Callable[..., Any], functions: Functions) -> None:
        self.start, self._make, self.functions = start, make, functions
        self._base: np.ndarray | None = None
        self._made: dict[tuple[str, tuple], tuple[np.ndarray | None, dict[Any, int]]] = {}

    @property
    def base(self) -> np.ndarray | None:
        """That with the same values: scratch of a model that continues another is not that of one that begins."""
        if self._base is None:
            self._base = self.content_with({}, self.functions.copy())
        return self._base

    def content_with(self, changes: dict[str, Any], functions: Functions) -> np.ndarray | None:
        """Return the bytes of an image, None if it has another form, or the model refuses the values.

        An image that was made for the same values and functions is not made again.
        """
        key = repr(changes), tuple(functions.places)
        if key not in self._made:
            content = self._content_of(changes, functions)
            self._made[key] = content, dict(functions.places)
        content, places = self._made[key]
        functions.places.update(places)
        return content

    def are_explained(self, changes: Mapping[str, Change], values: dict[str, Any]) -> bool:
        """Return whether changes make of the base what the image is with these values of some parameters."""
        content = None if self.base is None else self.content_with(values, self.functions.copy())
        if self.base is None or content is None:
            return False
        expected = self.base.copy()
        for name, value in values.items():
            put_change(expected, changes[name], value)
        return np.array_equal(expected, content)

    def _content_of(self, changes: dict[str, Any], functions: Functions) -> np.ndarray | None:
        try:
            found = make_start(lambda: self._make(**changes), functions)[1]
        except SwarmError:
            return None
        same = found.places == self.start.places and len(found.image.content) == len(self.start.image.content)
        return np.frombuffer(found.image.content, np.uint8) if same else None


def find_change(name: str, values: Sequence[Any], value: Any, trials: Trials) -> Change | None:
    """Return what a parameter changes, None if that is more than numbers in the image.

    Parameters
    ----------
    name : str
    values : sequence of numbers or texts
        Those that the parameter may have.
    value : number or text
        The one that the start has.
    trials : Trials
    """
    functions = trials.functions.copy()

    def content_for(other: Any) -> np.ndarray | None:
        return trials.content_with({name: other}, functions)

    others, base = [other for other in values if other != value], trials.base
    if not others or base is None:
        return None
    # The least as well: there a model may have another function, as at a probability of 0.
    probes = list(dict.fromkeys([others[0], others[len(others) // 3], others[-1]]))
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
        trials.functions.places.update(functions.places)
    return change


def find_same_change(
    name: str, known: Change, values: Sequence[Any], value: Any, first: Start, trials: Trials
) -> Change | None:
    """Return what a parameter changes in another start, at the places of what it changes in the first one, if it does.

    Arrays are in the same order in both images. Of numbers as they are two other values are tried, and of stored bytes
    all: in this start another parameter may decide some of them.
    """
    others = _values_to_try(Facts(values, value, known))
    for other in others:  # a start of which a value needs other functions is left out, whatever explains the others
        trials.content_with({name: other}, trials.functions)
    for from_end in (False, True):  # texts have numbers of other lengths in front, the shapes of arrays
        moved = _moved(known, first, trials.start, from_end)
        if moved is not None and all(trials.are_explained({name: moved}, {name: other}) for other in others):
            return moved
    return find_change(name, values, value, trials)


def find_same_changes(known: Mapping[str, Facts], first: Start, trials: Trials) -> dict[str, Change] | None:
    """Return by name what parameters change in another start, see `find_same_change`; None if one has no change.

    Numbers are tried together, which takes a model for each of the longest list of values instead of one for each value
    of each: as long as all that differs is explained, at the places of each, they act as they do one by one.
    """
    found, moved = dict[str, Change](), _move_together(pick_numbers(known), first, trials)
    for name, (values, value, change) in known.items():
        same = moved.get(name) or find_same_change(name, change, values, value, first, trials)
        if same is None:
            return None
        found[name] = same
    return found


def _move_together(known: Mapping[str, Facts], first: Start, trials: Trials) -> dict[str, Change]:
    """Return the changes at their places in another start; none if these do not explain some image."""
    tried = [[{name: one} for one in _values_to_try(facts)] for name, facts in known.items()]
    rows = [dict(ChainMap(*row)) for row in zip_longest(*tried, fillvalue={})]
    for from_end in (False, True):
        moved = {name: _moved(facts.change, first, trials.start, from_end) for name, facts in known.items()}
        if None not in moved.values() and all(trials.are_explained(moved, row) for row in rows):  # type: ignore[arg-type]
            return moved  # type: ignore[return-value]
    return {}


def _values_to_try(facts: Facts) -> list[Any]:
    """Return the values other than the present one that are tried in another start: of stored bytes all."""
    return [one for one in facts.change.bytes or (facts.values[0], facts.values[-1]) if one != facts.value]


def pick_numbers(known: Mapping[str, Facts]) -> dict[str, Facts]:
    """Return the parameters that are numbers: the others, such as names of rules, may decide what these act on."""
    return {name: facts for name, facts in known.items() if not isinstance(facts.value, (str, bool))}


def are_apart(known: Mapping[str, Facts], trials: Trials) -> bool:
    """Return whether numbers act together as they do one by one: all at their ends, on either side."""
    changes = {name: facts.change for name, facts in known.items()}
    ends = ({name: _values_from(facts, step)[0] for name, facts in known.items()} for step in (-1, 1))
    return all(trials.are_explained(changes, row) for row in ends)


def _values_from(facts: Facts, step: int) -> list[Any]:
    """Return the values that bytes are known of, if there are any, other than the present one."""
    return [one for one in facts.values[::step] if one != facts.value and one in (facts.change.bytes or (one,))]


def _moved(change: Change, first: Start, start: Start, from_end: bool) -> Change | None:
    """Return a change with the places that these have in another image; None if an array there is too short.

    In an array of another length places are counted from its begin or from its end.
    """
    before, after = first.image.layout, start.image.layout
    if len(before) != len(after):
        return None
    begins = [address for address, _ in before]

    def move(place: int) -> int | None:
        index = bisect_right(begins, place + BASE) - 1
        (address, length), (other, other_length) = before[index], after[index]
        offset = place + BASE - address + (other_length - length if from_end else 0)
        return offset + other - BASE if 0 <= offset < other_length else None

    copies = {form: [move(place) for place in places] for form, places in change.copies.items()}
    places = [move(place) for place in change.places]
    if None in places or any(None in of_form for of_form in copies.values()):
        return None
    return Change(copies, places, change.bytes)  # type: ignore[arg-type]


def put_change(content: np.ndarray, change: Change, value: Any) -> None:
    """Write another value of a parameter into the bytes of an image."""
    for form, places in change.copies.items():
        text = np.frombuffer(struct.pack(FORMS[form], float(value) if form == REAL else int(value)), np.uint8)
        for place in places:
            content[place : place + 8] = text
    if change.bytes:
        content[change.places] = change.bytes[value]


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
