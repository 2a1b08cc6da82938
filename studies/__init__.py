"""Studies made with mesa_swarm: a thesis and papers reproduced, theories, benchmarks of learners and of speed.

They use public names of mesa_swarm alone, as a study of yours would.
"""

import os

# In an editable installation a link leads here: modules have one path only.
__path__[:] = map(os.path.realpath, __path__)
