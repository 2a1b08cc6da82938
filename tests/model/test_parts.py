"""Dataclasses of the package: parts do not change, take no other attributes, and do not compare arrays."""

import ast
from pathlib import Path
from typing import NamedTuple

PACKAGE = Path(__file__).parents[2] / "mesa_swarm"
# Bound to a swarm, these remember things about its robots.
MUTABLE = {
    *("Align", "Explore", "HeadOn", "Lead", "MatchVelocity", "Perimeter", "PolicyLayer", "VelocityMatching"),
    *("HebbianLearning", "LearnFireWheels", "LearnFires", "Learner", "QLearning", "TableQLearning", "WireFittedQ"),
    "Checkpoint",  # grows while it is written
    *("CanvasView", "GridResults"),  # what has arrived so far
    "Tries",  # an exercise counts them
    "_Motors",  # drives that users derive from it have attributes of their own
}
# Layers and policies inherit from classes without slots, or compute attributes once; tasks check what they inherit with
# super(), which slots break.
WITHOUT_SLOTS = MUTABLE | {
    *("Avoid", "Cohere", "Cruise", "FightFire", "Follow", "Gather", "Push", "Respond", "SeekHeat", "Separate"),
    *("Aggregation", "CollisionAvoidance", "ExtinguishFires", "FindFires", "FireTask", "Foraging", "Task"),
    *("ModelInfo", "Scene", "ValidationGate", "WorldDrawing"),
    *("NetworkPolicy", "Networks", "OnnxPolicy", "QPolicy", "ReflexPolicy", "TablePolicy", "WirePolicy"),
}


class Part(NamedTuple):
    """A dataclass of the package: the flags that are set, the annotations of its fields, its methods."""

    flags: set[str]
    fields: list[str]
    methods: set[str]

    @property
    def compares_fields(self):
        return "eq=False" not in self.flags and "__eq__" not in self.methods


def parts():
    """Return all dataclasses by name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for decorator in getattr(node, "decorator_list", []):
                if isinstance(node, ast.ClassDef) and ast.unparse(decorator).startswith("dataclass"):
                    flags = {ast.unparse(keyword) for keyword in getattr(decorator, "keywords", [])}
                    fields = [ast.unparse(line.annotation) for line in node.body if isinstance(line, ast.AnnAssign)]
                    methods = {line.name for line in node.body if isinstance(line, ast.FunctionDef)}
                    found[node.name] = Part(flags, fields, methods)
    return found


PARTS = parts()


def test_a_part_cannot_be_changed_unless_it_remembers():
    assert {name for name, part in PARTS.items() if "frozen=True" not in part.flags} == MUTABLE


def test_a_part_has_slots_unless_it_inherits_from_a_class_without():
    assert {name for name, part in PARTS.items() if "slots=True" not in part.flags} == WITHOUT_SLOTS


def test_a_part_that_holds_arrays_is_not_compared_by_its_fields():
    holds = {name for name, part in PARTS.items() if any("ndarray" in field for field in part.fields)}
    assert len(holds) > 20
    assert not {name for name in holds if PARTS[name].compares_fields}
