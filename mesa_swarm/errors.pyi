"""An address that stays: its source is base/errors.py, which `base/moved.py` imports from here too."""

from mesa_swarm.base.errors import *
