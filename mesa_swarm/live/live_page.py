"""A model as one page that runs it: what the page holds, and how it is written."""

import json
import os
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from copy import deepcopy
from functools import cache, partial
from itertools import combinations, pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple
from zlib import compress

import numpy as np

from mesa_swarm.base.errors import ExportError, InvalidValueError, SwarmError, check_count, shortened
from mesa_swarm.base.files import check_writable, draft_of, show_path
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.kernels.compiling import needed_functions
from mesa_swarm.live.binaries import PREFIX, module_of
from mesa_swarm.live.image import Functions
from mesa_swarm.live.settings import (
    Change,
    Facts,
    Trials,
    are_apart,
    find_change,
    find_same_changes,
    pick_numbers,
    positions_of,
)
from mesa_swarm.live.starts import BASE, Start, make_start
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.info import model_info
from mesa_swarm.model.parameters import Choice, Parameter, Slider, parameters_of
from mesa_swarm.physics.threads import count_processors
from mesa_swarm.recording.continuing import Beginning
from mesa_swarm.recording.provenance import parameters_of_run
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.scene import scene_of
from mesa_swarm.viewing.server_headers import policy, source_of

SEEDS = 20
MOST_SEEDS = 1000
# Values of a parameter that acts from the beginning of a run for which a page has a start.
MOST_VARIANTS = 5
# Of how many values of a slider it is tried first whether the model accepts them.
SOME = 4
# A page with more robots has one start: images are large.
MOST_ROBOTS_WITH_SEEDS = 200
# A page has no more bytes, unless a number of seeds is given.
MOST_PAGE_BYTES = 400_000
# Of a parameter that a page shows but cannot change, characters.
LONGEST_VALUE = 60
# Of compression.
LEVEL = 9


class Variant(NamedTuple):
    """A start with another value of a parameter, and what the parameters that act in a run change in its image."""

    name: str
    value: Any
    model: Any
    start: Start
    changes: dict[str, Change]


