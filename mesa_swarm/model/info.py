r"""What a model is, how it works, and what to try: its docstrings, its code, and a small file beside its module.

The file has the module's name and ends in ``.toml``: ``mine.toml`` beside ``mine.py``. All of its keys are optional::

    how = "One paragraph on how it works."
    watch = "What to watch."
    source = "The full reference."
    speed = 120  # steps a second at which a page plays it first
    patterns = "Observations that the model must reproduce."

    [concepts]  # of the ODD protocol; others are found in the model
    emergence = "What arises from the rules."

    [[try]]
    label = "Half as many"
    text = "One sentence of what one should see."
    settings = { n_robots = 5 }

    [[equations]]
    latex = 'v = \tfrac{1}{2} (v_L + v_R)'
    text = "What the letters are."
"""

import ast
import inspect
import re
import shlex
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from mesa_swarm.base.errors import (
    InvalidValueError,
    MapError,
    SwarmError,
    check_number,
    shortened,
    unknown_name,
    without_middle,
)
from mesa_swarm.base.wording import in_brief
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.layer import CompiledLayer
from mesa_swarm.maps.map_parts import decode_text, file_content
from mesa_swarm.maps.toml import parse_toml
from mesa_swarm.model.gallery import PACKAGE, description, find_model, model_address, short_name
from mesa_swarm.model.parameters import Parameter, parameters_of

LARGEST_INFO_FILE = 100_000
TEXTS = ("how", "watch", "source", "patterns")
KEYS = (*TEXTS, "speed", "concepts", "try", "equations")
# Design concepts of the ODD protocol that only a text can state.
CONCEPTS = (
    "principles",
    "emergence",
    "adaptation",
    "objectives",
    "learning",
    "prediction",
    "interaction",
    "collectives",
)
USUAL_SPEED = 60.0
SLOWEST, FASTEST = 0.5, 1000.0
# Headings of a model's docstring, and what the text below each is used for where the file has none.
WHAT = "WHAT IS IT?"
HEADINGS = {"HOW IT WORKS.": "how", "THINGS TO NOTICE.": "watch", "REFERENCE.": "source"}
OTHERS = ("HOW TO USE IT.", "THINGS TO TRY.", "EXTENDING IT.")
FORMATTING = re.compile(r" *# fmt: skip$", re.MULTILINE)  # a note to the formatter of the source
HEADING = re.compile("|".join(map(re.escape, (WHAT, *HEADINGS, *OTHERS))))


@dataclass(frozen=True, kw_only=True, slots=True)
class Preset:
    """Settings of a model to try, and what one should see.

    Parameters
    ----------
    label : str
        A few words, for a button.
    text : str
        One sentence.
    settings : mapping
        Values of parameters; all others have their defaults.
    """

    label: str
    text: str
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Equation:
    """An equation in LaTeX, and what its letters are."""

    latex: str
    text: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Listing:
    """Code that a model uses: the name of a layer or of a model, the module that it is from, and the source."""

    name: str
    module: str
    code: str


