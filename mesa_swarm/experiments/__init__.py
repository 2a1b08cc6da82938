"""Many runs: finding models, comparing values of a parameter, statistics, tables and pictures.

Names are imported when they are first used: those that a study of yours needs, as ours do.
"""

from typing import TYPE_CHECKING

from mesa_swarm.lazy import lazy_names

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.experiments.controllers import Controller, content_of, load_controller, played
    from mesa_swarm.experiments.design import Mission, design_machine, evolve_network
    from mesa_swarm.experiments.design_gap import Budget
    from mesa_swarm.experiments.diagnosis import oscillating_robot, oscillation, trained
    from mesa_swarm.experiments.driving import tallied
    from mesa_swarm.experiments.evolution import Evolved, Trial, evolve
    from mesa_swarm.experiments.figures import fires_figure
    from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
    from mesa_swarm.experiments.gating import Criteria, ValidationGate, driven_by, gated
    from mesa_swarm.experiments.ledger import Ledger, Outcome
    from mesa_swarm.experiments.pool import checked_jobs
    from mesa_swarm.experiments.runs import Run, completed
    from mesa_swarm.experiments.statistics import (
        Interval,
        bootstrap_mean,
        mean_interval,
        pair_differences,
        paired_difference,
        share_interval,
    )
    from mesa_swarm.experiments.tables import csv_text, fitting, markdown_fitting, with_limits
    from mesa_swarm.experiments.tuning import LearningGoal, goal_run
    from mesa_swarm.wording import quantity

# Module: the public names that live in it.
_MODULES = {
    "experiments.controllers": "Controller content_of load_controller played",
    "experiments.design": "Mission design_machine evolve_network",
    "experiments.design_gap": "Budget",
    "experiments.diagnosis": "oscillating_robot oscillation trained",
    "experiments.driving": "tallied",
    "experiments.evolution": "Evolved Trial evolve",
    "experiments.figures": "fires_figure",
    "experiments.fingerprints": "engine_hash fingerprint",
    "experiments.gating": "Criteria ValidationGate driven_by gated",
    "experiments.ledger": "Ledger Outcome",
    "experiments.pool": "checked_jobs",
    "experiments.runs": "Run completed",
    "experiments.statistics": "Interval bootstrap_mean mean_interval pair_differences paired_difference share_interval",
    "experiments.tables": "csv_text fitting markdown_fitting with_limits",
    "experiments.tuning": "LearningGoal goal_run",
    "wording": "quantity",
}

__all__ = [
    "Budget",
    "Controller",
    "Criteria",
    "Evolved",
    "Interval",
    "LearningGoal",
    "Ledger",
    "Mission",
    "Outcome",
    "Run",
    "Trial",
    "ValidationGate",
    "bootstrap_mean",
    "checked_jobs",
    "completed",
    "content_of",
    "csv_text",
    "design_machine",
    "driven_by",
    "engine_hash",
    "evolve",
    "evolve_network",
    "fingerprint",
    "fires_figure",
    "fitting",
    "gated",
    "goal_run",
    "load_controller",
    "markdown_fitting",
    "mean_interval",
    "oscillating_robot",
    "oscillation",
    "pair_differences",
    "paired_difference",
    "played",
    "quantity",
    "share_interval",
    "tallied",
    "trained",
    "with_limits",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
