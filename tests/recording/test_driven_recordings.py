"""A recording of a run that compiled calls drive is, in all that a reader reads, that of its single steps."""

import pytest

from mesa_swarm.model.gallery import find_model, gallery_names
from support.recorded_twice import assert_same_recordings, can_be_driven, recorded_both_ways


@pytest.mark.parametrize("settings", [{}, {"every": 3}, {"every": 7, "exact": True}, {"checkpoint_every": 40}], ids=str)
@pytest.mark.parametrize("name", gallery_names())
def test_every_model_of_the_gallery_is_recorded_as_in_its_single_steps(name, settings, tmp_path):
    def make():
        return find_model(name)(rng=3)

    driven, single, steps = recorded_both_ways(make, tmp_path, lambda model, take: take(model, 130), **settings)
    assert_same_recordings(driven, single)
    print(name, settings, steps, can_be_driven(make().run(2)))
