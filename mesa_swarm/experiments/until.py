"""Conditions that end a run: a function of the model, or an expression over its reporters, which is never executed."""

import ast
import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_choice, shortened
from mesa_swarm.experiments.fingerprints import function_hash
from mesa_swarm.experiments.reports import check_reporter, latest_number
from mesa_swarm.swarm_model import SwarmModel

LONGEST = 1_000
# The number of steps so far, unless a reporter has that name.
STEPS = "steps"
# What ended a run: the column `ended_by` of tables.
CONDITION, ALL_STEPS, MODEL = "condition", "steps", "model"
# What is missing, NaN, makes a comparison missing, unless other parts decide (Kleene's logic); a run goes on then.
COMPARISONS: dict[type, Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
ARITHMETIC: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: lambda a, b: a / b if b else math.nan,
}
OF_ONE: dict[type, Callable[[float], float]] = {
    ast.USub: operator.neg,
    ast.Not: lambda value: value if math.isnan(value) else not value,
}
EXPECTED = "expected a comparison of reporters with numbers, such as 'fires_burning == 0 and steps > 100'"


@dataclass(frozen=True, slots=True)
class EndCondition:
    """A condition on a model that ends a run, made by `checked_condition`.

    `source` is what identifies it in the key of a run: an expression over the reporters `names`, or the fingerprint of
    the code of `function`.
    """

    source: str
    names: tuple[str, ...] = ()
    function: Callable[[Any], object] | None = None

    @classmethod
    def parsed(cls, text: str) -> "EndCondition":
        """Return the condition of an expression."""
        tree = _parsed(text)
        return cls(ast.unparse(tree), tuple(dict.fromkeys(_names(tree))))

    def __call__(self, model: SwarmModel) -> bool:
        """Return whether the condition holds in the model's present state: is neither 0 nor missing."""
        if self.function is not None:
            return bool(self.function(model))
        return _is_true(_value(_parsed(self.source), partial(number_of, model)))

    def check(self, model: SwarmModel) -> None:
        """Refuse a name that is not a reporter of the model, and a reporter that does not return numbers."""
        known = model.datacollector.model_reporters
        for name in self.names:
            if name != STEPS or name in known:
                check_choice(f"report of {type(model).__name__} in until", name, (*known, STEPS))
                check_reporter(model, name)


def checked_condition(until: object) -> EndCondition | None:
    """Return a condition for a function of the model, a text or a condition; None for None.

    A text may have names of reporters (in quotes where they have spaces, as in ``"'fires out' == 7"``), ``steps``,
    numbers, ``+ - * /``, comparisons, ``and``, ``or``, ``not`` and brackets. It is parsed, never executed.

    Raises
    ------
    InvalidValueError
        If the text is anything else, or `until` is neither a text nor a function.

    Examples
    --------
    >>> checked_condition("fires_burning == 0 or 'fires out' > 3").names
    ('fires_burning', 'fires out')
    """
    if until is None or isinstance(until, EndCondition):
        return until
    if isinstance(until, str):
        return EndCondition.parsed(until)
    if not callable(until):
        raise InvalidValueError(f"until is {shortened(until)}; expected a function of the model, or an expression")
    return EndCondition(function_hash(until), function=until)


def number_of(model: SwarmModel, name: str) -> float:
    """Return the value of a reporter after the last step, NaN where it is missing; or the number of steps."""
    if name == STEPS and name not in model.datacollector.model_reporters:
        return model.completed
    return latest_number(model, name)


@lru_cache(maxsize=64)
def _parsed(text: str) -> ast.expr:
    """Return the tree of an expression, after refusing all but comparisons of reporters."""
    try:
        if len(text) > LONGEST:
            raise ValueError
        tree = ast.parse(text.strip(), mode="eval").body
        _value(tree, lambda name: 1.0)
        if not any(_names(tree)):
            raise ValueError
    except (SyntaxError, ValueError, OverflowError, RecursionError, MemoryError):
        raise InvalidValueError(f"until is {shortened(text)}; {EXPECTED}") from None
    return tree


def _names(node: ast.AST) -> Iterator[str]:
    """Yield the names of reporters in a tree, in the order of the text."""
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for part in ast.iter_child_nodes(node):
        yield from _names(part)


def _value(node: ast.expr, number: Callable[[str], float]) -> float:
    """Return the value of a tree, given those of reporters by name; a ValueError for what has no place in one."""
    match node:
        case ast.Name(id=name) | ast.Constant(value=str(name)):
            return number(name)
        case ast.Constant(value=int(constant) | float(constant)):
            return float(constant)
        case ast.UnaryOp() if type(node.op) in OF_ONE:
            return OF_ONE[type(node.op)](_value(node.operand, number))
        case ast.BoolOp():
            return _joined([_value(part, number) for part in node.values], isinstance(node.op, ast.And))
        case ast.BinOp() if type(node.op) in ARITHMETIC:
            return ARITHMETIC[type(node.op)](_value(node.left, number), _value(node.right, number))
        case ast.Compare() if all(type(sign) in COMPARISONS for sign in node.ops):
            values = [_value(part, number) for part in (node.left, *node.comparators)]
            pairs = zip(node.ops, values, values[1:], strict=False)
            return _joined([_compared(sign, *pair) for sign, *pair in pairs], True)
    raise ValueError


def _compared(sign: ast.cmpop, left: float, right: float) -> float:
    """Return whether a comparison holds, NaN if a number is missing."""
    return math.nan if math.isnan(left) or math.isnan(right) else COMPARISONS[type(sign)](left, right)


def _joined(values: list[float], is_and: bool) -> float:
    """Return whether all of these hold, or any, as far as those that are missing do not matter; else NaN."""
    known = [bool(value) for value in values if not math.isnan(value)]
    if (False in known) if is_and else (True in known):
        return not is_and
    return is_and if len(known) == len(values) else math.nan


def _is_true(value: float) -> bool:
    return bool(value) and not math.isnan(value)
