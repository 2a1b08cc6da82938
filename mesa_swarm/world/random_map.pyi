"""An address that stays: its source is maps/random_map.py, which `base/moved.py` imports from here too."""

from mesa_swarm.maps.random_map import *
