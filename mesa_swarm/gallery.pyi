"""An address that stays: its source is model/gallery.py, which `base/moved.py` imports from here too."""

from mesa_swarm.model.gallery import *
