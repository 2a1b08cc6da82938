import random

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.recording.container import LENGTH, MAGIC, Checkpoint, Packer, from_bytes, to_bytes

DTYPES = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(endianness="?"),
    hnp.floating_dtypes(endianness="?"),
    hnp.complex_number_dtypes(endianness="?"),
    hnp.byte_string_dtypes(max_len=9),
    hnp.unicode_string_dtypes(max_len=9),
    hnp.datetime64_dtypes(),
    hnp.timedelta64_dtypes(),
)
ARRAYS = hnp.arrays(DTYPES, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4))
KEYS = st.one_of(st.text(), st.integers(), st.booleans(), st.tuples(st.integers(), st.text()))
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-(2**80), 2**80), st.floats(), st.text(), st.binary(), ARRAYS),
    lambda inner: st.one_of(st.lists(inner), st.tuples(inner, inner), st.dictionaries(KEYS, inner)),
    max_leaves=12,
)


def through_bytes(value):
    packer = Packer()
    checkpoint = Checkpoint(step=7, state_hash="ab", facts={"value": packer.pack(value)}, arrays=packer.arrays)
    again = from_bytes(to_bytes(checkpoint))
    assert (again.step, again.state_hash) == (7, "ab")
    return Packer(again.arrays).unpack(again.facts["value"])


def assert_same(value, again):
    assert type(again) is type(value)
    if isinstance(value, np.ndarray):
        assert (again.dtype, again.shape, again.tobytes()) == (value.dtype, value.shape, value.tobytes())
    elif isinstance(value, (list, tuple)):
        assert len(again) == len(value)
        for one, other in zip(value, again, strict=True):
            assert_same(one, other)
    elif isinstance(value, dict):
        assert_same(list(value.items()), list(again.items()))
    elif isinstance(value, float):
        assert repr(again) == repr(value)
    else:
        assert again == value


@settings(deadline=None)
@given(VALUES)
def test_what_goes_through_bytes_is_what_it_was(value):
    assert_same(value, through_bytes(value))


def test_numpys_numbers_sets_and_signed_zeros_keep_their_types():
    value = through_bytes([np.float32(0.1), np.int8(-3), {1, 2}, frozenset("ab"), 1 + 2j, -0.0])
    assert [type(item) for item in value] == [np.float32, np.int8, set, frozenset, complex, float]
    assert value[2] == {1, 2}
    assert np.signbit(value[5])


@pytest.mark.parametrize(
    "geometry",
    [
        shapely.Point(0.1, -0.0),
        shapely.Point(1, 2, 3),
        shapely.Point(),
        shapely.LineString([(0, 0), (1e300, 0.1)]),
        shapely.LinearRing([(0, 0), (1, 0), (1, 1)]),
        shapely.box(0, 0, 9, 9).difference(shapely.Point(5, 5).buffer(2)),
        shapely.MultiLineString([[(0, 0), (1, 1)], [(2, 2), (3, 3)]]),
        shapely.GeometryCollection([shapely.Point(1, 2), shapely.box(0, 0, 1, 1)]),
    ],
    ids=lambda one: one.geom_type,
)
def test_geometries_are_restored_with_their_types_and_coordinates(geometry):
    (again,) = through_bytes([geometry])
    assert type(again) is type(geometry)
    assert shapely.to_wkb(again) == shapely.to_wkb(geometry)


@pytest.mark.parametrize("content", ["", "AAAA", "AQMAAAA=", "no base64", 7, None])
@pytest.mark.parametrize("name", ["geometry", "ring"])
def test_a_damaged_geometry_is_refused_in_one_line(name, content):
    with pytest.raises(RecordingError, match="cannot be decoded"):
        Packer().unpack({name: content})


@pytest.mark.parametrize("value", [object(), np.array([object()]), np.zeros(2, "i4,f8"), len, type, (1).__add__])
def test_what_is_not_plain_is_refused(value):
    with pytest.raises(RecordingError, match="cannot be stored"):
        Packer().pack(value)


def test_what_claims_to_be_larger_than_it_is_is_refused_before_memory_is_spent():
    whole = to_bytes(Checkpoint(step=1, state_hash="", facts={}))
    for size in (2**29, 2**62):
        claims = MAGIC + size.to_bytes(LENGTH, "little") + whole[len(MAGIC) + LENGTH :]
        with pytest.raises(RecordingError, match="damaged"):
            from_bytes(claims)
    huge = Checkpoint(step=1, state_hash="", facts={}, arrays=[np.zeros(1)])
    for shape in ((2**40,), (2**20, 2**20), (-1,), ("x",), (1.0,), (True,)):
        huge.arrays = [type("Fake", (), {"dtype": np.dtype(float), "shape": shape, "__array__": _one})()]
        with pytest.raises(RecordingError):
            from_bytes(to_bytes(huge))


def _one(self, dtype=None, copy=None):
    return np.zeros(1)


def test_flipped_and_torn_bytes_are_refused_or_harmless():
    draw = random.Random(1)
    content = to_bytes(Checkpoint(step=1, state_hash="ab", facts={"x": [1, 2.5]}, arrays=[np.arange(50.0), np.eye(3)]))
    for _ in range(2000):
        bad = bytearray(content)
        bad[draw.randrange(len(bad))] ^= 1 << draw.randrange(8)
        try:
            from_bytes(bytes(bad[: draw.randrange(len(bad))] if draw.random() < 0.3 else bad))
        except RecordingError as error:
            assert "\n" not in str(error)
