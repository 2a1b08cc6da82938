"""The thesis's results on swarms (5.3) and on robots at fires (9), over all seeds.

Verdicts are results, not aims. A change of the code that changes one is to be examined.
"""

import pytest

from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import find_item

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    with Laboratory(tmp_path_factory.mktemp("kept"), jobs=2) as made:
        yield made


@pytest.mark.parametrize(
    ("figure", "verdict", "limits"),
    [
        ("5.7", "confirmed", 0),
        ("5.8", "confirmed", 0),
        ("5.9", "confirmed with limits", 1),
        ("5.10", "confirmed with limits", 1),
        ("5.3.4", "confirmed with limits", 6),
        ("10.2", "not confirmed", 5),
        ("9.1", "confirmed", 0),
        ("9.4", "confirmed with limits", 3),
        ("9.5", "not confirmed", 2),
    ],
)
def test_a_figure_has_the_verdict_that_was_reported(laboratory, figure, verdict, limits):
    result = find_item(figure).make(laboratory)
    assert (result.verdict, len(result.limits)) == (verdict, limits), result.csv()


def test_chains_stay_together_less_than_clusters_at_rest(laboratory):
    checks = find_item("5.9").make(laboratory).checks
    (cohesion,) = [check for check in checks if check.claim.startswith("grouped pairs stay in one group")]
    assert (cohesion.outcome, cohesion.main) == ("failed", False)
