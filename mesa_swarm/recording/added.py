"""Processes and parts of a model by the names of their classes: those that no constructor adds are made again."""

from collections.abc import Callable
from typing import Any

from mesa import Agent, Model

from mesa_swarm.base.errors import RecordingError, asked, check_name, shortened
from mesa_swarm.fire.part import BURNING
from mesa_swarm.kernels.part import Part, list_attributes
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import Checkpointed, attributes_of, refuse_attributes
from mesa_swarm.recording.attributes import ModelPacked, attribute_from_json, attribute_to_json
from mesa_swarm.recording.making import (
    OF_PACKAGE,
    check_made,
    check_part_class,
    check_process_class,
    classes_near,
    is_class,
)


def added_to_json(model: EngineModel, packed: ModelPacked) -> dict:
    """Return the processes by their numbers, and the parts that were added by their names, if there are any.

    Of parts also all attributes are stored, with which one is made that no constructor adds.
    """
    processes = [[number, class_address(process)] for number, process in model.parts.processes.numbered.items()]
    parts = [[part.name, class_address(part), _made_to_json(part, packed)] for part in model.parts.added()]
    return {name: listed for name, listed in (("processes", processes), ("added", parts)) if listed}


def class_address(made: Any) -> str:
    """Return the address of the class of a process or a part."""
    return f"{type(made).__module__}.{type(made).__qualname__}"


def _made_to_json(part: Part, packed: ModelPacked) -> dict:
    return {
        name: attribute_to_json(value, f"{part.name}'s {name}", packed) for name, value in list_attributes(part).items()
    }


def restore_added(model: EngineModel, facts: dict, packed: ModelPacked) -> None:
    """Give a model the stored processes and parts: remove those that are not stored, make the others.

    They are made without their constructors, of classes in the module of the model's class; their state follows.
    """
    _restore_processes(model, {number: kind for number, kind in facts.get("processes", ())}, facts)
    stored = {check_name("name of a part", name): (kind, values) for name, kind, values in facts.get("added", ())}
    for part in model.parts.added():
        if part.name not in stored:
            model.remove_part(part.name)
    for name, (kind, values) in stored.items():
        if name not in model.parts:
            part = _made(model, kind, "part", "stages", check_part_class)
            check_made(part, values)
            refuse_attributes(part, values)
            for attribute, content in values.items():
                object.__setattr__(part, attribute, attribute_from_json(None, attribute, content, packed))
            model.add_part(part)
        elif not _is_kind(type(model.parts[name]), kind):
            raise RecordingError(_odd(model, kind, "part"))


def _restore_processes(model: EngineModel, stored: dict[int, str], facts: dict) -> None:
    part = model.parts.processes
    for number, process in list(part.numbered.items()):
        if number not in stored:
            model.remove_process(process)
    if BURNING in stored:
        model.parts.fires.begin_burning()
    for number, kind in stored.items():
        if type(number) is not int or number < 0:
            raise RecordingError(f"invalid number of a process: {shortened(number)}")
        own = part.numbered.get(number)
        if own is None:
            own = _made(model, kind, "process", "step", check_process_class)
            part.have({**part.numbered, number: own})
            names = _names_of(facts, "processes", f"{number} ")
            check_made(own, () if isinstance(own, Checkpointed) else names)
        elif not _is_kind(type(own), kind):
            raise RecordingError(_odd(model, kind, "process"))
    part.have({number: part.numbered[number] for number in sorted(part.numbered)})


def _names_of(facts: dict, part: str, begin: str) -> list[str]:
    """Return the names of the attributes that are stored of a part, or of a process, whose names begin so."""
    stored = facts["parts"].get(part, {}).get("stored", {})
    return [name.removeprefix(begin) for name in stored if name.startswith(begin)]


def check_addable(made: Any, kind: str, model: EngineModel) -> None:
    """Refuse a process or a part, added since a recording began, that would not be made again."""
    (check_process_class if kind == "process" else check_part_class)(type(made))
    if type(made) not in (*classes_near(model), *OF_PACKAGE):
        raise RecordingError(
            f"{kind} {type(made).__name__} was added by hand, and its class is not in {type(model).__module__}; "
            f"define it there, or add the {kind} in the constructor"
        )
    check_made(made, () if isinstance(made, Checkpointed) else attributes_of(made))


def _made(model: EngineModel, kind: str, what: str, method: str, check: Callable[[type], None]) -> Any:
    """Make a process or a part of a class in the model's own module or the package, without its constructor."""
    classes = (*classes_near(model), *OF_PACKAGE)
    found = next((near for near in classes if _is_kind(near, kind) and callable(asked(near, method))), None)
    if found is None or issubclass(found, Agent | Model):
        raise RecordingError(_odd(model, kind, what))
    check(found)
    return object.__new__(found)


def _is_kind(kind: type, stored: str) -> bool:
    """Return whether an object of this class may have been stored, see `is_class`."""
    return is_class(kind, stored.removesuffix(f".{kind.__qualname__}"), kind.__qualname__) and stored.endswith(
        f".{kind.__qualname__}"
    )


def _odd(model: EngineModel, kind: str, what: str) -> str:
    return (
        f"{what} {shortened(kind)} is not one that the constructor of {type(model).__name__} adds, and its class is "
        f"not in {type(model).__module__}; add the {what} in the constructor, or define its class there"
    )
