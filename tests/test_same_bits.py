"""The same seeds give the same bits as version 0.3.0 gave, the first of engine bits 2; see `support.same_bits`."""

import numpy as np
import pytest

from support.bit_worlds import WORLDS
from support.same_bits import differing, digest, digests_of_world, results, stored

# Present names of columns by the names under which their digests are stored.
ALIASES: dict[str, str] = {}
RESULTS = results()


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLDS)
def test_a_world_ends_with_the_stored_bits(name):
    assert differing(stored()["worlds"][name], digests_of_world(name), ALIASES) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", RESULTS)
def test_a_model_of_the_gallery_ends_with_the_stored_numbers(name):
    assert RESULTS[name]() == stored()["results"][name]


def test_all_that_is_stored_is_compared():
    assert stored()["worlds"].keys() == WORLDS.keys()
    assert stored()["results"].keys() == RESULTS.keys()


def test_one_bit_a_type_and_a_shape_change_a_digest():
    column = np.zeros(4)
    others = [np.array([0.0, 0.0, 0.0, 5e-324]), -column, column.astype(np.int64), column.reshape(2, 2)]
    assert len({digest(one) for one in (column, *others)}) == 5
    assert digest(0.1) != digest(np.nextafter(0.1, 1.0))


def test_what_differs_is_missing_or_new_is_named_and_a_column_may_be_renamed():
    assert differing({"a": "1", "b": "2", "c": "3"}, {"a": "1", "b": "0", "d": "4"}) == ["b", "c", "d"]
    assert differing({"old": "1"}, {"new": "1"}, {"old": "new"}) == []
