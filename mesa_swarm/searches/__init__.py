"""What proposes runs: sensitivity, calibration, tuning, adaptive design, evolution, automatic design and its diversity.

Names are imported when they are first used: those that a study of yours needs, as ours do.
"""

from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.searches.automatic_design import Mission, design_machine, evolve_network
    from mesa_swarm.searches.design_gap import Budget
    from mesa_swarm.searches.drive_measures import tallied
    from mesa_swarm.searches.evolved_controllers import Evolved, Trial, evolve
    from mesa_swarm.searches.tuning import LearningGoal, goal_run
    from mesa_swarm.searches.validation_gate import Criteria, ValidationGate, driven_by, gated

# Module: the public names that live in it.
_MODULES = {
    "searches.automatic_design": "Mission design_machine evolve_network",
    "searches.design_gap": "Budget",
    "searches.drive_measures": "tallied",
    "searches.evolved_controllers": "Evolved Trial evolve",
    "searches.validation_gate": "Criteria ValidationGate driven_by gated",
    "searches.tuning": "LearningGoal goal_run",
}

__all__ = [
    "Budget",
    "Criteria",
    "Evolved",
    "LearningGoal",
    "Mission",
    "Trial",
    "ValidationGate",
    "design_machine",
    "driven_by",
    "evolve",
    "evolve_network",
    "gated",
    "goal_run",
    "tallied",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
