"""A model's description by the ODD protocol, made of the model itself, its docstring and the file beside it.

V. Grimm et al., The ODD protocol for describing agent-based and other simulation models: a second update to improve
clarity, replication, and structural realism, Journal of Artificial Societies and Social Simulation 23 (2020) 7.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.model.info import ModelInfo, parameter_table

# In the order of the protocol; what is None is found in the model.
CONCEPTS = {
    "principles": "Basic principles",
    "emergence": "Emergence",
    "adaptation": "Adaptation",
    "objectives": "Objectives",
    "learning": "Learning",
    "prediction": "Prediction",
    "sensing": "Sensing",
    "interaction": "Interaction",
    "stochasticity": "Stochasticity",
    "collectives": "Collectives",
    "observation": "Observation",
}
PHASES = (
    "**Sense**: every sensor reads what is there, with its errors if it has any.",
    "**Exchange**: robots with radios within range hear each other.",
    "**Decide**: the layers below are evaluated for each robot, on what it sensed.",
    "**Act**: actuators do what was decided.",
    "**Move**: each robot follows the exact arc of its command, less slip.",
    "**Resolve**: bodies that overlap are pushed apart; loads are pushed.",
    "**Process**: what else happens, in the order below; fields diffuse and evaporate.",
    "**Collect**: reporters store their values.",
)


def odd(info: ModelInfo, *, level: int = 2) -> str:
    """Return the description of a model in the seven elements of the ODD protocol, as Markdown.

    Parameters
    ----------
    info : ModelInfo
        Of a model that can be built with its defaults.
    level : int
        Of the headings of the elements.

    Raises
    ------
    InvalidValueError
        If the model cannot be built without parameters.

    Examples
    --------
    >>> from mesa_swarm import model_info
    >>> text = odd(model_info("boids"))
    >>> [line for line in text.splitlines() if line.startswith("## ")][1]
    '## 2. Entities, state variables, and scales'
    """
    model = info.built
    if model is None:
        raise InvalidValueError(f"{info.name} cannot be built without parameters; ODD describes a model with defaults")
    patterns = f"\n\nPatterns used to evaluate the model: {info.patterns}" if info.patterns else ""
    elements = {
        "Purpose and patterns": info.what + patterns,
        "Entities, state variables, and scales": _entities(model),
        "Process overview and scheduling": _schedule(model),
        "Design concepts": _concepts(info, model),
        "Initialization": _initialization(info, model),
        "Input data": f"None besides the map `{model.map.name}`: nothing is read while the model runs.",
        "Submodels": _submodels(info, "#" * (level + 1)),
    }
    head = "#" * level
    texts = (f"{head} {number}. {name}\n\n{text}" for number, (name, text) in enumerate(elements.items(), start=1))
    return "\n\n".join(texts) + "\n"


def _entities(model: Any) -> str:
    x0, y0, x1, y1 = model.map.bounds
    scale = model.scale
    unit = "without a physical unit"
    if scale is not None:
        unit = f"{scale.units_per_metre:,.4g} units are a metre, a step lasts {scale.seconds_per_step:.3g} s"
    space = f"The world is a plane of {x1 - x0:,g} x {y1 - y0:,g} map units with walls around it; {unit}."
    rows = [*_robot_rows(model), *_body_rows(model), *_other_rows(model)]
    return f"{space} Time passes in steps.\n\n" + "\n".join(["| entity | number | state |", "|---|---|---|", *rows])


def _robot_rows(model: Any) -> Iterator[str]:
    of_design = Counter(model.swarm.design.tolist())
    memory = sorted(name for name in model.swarm.columns if name.partition(".")[0].isdigit())
    for index, design in enumerate(model.swarm.designs):
        acts = (f"act.{part.name}" for part in design.actuators)
        columns = ["position", "heading", "readings", "command", "layer", *memory, *acts]
        about = f"radius {design.radius:g}, at most {design.max_speed:g} units a step"
        yield f"| robot `{design.name}`: {about} | {of_design[index]} | {', '.join(columns)} |"


def _body_rows(model: Any) -> Iterator[str]:
    states = {"obstacle": "position, shape", "fire": "position, area, temperature", "load": "pose"}
    for kind, number in sorted(Counter(body.kind for body in model.bodies).items()):
        yield f"| {kind} | {number} | {states.get(kind, 'pose')} |"


def _other_rows(model: Any) -> Iterator[str]:
    for name, field in model.fields.items():
        high, wide = field.values.shape
        yield f"| field `{name}` | {high} x {wide} cells | a value in each cell |"
    if len(model.state):
        yield f"| the model | 1 | {', '.join(f'`{name}`' for name in model.state)} |"


def _layers(model: Any) -> list[Any]:
    control = model.control
    arbiters = control.values() if isinstance(control, dict) else [control]
    return [layer for arbiter in arbiters for layer in getattr(arbiter, "layers", ())]


def _schedule(model: Any) -> str:
    phases = "\n".join(f"{number}. {text}" for number, text in enumerate(PHASES, start=1))
    arbiter = type(model.control).__name__
    way = {
        "Subsumption": "The first active layer drives",
        "VectorSum": "The commands of all active layers are summed",
    }.get(arbiter, f"{arbiter} arbitrates")
    layers = "\n".join(f"- `{_one_line(layer)}`" for layer in _layers(model))
    processes = ", ".join(f"`{type(process).__name__}`" for process in model.processes) or "none"
    return (
        "A step has a fixed order. All robots act on the state that was published after the step before, so that the "
        f"order of robots has no effect.\n\n{phases}\n\n{way}, in this order:\n\n{layers}\n\nProcesses: {processes}."
    )


def _one_line(part: Any) -> str:
    return repr(part).removeprefix("<Behaviour ").removesuffix(">")


def _concepts(info: ModelInfo, model: Any) -> str:
    concepts = {**info.concepts, **_own_concepts(model)}
    return "\n\n".join(f"**{title}.** {concepts[name]}" for name, title in CONCEPTS.items() if name in concepts)


def _own_concepts(model: Any) -> dict[str, str]:
    reporters = ", ".join(f"`{name}`" for name in model.datacollector.model_reporters)
    results = ", ".join(f"`{name}`" for name in model.results()) if hasattr(model, "results") else ""
    return {
        "sensing": f"A robot knows only what it senses: {'; '.join(_sensing(model))}. Its pose is unknown to it.",
        "stochasticity": (
            "All random numbers follow from one seed, in independent streams: placement, decisions, slip, noise and "
            "the model's own. The same seed gives the same run, bit for bit."
        ),
        "observation": f"After each step: {reporters}." + (f" Of a whole run: {results}." if results else ""),
    }


def _sensing(model: Any) -> Iterator[str]:
    for design in {design.name: design for design in model.swarm.designs}.values():
        sensors = Counter(
            (type(sensor).__name__, sensor.name, getattr(sensor, "range", None)) for sensor in design.sensors
        )
        parts = (
            f"{number} `{kind}` (`me.{name}`{f', range {reach:g}' if reach else ''})"
            for (kind, name, reach), number in sensors.items()
        )
        yield f"`{design.name}` has {', '.join(parts)}"
    if model.communication is not None:
        yield f"messages within {model.communication.range:g} units"


def _initialization(info: ModelInfo, model: Any) -> str:
    table = parameter_table({name: parameter for name, parameter in info.parameters.items() if name != "rng"})
    return (
        f"The map `{model.map.name}` with its bodies. Robots are at random free places with random headings, unless "
        f"the model places them; the seed determines all of it.\n\n{table}"
    )


def _submodels(info: ModelInfo, head: str) -> str:
    pieces = [info.how] if info.how else []
    pieces += [f"$${equation.latex}$$\n\n{equation.text}" for equation in info.equations]
    pieces += [f"{head} {part.name}\n\nFrom `{part.module}`.\n\n```python\n{part.code}\n```" for part in info.code]
    return "\n\n".join(pieces)
