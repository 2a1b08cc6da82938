import subprocess
import sys

import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.environments.registration import need_learning_package

WITHOUT = """
import sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
hidden = {"gymnasium", "pettingzoo"}
PathFinder.find_spec = classmethod(lambda c, name, *more: None if name.split(".")[0] in hidden else find(name, *more))
import numpy as np
from mesa_swarm.environments import CollisionAvoidance, VectorSwarmEnv
env = VectorSwarmEnv(CollisionAvoidance(n_robots=2, map="openspace"), n_worlds=2)
env.reset(seed=1)
print(env.step(np.ones((2, 2, 2)))[1].sum())
for name in ("ParallelSwarmEnv", "RobotEnv", "RobotVectorEnv"):
    try:
        getattr(sys.modules["mesa_swarm.environments"], name)
    except Exception as error:
        print(f"{type(error).__name__}: {error}")
"""


def test_a_package_that_is_missing_is_asked_for_in_one_line():
    with pytest.raises(SwarmError, match=r"^this environment needs nothere; install it with: pip install .*\[rl\]"):
        need_learning_package("nothere")


@pytest.mark.slow
def test_without_the_extra_arrays_work_and_environments_state_what_to_install():
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=True)
    line = f"SwarmError: this environment needs gymnasium; install it with: {install_command('rl')}"
    assert done.stdout.splitlines() == ["4.0", line, line, line]
