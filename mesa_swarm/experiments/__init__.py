"""Many runs: finding models, comparing values of a parameter, statistics, tables and pictures.

Names are imported when they are first used: those that a study of yours needs, as ours do.
"""

from typing import TYPE_CHECKING

from mesa_swarm.base.lazy import lazy_names

if TYPE_CHECKING:  # a type checker does not call __getattr__
    from mesa_swarm.base.wording import quantity
    from mesa_swarm.experiments.controllers import Controller, content_of, load_controller, played
    from mesa_swarm.experiments.diagnosis import oscillating_robot, oscillation, trained
    from mesa_swarm.experiments.figures import fires_figure
    from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
    from mesa_swarm.experiments.ledger import Ledger, Outcome
    from mesa_swarm.experiments.run_tables import RunFiles, TableHead
    from mesa_swarm.experiments.runs import Run, completed, done_in_order
    from mesa_swarm.experiments.statistics import (
        Interval,
        bootstrap_mean,
        mean_interval,
        pair_differences,
        paired_difference,
        share_interval,
    )
    from mesa_swarm.experiments.tables import csv_text, fitting, markdown_fitting, with_limits
    from mesa_swarm.experiments.worker_pool import checked_jobs

# Module: the public names that live in it.
_MODULES = {
    "experiments.controllers": "Controller content_of load_controller played",
    "experiments.diagnosis": "oscillating_robot oscillation trained",
    "experiments.figures": "fires_figure",
    "experiments.fingerprints": "engine_hash fingerprint",
    "experiments.ledger": "Ledger Outcome",
    "experiments.worker_pool": "checked_jobs",
    "experiments.run_tables": "RunFiles TableHead",
    "experiments.runs": "Run completed done_in_order",
    "experiments.statistics": "Interval bootstrap_mean mean_interval pair_differences paired_difference share_interval",
    "experiments.tables": "csv_text fitting markdown_fitting with_limits",
    "base.wording": "quantity",
}

__all__ = [
    "Controller",
    "Interval",
    "Ledger",
    "Outcome",
    "Run",
    "RunFiles",
    "TableHead",
    "bootstrap_mean",
    "checked_jobs",
    "completed",
    "content_of",
    "csv_text",
    "done_in_order",
    "engine_hash",
    "fingerprint",
    "fires_figure",
    "fitting",
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
    "trained",
    "with_limits",
]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
