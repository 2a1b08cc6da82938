"""When something is due: one rule for histories, snapshots, collected rows and recordings."""

from dataclasses import FrozenInstanceError
from pickle import dumps, loads

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.base.trigger import Trigger


@pytest.mark.parametrize(("every", "due"), [(1, [0, 1, 2, 3, 4, 5, 6]), (3, [0, 3, 6]), (10, [0]), (0, [])])
def test_it_is_due_after_the_steps_that_the_number_divides_and_never_with_zero(every, due):
    assert [step for step in range(7) if Trigger(every=every).is_due(step)] == due


def test_the_last_step_at_which_it_was_due_is_the_largest_one_until_now():
    trigger = Trigger(every=7)
    for step in range(50):
        assert trigger.last_due(step) == max(s for s in range(step + 1) if trigger.is_due(s))
    assert Trigger(every=0).last_due(50) == -1


@pytest.mark.parametrize("every", [-1, 0.5, "often", None, True, 2**31])
def test_what_is_not_a_number_of_steps_is_refused(every):
    with pytest.raises(InvalidValueError, match=r"every is .*; expected a whole number at least 0"):
        Trigger(every=every)


def test_a_parameter_may_be_a_number_or_a_trigger_and_is_refused_by_its_own_name():
    assert Trigger.of(np.int64(4)) == Trigger.of(Trigger(every=4)) == Trigger(every=4)
    assert type(Trigger.of(np.int64(4)).every) is int
    with pytest.raises(InvalidValueError, match="history_every is -1; expected a whole number at least 0"):
        Trigger.of(-1, "history_every")
    with pytest.raises(InvalidValueError, match="every is 0; expected a whole number at least 1 and at most 9"):
        Trigger.of(Trigger(every=0), minimum=1, maximum=9)


def test_a_trigger_cannot_be_changed_and_can_be_pickled():
    trigger = Trigger(every=4)
    with pytest.raises(FrozenInstanceError):
        trigger.every = 5
    assert loads(dumps(trigger)) == trigger
