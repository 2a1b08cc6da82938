"""What happened, from plain arrays: chains over time, and behaviour that gets nowhere."""

from mesa_swarm.analysis.chain_events import Event
from mesa_swarm.analysis.chain_history import ChainHistory, follow_chains
from mesa_swarm.analysis.chains import Chains, chains
from mesa_swarm.analysis.pathology import Episode, Pathologies, find_pathologies

__all__ = [
    "ChainHistory",
    "Chains",
    "Episode",
    "Event",
    "Pathologies",
    "chains",
    "find_pathologies",
    "follow_chains",
]
