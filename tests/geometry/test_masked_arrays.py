"""Masked arrays: what is masked is NaN, wherever it stands, and nothing else changes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mesa_swarm.geometry.masked_arrays import fill_masked, holds_masked

shapes = array_shapes(min_dims=0, max_dims=3, max_side=4)


@given(st.data(), shapes, st.sampled_from([float, int, bool, np.int8]))
def test_masked_numbers_are_nan_and_all_others_stay(drawn, shape, kind):
    values = drawn.draw(arrays(kind, shape))
    mask = drawn.draw(arrays(bool, shape))
    found = fill_masked(np.ma.array(values, mask=mask))
    np.testing.assert_array_equal(found, np.where(mask, np.nan, values) if mask.any() else values)
    assert type(found) is np.ndarray
    assert mask.any() or found.dtype == kind


@given(st.recursive(st.integers() | st.floats(), lambda inner: st.lists(inner, max_size=3)))
def test_values_without_a_mask_become_what_numpy_makes_of_them(value):
    assert not holds_masked(value)
    try:
        expected = np.asarray(value)
    except (ValueError, OverflowError) as error:
        with pytest.raises(type(error)):
            fill_masked(value)
    else:
        np.testing.assert_array_equal(fill_masked(value), expected)


@pytest.mark.parametrize(
    "value",
    [
        [1.0, np.ma.masked],
        (1.0, np.ma.masked),
        [np.ma.array([1.0, 5.0], mask=[0, 1])],
        [(1.0, 2.0), np.ma.array([1.0, 5.0], mask=[0, 1])],
        [[[1.0, np.ma.masked]]],
    ],
)
def test_masks_are_seen_within_lists(value):
    assert holds_masked(value)
    found = fill_masked(value)
    assert np.isnan(found).sum() == 1
    assert not (found == 5.0).any()


def test_a_list_that_holds_itself_is_not_masked():
    endless = []
    endless.append(endless)
    assert not holds_masked(endless)


def test_masked_texts_and_records_are_no_numbers():
    assert fill_masked(np.ma.array(["a", "b"], mask=[0, 1])).dtype.kind == "U"
    assert fill_masked(np.ma.array([(1.0, 2)], dtype=[("x", float), ("y", int)], mask=[(1, 0)])).dtype.kind == "V"
