"""What notebooks need: exercises that check themselves, pictures, and runs that are small where there is no time."""

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
