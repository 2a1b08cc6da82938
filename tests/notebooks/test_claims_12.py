"""Claims of notebook 12 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import mean_interval, share_interval
from support.exercises import NOTEBOOKS, cells_of, last_value, names_of

(PATH,) = (path for path in NOTEBOOKS if path.stem.startswith("12_"))
SEEDS = range(1001, 1025)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return what the notebook's own cells define."""
    return names_of(
        12, "setup", "map", "robot", "play", "rule", "stop", "free", folder=tmp_path_factory.mktemp("claims")
    )


def least(happened) -> float:
    """Return the lower limit of the share of runs in which something happened."""
    return share_interval(sum(happened), len(happened)).low


def test_all_trams_go_round_along_the_outer_edge_and_always_see_the_line(notebook):
    seen, turns, distance = np.transpose([notebook["rounds"](rng) for rng in SEEDS])
    assert least(turns >= 1) > 0.8
    assert least(seen == 1) > 0.8
    assert least(distance > 1) > 0.8


def test_with_sensors_too_far_apart_trams_lose_the_line_in_most_steps(notebook):
    seen = [notebook["rounds"](rng, spacing=7.0)[0] for rng in SEEDS]
    assert least(np.array(seen) < 0.5) > 0.8
    assert mean_interval(seen).high < 0.5


def test_two_trams_form_a_queue_before_a_parcel_and_continue_without_it(notebook):
    queues, moved = [], []
    for rng in SEEDS:
        model, parcel, is_queue = notebook["queue"](rng)
        before = model.swarm.position.copy()
        parcel.remove()
        model.run(300)
        queues.append(is_queue)
        moved.append(np.hypot(*(model.swarm.position - before).T).min())
    assert least(queues) > 0.8
    assert mean_interval(moved).low > 100


def test_the_sensors_of_the_unsolved_exercise_see_a_third_of_the_discs(notebook, tmp_path):
    for name in ("exercise-2", "check-2"):
        last_value(cells_of(PATH)[name], notebook, tmp_path / f"{name}.py")
    seen = mean_interval([notebook["guarded"](rng)["share seen"] for rng in SEEDS])
    assert 0.3 < seen.low < seen.high < 0.4
