"""What a rule sees: it cannot change it, and it has as many entries as its design has sensors."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, ProximitySensor, RobotDesign
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import PASS, Subsumption, behaviour
from support.rules import facing_a_disc, slowly, step_with
from support.scenes import empty


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("form", [lambda f: f, slowly], ids=["compiled", "plain"])
class TestWhatARuleSees:
    @pytest.mark.slow
    def test_cannot_be_changed(self, form):
        def greedy(me):
            me.distance[0] = 5.0
            return PASS

        def sorting(me):
            me.radiation.sort()
            return PASS

        def adding(me):
            me.kind[:2] += 1
            return PASS

        for rule in (greedy, sorting, adding):
            model = step_with(None)
            before = model.swarm.distance.copy()
            model.control = Subsumption(behaviour(form(rule)))
            with pytest.raises(BehaviourError, match="in step 2: it") as caught:
                model.step()
            assert "\n" not in str(caught.value)
            assert np.array_equal(model.swarm.distance, before)

    @pytest.mark.slow
    def test_is_nothing_where_a_sensor_is_missing(self, form):
        def looks_ahead(me):
            nothing = me.distance[me.front] == -1 and me.kind[me.front] == -1 and math.isnan(me.bearing[me.front])
            dark = me.radiation[-1] == 0 and not me.line[-1]
            return (1.0 if nothing else 0.0), (1.0 if dark else 0.0)

        rear = RobotDesign(sensors=(ProximitySensor(bearing_degrees=180, range=90),))
        model = empty()
        model.add_robots(rear, poses=[(20, 150, 0.0)])
        model.control = Subsumption(behaviour(form(looks_ahead)))
        model.step()
        assert model.swarm.distance[0, 0] == pytest.approx(15)  # the border behind it
        assert model.swarm.command.tolist() == [[1.0, 1.0]]

    @pytest.mark.slow
    def test_has_as_many_entries_as_its_own_design_has_sensors(self, form):
        def counts(me):
            total = 0
            for s in range(len(me.distance)):
                if me.kind[s] >= -1 and -4.0 < me.bearing[s] < 4.0:
                    total += 1
            return total / 10.0, len(me.radiation) / 10.0

        model = empty()
        model.add_robots(AGENT3, poses=[(50, 50, 0.0)])
        model.add_robots(AGENT9, poses=[(150, 50, 0.0)])
        model.control = Subsumption(behaviour(form(counts)))
        model.step()
        assert model.swarm.command.tolist() == [[0.3, 0.0], [0.9, 0.0]]

    @pytest.mark.slow
    def test_is_computed_with_like_any_array(self, form):
        def nearest(me):
            doubled = (me.distance * 2.0)[-1] == 2.0 * me.distance[8]
            return (0.5 if doubled else 0.0), (0.5 if me.distance.max() == max(me.distance) else 0.0)

        model, _ = facing_a_disc()
        model.control = Subsumption(behaviour(form(nearest)))
        model.step()
        assert model.swarm.command.tolist() == [[0.5, 0.5]]


@pytest.mark.slow
def test_a_rule_knows_all_that_it_is_promised():
    @behaviour
    def curious(me):
        known = me.distance[me.left] + me.distance[me.right] + me.bearing[me.left] + me.tendency + me.radius
        if me.hot or me.extinguishing or me.kind[me.front] > 9:
            return PASS
        return 0.0 * (known + me.temperature + me.heat + me.line.size + me.radiation.size), me.max_speed

    model, _ = facing_a_disc()
    model.control = Subsumption(curious)
    model.step()
    assert model.swarm.command.tolist() == [[0.0, 1.0]]


def test_a_rule_works_for_designs_without_any_sensor_of_a_kind():
    model = empty()
    model.add_robots(RobotDesign(sensors=()), poses=[(50, 50, 0.0)])

    @behaviour
    def blind(me):
        return me.max_speed, me.max_speed

    model.control = Subsumption(blind)
    model.step()
    assert model.swarm.position[0] == pytest.approx((51, 50))
