"""For notebooks: exercises that check themselves, pictures, and small runs for a quick pass."""

from mesa_swarm.teaching.checks import (
    Verdict,
    Wish,
    check_estimate,
    check_function,
    check_model,
    check_rule,
    check_settings,
)
from mesa_swarm.teaching.pictures import picture, sized

__all__ = [
    "Verdict",
    "Wish",
    "check_estimate",
    "check_function",
    "check_model",
    "check_rule",
    "check_settings",
    "picture",
    "sized",
]
