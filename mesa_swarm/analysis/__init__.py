"""Measures of swarms on plain arrays: groups, chains, spacing, order, coverage, collisions, times, pathologies.

Robots that were not tracked, and values that were not measured, are NaN, None or masked everywhere: they are missing,
and left out. What a function returns has their number as `missing`: a `Measure` is a float with it, `Measures` are an
array with it, and so have `Clusters`, `Chains`, `ChainHistory` and `Pathologies`; where there is one number for each
robot, that of a missing one is NaN or masked. `count_missing` counts the robots without a position or a heading.

Headings of n robots, and positions (n, 2), may also be tables over time, (k, n) and (k, n, 2): they are measured row by
row. A heading beyond 4 pi is probably in degrees, of which a `DegreesWarning` is given.
"""

from mesa_swarm.analysis.chain_history import ChainEvent, ChainHistory, follow_chains
from mesa_swarm.analysis.chains import Chains, chains
from mesa_swarm.analysis.clusters import Clusters, clusters, kept_together
from mesa_swarm.analysis.coverage import coverage, reachable_cells, visited_cells
from mesa_swarm.analysis.missing import Measure, Measures, count_missing
from mesa_swarm.analysis.moments import alignment_within, chain_lengths, group_sizes, mean_gap, order_of, travel_of
from mesa_swarm.analysis.order import directions, milling, neighbour_alignment, polarization
from mesa_swarm.analysis.pathology import Episode, Pathologies, find_pathologies
from mesa_swarm.analysis.series import (
    central_moving_average,
    collision_frequency,
    cumulative_collisions,
    later_mean,
    layer_shares,
    time_to,
)
from mesa_swarm.analysis.spacing import (
    clark_evans,
    dispersion,
    nearest_neighbour_distances,
    random_nearest_neighbour_distance,
)
from mesa_swarm.base.moved import moved_name

__all__ = [
    "ChainEvent",
    "ChainHistory",
    "Chains",
    "Clusters",
    "Episode",
    "Measure",
    "Measures",
    "Pathologies",
    "alignment_within",
    "central_moving_average",
    "chain_lengths",
    "chains",
    "clark_evans",
    "clusters",
    "collision_frequency",
    "count_missing",
    "coverage",
    "cumulative_collisions",
    "directions",
    "dispersion",
    "find_pathologies",
    "follow_chains",
    "group_sizes",
    "kept_together",
    "later_mean",
    "layer_shares",
    "mean_gap",
    "milling",
    "nearest_neighbour_distances",
    "neighbour_alignment",
    "order_of",
    "polarization",
    "random_nearest_neighbour_distance",
    "reachable_cells",
    "time_to",
    "travel_of",
    "visited_cells",
]


def __getattr__(name: str) -> object:
    """Return a name that this module had before."""
    return moved_name(__name__, name)