@dataclass(frozen=True, kw_only=True)
class ModelInfo:
    """What a model is, how it works, and what to try; made by `model_info`.

    Parameters
    ----------
    name : str
        Name or address of the model.
    model_class : type
    model : SwarmModel, optional
        Whose layers `code` shows; without it, those of a model with all defaults.
    what, how, watch, source, patterns : str
        Empty if not known.
    concepts : mapping
        Texts on design concepts of the ODD protocol, by their names.
    speed : float
        At which a page plays it at first, so that something is seen to happen, 0.5 to 1000 steps a second.
    presets : tuple of Preset
    equations : tuple of Equation
    """

    name: str
    model_class: type
    model: Any = None
    what: str = ""
    how: str = ""
    watch: str = ""
    source: str = ""
    patterns: str = ""
    concepts: Mapping[str, str] = field(default_factory=dict)
    speed: float = USUAL_SPEED
    presets: tuple[Preset, ...] = ()
    equations: tuple[Equation, ...] = ()

    @property
    def title(self) -> str:
        """The model's name as a title."""
        return short_name(self.name).replace("_", " ").capitalize()

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The model's parameters by name."""
        return parameters_of(self.model_class)

    @cached_property
    def code(self) -> tuple[Listing, ...]:
        """The rules of the layers that drive the robots, then the model itself."""
        return tuple(_listings(self.model_class, self.built))

    @cached_property
    def built(self) -> Any:
        """The model, or one with all defaults; None if the class cannot be built so."""
        return _build_default(self.model_class) if self.model is None else self.model

    def command(self, preset: Preset) -> str:
        """Return the command that runs a preset.

        Examples
        --------
        >>> info = model_info("boids")
        >>> info.command(Preset(label="", text="", settings={"n_robots": 5}))
        'mesa-swarm run boids --set n_robots=5'
        """
        settings = [f"--set {shlex.quote(f'{name}={value}')}" for name, value in preset.settings.items()]
        return " ".join(["mesa-swarm run", shlex.quote(self.name), *settings])

    def call(self, preset: Preset) -> str:
        """Return the Python expression that shows a preset in a notebook."""
        settings = "".join(f", {name}={value!r}" for name, value in preset.settings.items())
        return f"mesa_swarm.show({self.name!r}, rng=1{settings})"

    def markdown(self, *, level: int = 3, command: Callable[[Preset], str] | None = None) -> str:
        """Return all of it as Markdown.

        Parameters
        ----------
        level : int
            Of the title's heading; sections have the next one.
        command : function, optional
            Returns the line that runs a preset, by default `call`.
        """
        return "\n\n".join(_markdown(self, "#" * level, command or self.call)) + "\n"

    def _repr_markdown_(self) -> str:
        return self.markdown()


def model_info(model: Any) -> ModelInfo:
    """Return what is known about a model: its docstring, its code, and the file beside its module, if there is one.

    Parameters
    ----------
    model : str, class or SwarmModel
        Name or address of a model, its class, or a model, whose own layers are then shown as code.

    Returns
    -------
    ModelInfo
        As the last line of a cell of a notebook it is shown as text with equations and code.

    Raises
    ------
    InvalidValueError
        If the file beside the module has unknown keys, or settings that the model would refuse.

    Examples
    --------
    >>> info = model_info("boids")
    >>> info.title, len(info.presets), info.code[0].name
    ('Boids', 3, 'Separate')
    """
    kind = find_model(model) if isinstance(model, str) else model if isinstance(model, type) else type(model)
    if not hasattr(kind, "add_robots"):
        raise InvalidValueError(f"model is {shortened(model)}; expected a SwarmModel, or its class, name or address")
    name = model if isinstance(model, str) else _name_of(kind)
    instance = model if not isinstance(model, str | type) else None
    file = info_file(kind)
    entries = _read(file, kind) if file is not None and file.is_file() else {}
    return ModelInfo(name=name, model_class=kind, model=instance, **_describe_class(kind) | entries)


def info_file(model_class: type) -> Path | None:
    """Return where the file beside a model's module is, or would be; None for a class that comes from no file."""
    file = getattr(sys.modules.get(model_class.__module__), "__file__", None)
    return Path(file).with_suffix(".toml") if file else None


def _name_of(model_class: type) -> str:
    module = model_class.__module__
    return module.rpartition(".")[2] if module.startswith(f"{PACKAGE}.") else model_address(model_class)


def _describe_class(model_class: type) -> dict[str, str]:
    """Return the parts of a model's docstring: that of its module, if it has the headings, else that of the class."""
    of_module = inspect.cleandoc(getattr(sys.modules.get(model_class.__module__), "__doc__", None) or "")
    if WHAT not in of_module:
        return {"what": inspect.cleandoc(vars(model_class).get("__doc__") or "") or of_module}
    starts = [*HEADING.finditer(of_module)]
    ends = [start.start() for start in starts[1:]] + [len(of_module)]
    parts = {start[0]: _join_lines(of_module[start.end() : end]) for start, end in zip(starts, ends, strict=True)}
    return {"what": parts[WHAT]} | {name: parts[head] for head, name in HEADINGS.items() if head in parts}