class LivePage:
    """What a page has of a model: its starts, their module, and what its parameters change.

    Parameters
    ----------
    model : SwarmModel
    seeds : iterable of int
        With which of them it can begin, besides its own.

    Raises
    ------
    ExportError
        If something in a step of the model is Python, or not of a kind that pages have.
    """

    def __init__(self, model: Any, seeds: Iterable[int] = range(1, SEEDS + 1), progress: bool = False) -> None:
        self.model_class, self.functions = type(model), Functions()
        compile_first_steps(model)
        self.given = parameters_of_run(model)
        self.is_assembled = not can_be_made_anew(model)
        if self.is_assembled:
            own, start = make_start(lambda: deepcopy(model), self.functions)
            self.seed, self._first = _seed_of(model), own
            starts = {self.seed: (own, start)}
        else:
            self.seed = _seed_of(model)
            wanted = [self.seed, *(seed for seed in seeds if seed != self.seed)]
            starts = {}
            with progress_bar(len(wanted), "starts", progress) as bar:
                for seed in wanted[: 1 if len(model.swarm) > MOST_ROBOTS_WITH_SEEDS else None]:
                    starts[seed] = make_start(partial(self.make, rng=seed), self.functions)
                    bar.update(1)
            self._first = starts[self.seed][0]
        self.starts = starts
        self.changes = {} if self.is_assembled else self._find_changes()
        self.variants = [] if self.is_assembled else list(self._find_variants())

    def make(self, **changes: Any) -> Any:
        """Return a model like the one that is exported, before its first step, with other parameters."""
        return self.model_class(**{**self.given, **changes})

    # ---- parameters

    def _find_changes(self) -> dict[str, tuple[Parameter, Any, list[Any], Change]]:
        """Return what each parameter changes that a page can change in a run, and the values it may have."""
        found: dict[str, tuple[Parameter, Any, list[Any], Change]] = {}
        trials = self._trials(self.starts[self.seed][1], self.functions)
        for name, parameter in parameters_of(self.model_class).items():
            value = self.given.get(name, parameter.default)
            values = self._list_accepted(name, positions_of(parameter, value), value)
            if len(values) < 2 or value is None:
                continue
            change = find_change(name, values, value, trials)
            if change is not None and (any(change.copies.values()) or change.bytes):
                found[name] = parameter, value, values, change
        for name in overlapping({name: change for name, (*_, change) in found.items()}):
            found.pop(name, None)
        return apart(found, trials)

    def _trials(self, start: Start, functions: Functions, **changes: Any) -> Trials:
        """Return what tries other values of parameters that act in a run, of a start with some others."""
        make = partial(self.make, rng=self.seed, **changes)
        beginning = cache(lambda: Beginning(make))  # made with the first trial: where memory is clean
        return Trials(start, lambda **others: beginning().continued(**others), functions)

    def _find_variants(self) -> Iterator[Variant]:
        """Iterate over starts with other values of parameters that act from the beginning of a run."""
        for name, parameter in parameters_of(self.model_class).items():
            if name in self.changes:
                continue
            for value in values_to_begin_with(parameter, self.given.get(name, parameter.default)):
                variant = self._find_variant(name, value)
                if variant is not None:
                    yield variant

    def _find_variant(self, name: str, value: Any) -> Variant | None:
        """Return the start with another value; None where it is refused, or needs other functions."""
        functions, make = self.functions.copy(), partial(self.make, rng=self.seed, **{name: value})
        try:
            model, start = make_start(make, functions)
        except SwarmError:
            return None
        if functions.places != self.functions.places:
            return None
        first, trials = self.starts[self.seed][1], self._trials(start, functions, **{name: value})
        changes = find_same_changes(facts_of_changes(self.changes), first, trials)
        if changes is None or functions.places != self.functions.places:
            return None
        if any(list(changes[other].bytes) != list(known.bytes) for other, (*_, known) in self.changes.items()):
            return None
        return Variant(name, value, model, start, changes)

    def _list_accepted(self, name: str, values: list[Any], present: Any) -> list[Any]:
        """Return the values that the model accepts: those between some, from the least to the largest, as these are.

        Where it accepts one of these and not the next one, the first value from which that is so is looked for.
        """
        accepts = cache(lambda place: values[place] == present or self._is_accepted(name, values[place]))
        stride = 1 if isinstance(present, str) else max(1, len(values) // SOME)
        some = sorted({*range(0, len(values), stride), *range(len(values))[-1:]})
        return [values[place] for place in accepted_places(some, accepts)]

    def _is_accepted(self, name: str, value: Any) -> bool:
        try:
            self.make(rng=self.seed, **{name: value})
        except SwarmError:
            return False
        return True

    # ---- what is written

    def parts(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Return what the page reads first, as JSON, and its other parts by name."""
        content = {"module": module_of(self.functions.places)}
        starts = [self._add_start(content, seed) for seed in self.starts]
        starts += [add_variant(content, f"v{number}", self.seed, one) for number, one in enumerate(self.variants)]
        info = model_info(self.model_class)
        about = {
            "title": title_of(info.name),
            "base": BASE,
            "seed": self.seed,
            "steps": self._first.completed,
            "assembled": self.is_assembled,
            "functions": max(self.functions.places.values()),
            "table": {
                function if isinstance(function, str) else f"{PREFIX}{place}": place
                for function, place in self.functions.places.items()
            },
            "starts": starts,
            "parameters": [self._described(*facts) for facts in self.changes.values()],
            "begins": list_beginnings(starts, self.given, parameters_of(self.model_class)),
            "fixed": {
                name: f"{self.given[name]!s:.{LONGEST_VALUE}}"
                for name in self.given
                if name not in {*self.changes, "rng"}
            },
            "speed": info.speed,
            "look": self._look(),
            "radio": self._first.communication is not None,
        }
        return about, content

    def _add_start(self, content: dict[str, bytes], seed: int) -> dict[str, Any]:
        """Add the bytes of a seed's start, and return what the page reads of it: what differs from the first."""
        own, (model, start) = self.starts[self.seed][1], self.starts[seed]
        first, image, is_own = own.image.content, start.image.content, seed == self.seed
        differs = not is_own and len(image) == len(first)
        content[f"start-{seed}"] = difference(image, first) if differs else image
        if start.begun:
            content[f"begun-{seed}"] = difference(start.begun, image)
        world = scene_of(model).world()
        return {
            "seed": seed,
            "key": f"{seed}",
            "differs": differs,
            "begins": bool(start.begun),
            "places": start.places if is_own or start.places != own.places else None,
            "world": world if is_own or world != scene_of(self._first).world() else None,
        }

    def text(self, most: int | None = None) -> str:
        """Return the page, with as many starts as make it no longer than this, but at least one."""
        about, content = self.parts()
        texts = {name: b64encode(compress(piece, LEVEL)).decode() for name, piece in content.items()}
        length = len(live_text(about, {})) + len(texts["module"])
        for place, start in enumerate(about["starts"]):
            names = [name for name in (f"start-{start['key']}", f"begun-{start['key']}") if name in texts]
            length += sum(len(texts[name]) for name in names)
            if most is not None and place and length > most:
                about["starts"] = about["starts"][:place]
                break
        kept = {"module", *(f"{kind}-{start['key']}" for start in about["starts"] for kind in ("start", "begun"))}
        about["begins"] = list_beginnings(about["starts"], self.given, parameters_of(self.model_class))
        return live_text(about, {name: text for name, text in texts.items() if name in kept})

    def _look(self) -> dict[str, Any] | None:
        """Return the column by which robots are coloured, and its range."""
        looks = scene_of(self._first).changes[0][1].get("looks", {})
        return {name: looks["column"][name] for name in ("name", "low", "high")} if "column" in looks else None

    def _described(self, parameter: Parameter, value: Any, values: list[Any], change: Change) -> dict[str, Any]:
        control: Any = parameter.control
        described = {"name": parameter.name, "help": parameter.help, "value": value, "copies": change.copies}
        if change.bytes:
            described |= {"places": change.places, "values": list(change.bytes), "bytes": list(change.bytes.values())}
        if isinstance(control, Slider):
            step = control.step
            described |= {"minimum": min(values), "maximum": max(values), "step": step, "whole": parameter.kind is int}
        elif isinstance(control, Choice):
            described |= {"options": list(change.bytes)}
        return described


def add_variant(content: dict[str, bytes], key: str, seed: int, variant: Variant) -> dict[str, Any]:
    """Add the bytes of a start with another value, and return what the page reads of it."""
    image, begun = variant.start.image.content, variant.start.begun
    content[f"start-{key}"] = image
    if begun:
        content[f"begun-{key}"] = difference(begun, image)
    return {
        "seed": seed,
        "key": key,
        "begins": bool(begun),
        "with": [variant.name, variant.value],
        "places": variant.start.places,
        "world": scene_of(variant.model).world(),
        "changes": {
            name: change._asdict() | {"bytes": list(change.bytes.values())} for name, change in variant.changes.items()
        },
    }


def accepted_places(some: Sequence[int], accepts: Callable[[int], bool]) -> list[int]:
    """Return the places that are accepted, of those from the first to the last of some in ascending order.

    Examples
    --------
    >>> accepted_places([0, 4, 8], lambda place: place > 2)
    [3, 4, 5, 6, 7, 8]
    """
    found = [place for place in some[:1] if accepts(place)]
    for first, last in pairwise(some):
        if accepts(first) == accepts(last):
            found += range(first + 1, last + 1) if accepts(last) else ()
        elif last == first + 1:
            found += [last] if accepts(last) else []
        else:
            middle = (first + last) // 2
            found += [place for place in accepted_places([first, middle, last], accepts) if place > first]
    return found


def values_to_begin_with(parameter: Parameter, present: Any) -> list[Any]:
    """Return some values of a parameter besides the present one: all of a choice, a few whole numbers of a slider.

    Examples
    --------
    >>> values_to_begin_with(Parameter("n", 10, int, Slider(1, 50, 1)), 10)
    [1, 5, 20, 50]
    """
    control = parameter.control
    if isinstance(control, Choice):
        return [option for option in control.options if option != present][:MOST_VARIANTS]
    if not isinstance(control, Slider) or parameter.kind is not int or not isinstance(present, int):
        return []
    values = [control.minimum, present // 2, 2 * present, control.maximum]
    within = {int(value) for value in values if control.minimum <= value <= control.maximum} - {present}
    return sorted(within)[:MOST_VARIANTS]


def list_beginnings(starts: list[dict], given: Mapping[str, Any], known: Mapping[str, Parameter]) -> list[dict]:
    """Return the parameters with which a page can begin, each with its values, the present one among them."""
    found: dict[str, list[Any]] = {}
    for start in starts:
        if "with" in start:
            name, value = start["with"]
            found.setdefault(name, [given[name]]).append(value)
    return [
        {"name": name, "help": known[name].help, "value": given[name], "values": sorted(values, key=_order)}
        for name, values in found.items()
    ]


def _order(value: Any) -> tuple[bool, Any]:
    return isinstance(value, str), value


def apart(found: dict[str, tuple[Parameter, Any, list[Any], Change]], trials: Trials) -> dict[str, Any]:
    """Return the parameters that may be changed together: the image is then that of Python."""
    numbers = pick_numbers(facts_of_changes(found))
    apart = numbers.keys() if are_apart(numbers, trials) else set()
    ends = {name: next(end for end in values[::-1] if end != value) for name, (_, value, values, _) in found.items()}
    for one, other in list(combinations(found, 2)):
        if not {one, other} <= found.keys() or {one, other} <= apart:
            continue
        if not are_independent(one, other, ends, found, trials):
            found.pop(other)
    return found


def facts_of_changes(found: Mapping[str, tuple[Parameter, Any, list[Any], Change]]) -> dict[str, Facts]:
    """Return what is known of each parameter, as trials take it."""
    return {name: Facts(values, value, change) for name, (_, value, values, change) in found.items()}


def are_independent(one: str, other: str, ends: dict[str, Any], found: dict[str, Any], trials: Trials) -> bool:
    """Return whether the changes of two parameters, one after the other, make the image that both make together."""
    changes = {name: found[name][3] for name in (one, other)}
    return trials.are_explained(changes, {name: ends[name] for name in (one, other)})


def compile_first_steps(model: Any) -> None:
    """Let what is compiled in a first step be compiled: rules, above all."""
    same = deepcopy(model)
    same.run(2)


def compile_pages(names: Iterable[str] | None = None) -> list[str]:
    """Compile and store what pages of models of the gallery need, and return the names of those that can be pages.

    A process for each processor works on them.

    Parameters
    ----------
    names : iterable of str, optional
        By default all models whose functions are compiled beforehand.
    """
    wanted = list(needed_functions() if names is None else names)
    with ProcessPoolExecutor(min(count_processors(), len(wanted)), get_context("spawn")) as pool:
        return [name for name, able in zip(wanted, pool.map(is_able, wanted), strict=True) if able]


def is_able(name: str) -> bool:
    """Compile and store what the page of a model of the gallery needs, and return whether it can be a page."""
    try:
        LivePage(find_model(name)(rng=1), ()).parts()
    except ExportError:  # something in a step is Python
        return False
    return True


def can_be_made_anew(model: Any) -> bool:
    """Return whether the constructor of a model's class, with the model's parameters, makes it as it is."""
    given = parameters_of_run(model)
    try:
        other = type(model)(**given)
        return other.run(model.steps).state_hash() == deepcopy(model).state_hash()  # its sensors are not to be read
    except Exception:  # of a user's constructor
        return False


def _seed_of(model: Any) -> int:
    seed = parameters_of_run(model).get("rng")
    return int(seed) if isinstance(seed, (int, np.integer)) else 0


def title_of(name: str) -> str:
    """Return the name or address of a model as a title.

    Examples
    --------
    >>> title_of("best_of_n"), title_of("./mine.py:DoorModel")
    ('Best of n', 'DoorModel')
    """
    words = name.rpartition(":")[2].replace("_", " ")
    return words[:1].upper() + words[1:]


def overlapping(changes: Mapping[str, Change]) -> set[str]:
    """Return the names of parameters that change bytes which another changes too."""
    names: set[str] = set()
    touched = {name: bytes_changed_by(change) for name, change in changes.items()}
    for one, other in combinations(touched, 2):
        if touched[one] & touched[other]:
            names |= {other} if not changes[one].bytes else {one}
    return names


def bytes_changed_by(change: Change) -> set[int]:
    """Return the places of all bytes that a change may write."""
    copied = {place + k for places in change.copies.values() for place in places for k in range(8)}
    return copied | set(change.places)


def difference(content: bytes, other: bytes) -> bytes:
    r"""Return where bytes differ from others: zero where they do not.

    Examples
    --------
    >>> difference(b"ab", b"aa")
    b'\x00\x03'
    """
    return (np.frombuffer(content, np.uint8) ^ np.frombuffer(other, np.uint8)).tobytes()


IMPORTS = (
    'import { Stage, fillLegend, togglesOf } from "../viewing/canvas.js";\n',
    'import { LiveModel, added, inflatedText } from "./live.js";\n',
)


def live_script() -> str:
    """Return all that the page runs."""
    texts = palette.palette_script() + text_of("viewing/canvas.js", "viewing/elements.js", "live/live.js")
    player = text_of("live/live_player.js")
    for line in IMPORTS:
        player = player.replace(line, "")
    return "\n" + texts + player


def live_style() -> str:
    """Return how the page looks, with the colours of its two themes."""
    return palette.style_sheet(":root", ':root[data-theme="dark"]') + text_of("viewing/player.css", "live/live.css")


def live_sources() -> dict[str, str]:
    """Return what the page may run and load, as `policy` takes it: its own script, and the module in it."""
    return {
        "script-src": f"{source_of(live_script())} 'wasm-unsafe-eval'",
        "style-src": "'unsafe-inline'",
        "img-src": "data: blob:",
    }


def live_text(about: dict[str, Any], texts: Mapping[str, str]) -> str:
    """Return the page of a model: what it reads first, and its other parts as text."""
    facts = json.dumps(about, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    elements = [f'<script type="application/json" id="about">{facts}</script>']
    elements += [f'<script type="text/plain" id="{name}">{text}</script>' for name, text in texts.items()]
    page = text_of("live/live.html")
    parts = {"policy": policy(live_sources(), in_page=True), "style": live_style(), "script": live_script()}
    for name, text in {**parts, "data": "\n".join(elements)}.items():
        page = page.replace(f"{{{{{name}}}}}", text, 1)
    return page


def check_target(path: Path, overwrite: bool) -> None:
    """Refuse a file that is there already, and a folder that is not, or cannot be written to."""
    if os.path.lexists(path) and not overwrite:
        raise ExportError(
            f"{show_path(path)} exists already; choose another name, or replace it with overwrite=True (--force)"
        )
    if not path.parent.is_dir():
        folder = show_path(path.parent)
        raise ExportError(f"folder {folder} does not exist; make it first, or choose another place")
    check_writable(path.parent)


def export(
    model: Any,
    path: str | os.PathLike[str],
    *,
    live: bool = True,
    seeds: int | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Path:
    """Write a page that runs the model in any browser: one file, which needs neither Python nor a network.

    The page has the bits of Python: its fingerprint after any number of steps is `state_hash()`. It begins as the model
    began; a model that was put together by hand, or changed, begins as it stands, with its own seed only.

    Parameters
    ----------
    path : str or Path
        A .html file.
    live : bool
        True; a run that was recorded is exported by ``mesa_swarm.viewing.export.export``.
    seeds : int, optional
        The page can begin with the seeds 1 to this, besides the model's own; by default with 20, or as many as 400 kB
        hold.
    overwrite : bool
        Whether a file that is there is replaced.
    progress : bool
        Whether to show a bar.

    Returns
    -------
    Path

    Raises
    ------
    ExportError
        If something in a step is Python, in one line that names it, the file exists already or cannot be written.
    InvalidValueError
        If the path is not that of a .html file, or live is False.

    Examples
    --------
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> FireFighting(n_robots=3, rng=1).export("fires.html", live=True)  # doctest: +SKIP
    PosixPath('fires.html')
    """
    if live is not True:
        raise InvalidValueError(
            f"live is {shortened(live)}; expected True: for a replay record the run, and export the recording"
        )
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InvalidValueError(f"path is {shortened(str(path))}; expected a .html file")
    check_target(target, overwrite)
    count = SEEDS if seeds is None else check_count("seeds", seeds, maximum=MOST_SEEDS)
    page = LivePage(model, range(1, count + 1), progress)
    with draft_of(target, ExportError) as draft:
        draft.write_text(page.text(None if seeds is not None else MOST_PAGE_BYTES), encoding="utf-8")
    return target


__all__ = ["LivePage", "export"]
