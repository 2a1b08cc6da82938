"""Published results, each reproduced by a model of the gallery: division of labour, decisions, trails."""

from mesa_swarm.reproduction.registry import Item

ITEMS: tuple[Item, ...] = ()