def _join_lines(text: str) -> str:
    """Return paragraphs, each on one line."""
    return "\n\n".join(" ".join(part.split()) for part in re.split(r"\n\s*\n", text.strip()))


def _read(file: Path, model_class: type) -> dict[str, Any]:
    """Return the contents of a file; what is wrong in it is named with the file and the key."""
    try:
        inside = parse_toml(decode_text(file_content(file, LARGEST_INFO_FILE), file.name), file.name)
    except MapError as error:  # these functions read maps as well; it names the file
        raise InvalidValueError(str(error)) from None
    try:
        for key in inside:
            if key not in KEYS:
                raise InvalidValueError(unknown_name("key", key, KEYS))
        entries: dict[str, Any] = {key: _join_lines(_text(key, inside[key])) for key in TEXTS if key in inside}
        parameters = parameters_of(model_class)
        if "speed" in inside:
            entries["speed"] = check_number("speed", inside["speed"], minimum=SLOWEST, maximum=FASTEST)
        if "concepts" in inside:
            entries["concepts"] = _concepts(inside["concepts"])
        if "try" in inside:
            entries["presets"] = tuple(
                Preset(label=_text(f"{key}, label", table["label"]),
                       text=_join_lines(_text(f"{key}, text", table["text"])),
                       settings=_settings(f"{key}, settings", table["settings"], parameters))
                for key, table in _tables("try", inside["try"], ("label", "text", "settings"))
            )  # fmt: skip
        if "equations" in inside:
            entries["equations"] = tuple(
                Equation(**{name: _text(f"{key}, {name}", table[name]) for name in ("latex", "text")})
                for key, table in _tables("equations", inside["equations"], ("latex", "text"))
            )
    except SwarmError as error:
        raise InvalidValueError(without_middle(f"{file.name}: {error}")) from None
    return entries


def _text(key: str, value: object) -> str:
    if isinstance(value, str) and value.strip():
        return value.strip()
    raise InvalidValueError(f"{key} is {shortened(value)}; expected a text")


def _concepts(value: object) -> dict[str, str]:
    if not isinstance(value, dict):
        raise InvalidValueError(f"concepts is {shortened(value)}; expected a table of texts, headed [concepts]")
    for name in value:
        if name not in CONCEPTS:
            raise InvalidValueError(unknown_name("concept", name, CONCEPTS))
    return {name: _join_lines(_text(f"concepts, {name}", text)) for name, text in value.items()}


