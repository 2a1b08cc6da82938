"""Models in files of their own, on the worker processes of a dask cluster, which have not imported them."""

import subprocess
import sys
from importlib.util import find_spec

import pytest

MINE = """
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption


class Foraging(SwarmModel):
    compares = "distance", (10.0, 20.0)
    steps_to_compare = 5

    def __init__(self, *, distance=15.0, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(Avoid(distance=distance), Explore())

    def results(self):
        return {"x": float(self.swarm.position[:, 0].mean())}
"""
CLUSTER = """
import os
import sys
from pathlib import Path
from distributed import Client, LocalCluster
from joblib import parallel_config
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.sweep import sweep

if __name__ == "__main__":
    out, file = Path(sys.argv[1]), Path(sys.argv[2])
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        parallel_config(backend="dask"),
    ):
        assert os.getpid() not in client.run(os.getpid).values()
        os.chdir(file.parent)  # the workers are elsewhere
        there = sweep("./mine.py:Foraging", {"distance": [10.0, 20.0]}, seeds=2, steps=5, out=out / "there")
        compared = compare("./mine.py", seeds=2, steps=5)
    here = sweep("./mine.py:Foraging", {"distance": [10.0, 20.0]}, seeds=2, steps=5, out=out / "here", jobs=1)
    again = compare("./mine.py", seeds=2, steps=5, jobs=1)
    print(there.failed, there.path.read_bytes() == here.path.read_bytes(), str(compared) == str(again))
"""


@pytest.mark.slow
@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_workers_of_a_cluster_import_the_file_of_a_model_that_is_swept_or_compared(tmp_path):
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "mine.py").write_text(MINE)
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    command = [sys.executable, str(script), str(tmp_path / "out"), str(folder / "mine.py")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False, cwd=tmp_path)
    assert done.stdout.splitlines() == ["0 True True"], done.stderr
