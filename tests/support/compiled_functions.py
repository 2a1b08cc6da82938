"""Which functions are compiled for the models of the gallery: counted in a process with nothing compiled for each.

As a script it writes the file that `mesa_swarm.kernels.compiling` reads.
"""

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from mesa_swarm.kernels.compiling import EVERY, NEEDED
from mesa_swarm.model.gallery import gallery_names

COUNT = """
import sys
from mesa_swarm.experiments.warm_up import compile_for
from mesa_swarm.kernels.compiling import compilation
compile_for(sys.argv[1])
print("\\n".join(compilation.compiled))
"""


def compiled_by(model: str, folder: str | os.PathLike, **settings: str) -> list[str]:
    """Return the names of the functions that a new process compiles for a model, and stores in a folder."""
    settings = os.environ | {"NUMBA_CACHE_DIR": str(folder)} | settings
    command = [sys.executable, "-c", COUNT, model]
    done = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
    return [line for line in done.stdout.splitlines() if line]


def compiled_from_nothing(model: str) -> set[str]:
    """Return what is compiled for a model when nothing is there."""
    with tempfile.TemporaryDirectory() as folder:
        # Without optimisation Numba is faster, but stores only functions that call no others.
        return set(compiled_by(model, folder, NUMBA_OPT="0"))


def counted(models: list[str]) -> dict[str, list[str]]:
    """Return what all models need, and what each needs besides."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        needed = dict(zip(models, pool.map(compiled_from_nothing, models), strict=True))
    every = set.intersection(*needed.values())
    return {EVERY: sorted(every)} | {model: sorted(names - every) for model, names in needed.items()}


if __name__ == "__main__":
    NEEDED.write_text(json.dumps(counted(gallery_names()), indent=1) + "\n", encoding="utf-8")