def _tables(key: str, value: object, names: tuple[str, ...]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each table of a list, with what errors call it; each has exactly these names."""
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InvalidValueError(f"{key} is {shortened(value)}; expected tables, each headed [[{key}]]")
    for number, table in enumerate(value, start=1):
        for name in table:
            if name not in names:
                raise InvalidValueError(f"{key} {number}: {unknown_name('key', name, names)}")
        for name in names:
            if name not in table:
                raise InvalidValueError(f"{key} {number} has no {name}; expected {', '.join(names)}")
        yield f"{key} {number}", table


def _settings(key: str, value: object, parameters: Mapping[str, Parameter]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InvalidValueError(
            f"{key} is {shortened(value)}; expected values of parameters, such as {{ n_robots = 5 }}"
        )
    for name in value:
        if name not in parameters:
            raise InvalidValueError(f"{key}: {unknown_name('parameter', name, parameters)}")
    try:
        return {name: parameters[name].checked(setting) for name, setting in value.items()}
    except SwarmError as error:
        raise InvalidValueError(f"{key}: {error}") from None


def _build_default(model_class: type) -> Any:
    """Return a model with all defaults, None if it cannot be built so."""
    try:
        return model_class(rng=1)
    except Exception:  # a class of a user's may raise anything, and may need parameters
        return None


def _listings(model_class: type, model: Any) -> Iterator[Listing]:
    functions = []
    for layer in getattr(getattr(model, "control", None), "layers", ()):
        function = _deciding(layer)
        if isinstance(function, FunctionType) and function not in functions:
            functions.append(function)
            code = "\n\n".join(map(_source, _with_callees(function, type(layer))))
            if code:
                yield Listing(name=layer.name, module=function.__module__, code=code)
    code = _source_of_model(model_class)
    if code:
        yield Listing(name=model_class.__name__, module=model_class.__module__, code=code)


def _deciding(layer: Any) -> Any:
    """Return the function by which a layer decides, or that names the compiled one, as it is written."""
    if isinstance(layer, Behaviour):
        return layer.rule.function
    kind = type(layer)
    is_compiled = isinstance(layer, CompiledLayer) and kind.decide is CompiledLayer.decide
    return getattr(kind, "arguments" if is_compiled else "decide", None)


def _with_callees(function: FunctionType, kind: type) -> list[FunctionType]:
    """Return a function, and the functions of its module and the methods that it uses, in their order in the file."""
    functions = [function]
    for caller in functions:
        values = inspect.getclosurevars(caller).globals.values()
        methods = [getattr(kind, name, None) for name in caller.__code__.co_names]
        for value in (*values, *methods):
            # Compiled functions as they were written; of a property, what computes it.
            plain = getattr(value, "py_func", None) or getattr(value, "fget", None) or value
            if isinstance(plain, FunctionType) and plain.__module__ == caller.__module__ and plain not in functions:
                functions.append(plain)
    return sorted(functions, key=lambda function: function.__code__.co_firstlineno)


def _source(part: FunctionType | type | ModuleType) -> str:
    """Return source as it stands in its file, empty if the file is not there."""
    try:
        return FORMATTING.sub("", textwrap.dedent(inspect.getsource(part)).strip())
    except (OSError, TypeError):
        return ""


def _source_of_model(model_class: type) -> str:
    """Return the source of a model's module after its docstring, or of the class alone where there is no file."""
    module = sys.modules.get(model_class.__module__)
    source = _source(module) if module is not None and getattr(module, "__file__", None) else ""
    if not source:
        return _source(model_class)
    first = next(iter(ast.parse(source).body), None)
    is_docstring = isinstance(first, ast.Expr) and isinstance(getattr(first.value, "value", None), str)
    return "\n".join(source.splitlines()[first.end_lineno if first and is_docstring else 0 :]).strip()


def _markdown(info: ModelInfo, head: str, command: Callable[[Preset], str]) -> Iterator[str]:
    yield f"{head} {info.title}"
    yield info.what or description(info.model_class)
    for title, text in (("How it works", info.how), ("What to watch", info.watch)):
        if text:
            yield f"{head}# {title}\n\n{text}"
    if info.presets:
        yield f"{head}# Things to try"
        yield "\n".join(f"- **{preset.label}.** {preset.text} `{command(preset)}`" for preset in info.presets)
    if info.equations:
        yield f"{head}# Equations"
        yield "\n\n".join(f"$${equation.latex}$$\n\n{equation.text}" for equation in info.equations)
    if info.source:
        yield f"{head}# Source\n\n{info.source}"
    yield _fold_code("Parameters", parameter_table(info.parameters))
    for listing in info.code:
        yield _fold_code(f"Code: {listing.name} <small>{listing.module}</small>", f"```python\n{listing.code}\n```")


def parameter_table(parameters: Mapping[str, Parameter]) -> str:
    """Return parameters, their defaults and what they mean as a table in Markdown."""
    rows = [f"| `{p.name}` | {in_brief(p.default)} | {p.help} |" for p in parameters.values()]
    return "\n".join(["| parameter | default | meaning |", "|---|---|---|", *rows]).replace("<", "&lt;")


def _fold_code(title: str, text: str) -> str:
    return f'<details markdown="1">\n<summary>{title}</summary>\n\n{text}\n\n</details>'
