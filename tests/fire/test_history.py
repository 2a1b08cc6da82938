"""The fires' history when fires come and go."""

import pickle
from copy import deepcopy
from dataclasses import replace

import numpy as np

from mesa_swarm import SwarmModel
from mesa_swarm.fire.fires import MOST_ROWS
from mesa_swarm.model.gallery import find_model


def test_every_fire_has_the_same_column_when_another_is_removed():
    model = SwarmModel(map="openspace_fire", rng=1)
    for k, fire in enumerate(model.fires):
        fire.temperature = 0.1 * (k + 1)
    model.run(1)
    model.fires[0].remove()
    model.run(1)
    before, after = model.fires.history.temperature
    assert np.isnan(after[0])
    assert np.abs(after[1:] - before[1:]).max() < 0.01
    assert model.fires.history.robots[1, 0] == -1


def step_with_former_history(model, rows):
    """Take a step, and note the row that is due as it was made before a kernel did."""
    model.run(1)
    fires, history = model.fires, model.fires.history
    if model.completed % history.every == 0:
        row = np.array([np.full(history.width, np.nan), np.full(history.width, -1.0)])
        row[:, history.places[1]] = fires.temperature, np.where(fires.out, -1, fires.robots)
        rows.append((model.steps, row))


def test_rows_are_those_of_the_columns_however_many_and_whatever_fires_come_and_go():
    model = find_model("fire_fighting")(rng=1, history_every=2)
    rows = []
    for step in range(620):
        step_with_former_history(model, rows)
        if step == 100:
            model.fires[2].remove()
        if step == 200:
            model.add_fire((120, 130), radius=9, temperature=0.5)
        if step == 300:
            model = pickle.loads(pickle.dumps(model))
        if step == 400:
            model = deepcopy(model)
        if step == 500:
            model.fires.history.every = 1
    steps, stored = model.fires.history.series
    assert steps == [step for step, _ in rows]
    for row, (_, expected) in zip(stored, rows, strict=True):
        np.testing.assert_array_equal(row, expected)
    assert len(steps) > MOST_ROWS
    assert "Python" not in next(line for line in str(model.plan).splitlines() if "are stored" in line)


def test_rows_are_of_the_models_steps_also_where_its_own_step_takes_two():
    class Hasty(SwarmModel):
        def step(self):
            super().step()
            super().step()

    model = Hasty(map="openspace_fire", rng=1, history_every=2).run(3)
    assert (model.steps, model.completed) == (3, 6)
    assert model.fires.history.steps.tolist() == [1, 2, 3]


def test_constants_and_the_range_that_are_set_between_steps_count_from_the_next_on():
    models = [find_model("fire_fighting")(rng=4).run(3) for _ in range(2)]
    for model in models:
        assert model.plan.stages
        model.fire_constants = replace(model.fire_constants, k1=2 * model.fire_constants.k1)
        model.extinguish_range = 500.0
    burning = next(stage for _, stage in models[1].parts.plan.stages if stage.name == "Burning takes place")
    models[0].processes[0].step(models[0])
    burning.kernel.run(models[1].steps, len(models[1].swarm))
    assert models[0].fires.temperature.tolist() == models[1].fires.temperature.tolist()
    assert models[0].swarm.heat.tolist() == models[1].swarm.heat.tolist()
