import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.viewing.export import StepChoice
from mesa_swarm.viewing.pictures import Look, film_size, parsed_size


@given(gap=st.integers(1, 7), count=st.integers(1, 200), most=st.integers(2, 50))
def test_without_every_no_more_than_so_many_are_chosen_and_evenly_spaced(gap, count, most):
    there = gap * np.arange(1, count + 1)
    chosen = StepChoice().thinned(there, most)
    assert 1 <= len(chosen) <= most
    assert set(chosen) <= set(there.tolist())
    assert len(set(np.diff(chosen).tolist())) <= 1
    if count <= most:
        assert chosen == there.tolist()


@given(every=st.integers(1, 30), ends=st.tuples(st.integers(0, 100), st.integers(0, 100)).map(sorted))
def test_chosen_are_all_multiples_between_the_ends(every, ends):
    first, last = ends
    wanted = [step for step in range(1, 101) if first <= step <= last and step % every == 0]
    choice = StepChoice(every=every, first=first, last=last)
    if wanted:
        assert choice.among(np.arange(1, 101)) == wanted
    else:
        with pytest.raises(InvalidValueError, match="is a multiple of"):
            choice.among(np.arange(1, 101))


def test_what_was_asked_for_exactly_is_not_thinned():
    assert len(StepChoice(every=1).thinned(np.arange(1, 1001), 10)) == 1000


def test_a_step_between_two_rows_is_refused_with_its_neighbours():
    with pytest.raises(InvalidValueError, match="the nearest are 6 and 9"):
        StepChoice(steps=[7]).among(np.arange(3, 100, 3))


@pytest.mark.parametrize("text", ["", "800", "800x", "ax9", "800x600x3", "-5x9", "9e9x3", "8x" + "9" * 99])
def test_sizes_that_are_none_are_refused(text):
    with pytest.raises(InvalidValueError):
        Look(size=parsed_size(text))


@given(st.floats(1e-3, 1e5), st.floats(1e-3, 1e5))
def test_films_of_any_map_have_an_even_size_that_fits_on_a_screen(width, height):
    size = film_size((0.0, 0.0, width, height))
    assert all(length % 2 == 0 and 64 <= length <= 860 for length in size)
    Look(size=size)


def test_sizes_are_parsed_and_a_film_of_the_usual_map_has_room_for_its_caption():
    assert parsed_size("800x600") == (800, 600)
    assert film_size((0, 0, 800, 600)) == (808, 640)
