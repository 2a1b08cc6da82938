"""Measures of swarms on plain arrays: groups, chains, spacing, order, coverage, collisions, times, pathologies."""

from mesa_swarm.analysis.chain_history import ChainEvent, ChainHistory, follow_chains
from mesa_swarm.analysis.chains import Chains, chains
from mesa_swarm.analysis.clusters import Clusters, clusters, kept_together
from mesa_swarm.analysis.coverage import coverage, reachable_cells, visited_cells
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
from mesa_swarm.moved import moved_name

__all__ = [
    "ChainEvent",
    "ChainHistory",
    "Chains",
    "Clusters",
    "Episode",
    "Pathologies",
    "central_moving_average",
    "chains",
    "clark_evans",
    "clusters",
    "collision_frequency",
    "coverage",
    "cumulative_collisions",
    "directions",
    "dispersion",
    "find_pathologies",
    "follow_chains",
    "kept_together",
    "later_mean",
    "layer_shares",
    "milling",
    "nearest_neighbour_distances",
    "neighbour_alignment",
    "polarization",
    "random_nearest_neighbour_distance",
    "reachable_cells",
    "time_to",
    "visited_cells",
]


def __getattr__(name: str) -> object:
    """Return a name that this module had before."""
    return moved_name(__name__, name)
