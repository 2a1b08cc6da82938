"""The models of mesa_swarm, one file each."""

import os

__path__[:] = map(os.path.realpath, __path__)  # in an editable installation a link leads here: one path only
