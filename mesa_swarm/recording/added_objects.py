"""Processes and parts of a model by the names of their classes: those that no constructor adds are made again."""

from collections.abc import Callable
from typing import Any

from mesa import Agent, Model

from mesa_swarm.base.errors import RecordingError, check_name, read_attribute, shortened
from mesa_swarm.fire.fires_part import BURNING
from mesa_swarm.kernels.part import Part, list_attributes
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.state import Checkpointed, attributes_of, refuse_attributes
from mesa_swarm.recording.attributes import ModelPacker, attribute_from_json, attribute_to_json
from mesa_swarm.recording.made_objects import (
    OF_PACKAGE,
    check_made,
    check_part_class,
    check_process_class,
    classes_near,
    is_class,
)


def added_to_json(model: EngineModel, packer: ModelPacker) -> dict:
    """Return the processes by their numbers, and the parts that were added by their names, if there are any.

    Of parts also all attributes are stored, with which one is made that no constructor adds.
    """
    processes = [[number, class_address(process)] for number, process in model.parts.processes.numbered.items()]
    parts = [[part.name, class_address(part), _addition_to_json(part, packer)] for part in model.parts.added()]
    return {name: content for name, content in (("processes", processes), ("added", parts)) if content}


def class_address(instance: Any) -> str:
    """Return the address of the class of a process or a part."""
    return f"{type(instance).__module__}.{type(instance).__qualname__}"


def _addition_to_json(part: Part, packer: ModelPacker) -> dict:
    return {
        name: attribute_to_json(value, f"{part.name}'s {name}", packer) for name, value in list_attributes(part).items()
    }


def restore_added(model: EngineModel, facts: dict, packer: ModelPacker) -> None:
    """Give a model the stored processes and parts: remove those that are not stored, make the others.

    They are made without their constructors, of classes in the module of the model's class; their state follows.
    """
    _restore_processes(model, {number: kind for number, kind in facts.get("processes", ())}, facts)
    parts = {check_name("name of a part", name): (kind, values) for name, kind, values in facts.get("added", ())}
    for part in model.parts.added():
        if part.name not in parts:
            model.remove_part(part.name)
    for name, (kind, values) in parts.items():
        if name not in model.parts:
            part = _make_addition(model, kind, "part", "stages", check_part_class)
            check_made(part, values)
            refuse_attributes(part, values)
            for attribute, content in values.items():
                object.__setattr__(part, attribute, attribute_from_json(None, attribute, content, packer))
            model.add_part(part)
        elif not _is_kind(type(model.parts[name]), kind):
            raise RecordingError(_odd(model, kind, "part"))


def _restore_processes(model: EngineModel, kinds: dict[int, str], facts: dict) -> None:
    part = model.parts.processes
    for number, process in list(part.numbered.items()):
        if number not in kinds:
            model.remove_process(process)
    if BURNING in kinds:
        model.parts.fires.begin_burning()
    for number, kind in kinds.items():
        if type(number) is not int or number < 0:
            raise RecordingError(f"invalid number of a process: {shortened(number)}")
        present_process = part.numbered.get(number)
        if present_process is None:
            present_process = _make_addition(model, kind, "process", "step", check_process_class)
            part.have({**part.numbered, number: present_process})
            names = _names_of(facts, "processes", f"{number} ")
            check_made(present_process, () if isinstance(present_process, Checkpointed) else names)
        elif not _is_kind(type(present_process), kind):
            raise RecordingError(_odd(model, kind, "process"))
    part.have({number: part.numbered[number] for number in sorted(part.numbered)})


def _names_of(facts: dict, part: str, begin: str) -> list[str]:
    """Return the names of the attributes that are stored of a part, or of a process, whose names begin so."""
    names = facts["parts"].get(part, {}).get("stored", {})
    return [name.removeprefix(begin) for name in names if name.startswith(begin)]


def check_addable(addition: Any, kind: str, model: EngineModel) -> None:
    """Refuse a process or a part, added since a recording began, that would not be made again."""
    (check_process_class if kind == "process" else check_part_class)(type(addition))
    if type(addition) not in (*classes_near(model), *OF_PACKAGE):
        raise RecordingError(
            f"{kind} {type(addition).__name__} was added by hand, and its class is not in {type(model).__module__}; "
            f"define it there, or add the {kind} in the constructor"
        )
    check_made(addition, () if isinstance(addition, Checkpointed) else attributes_of(addition))


def _make_addition(model: EngineModel, kind: str, what: str, method: str, check: Callable[[type], None]) -> Any:
    """Make a process or a part of a class in the model's own module or the package, without its constructor."""
    classes = (*classes_near(model), *OF_PACKAGE)
    alike = (near for near in classes if _is_kind(near, kind) and callable(read_attribute(near, method)))
    near_class = next(alike, None)
    if near_class is None or issubclass(near_class, Agent | Model):
        raise RecordingError(_odd(model, kind, what))
    check(near_class)
    return object.__new__(near_class)


def _is_kind(kind: type, address: str) -> bool:
    """Return whether an object of this class may have been stored, see `is_class`."""
    return is_class(kind, address.removesuffix(f".{kind.__qualname__}"), kind.__qualname__) and address.endswith(
        f".{kind.__qualname__}"
    )


def _odd(model: EngineModel, kind: str, what: str) -> str:
    return (
        f"{what} {shortened(kind)} is not one that the constructor of {type(model).__name__} adds, and its class is "
        f"not in {type(model).__module__}; add the {what} in the constructor, or define its class there"
    )
