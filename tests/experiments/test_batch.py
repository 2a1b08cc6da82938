"""batch_run gives the rows of Mesa's, with every version of Mesa."""

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT3, SwarmModel, batch_run
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.robots.robot import Robot
from support.failing_models import Raising
from support.trap_models import Counted

QUIET = {"display_progress": False}
# Mesa 3.3 takes one step more than asked and numbers it otherwise; Mesa 4 has none.
comparable = pytest.mark.skipif(not mesa.__version__.startswith("3.5"), reason="Mesa 3.5 has the rows to compare with")


class Reporting(SwarmModel):
    """Robots with reports of their own, one of which stops in between."""

    def __init__(self, *, n_robots: int = 2, stops_after: int = 100, every: int = 1, agents: bool = False, rng=None):
        super().__init__(
            rng=rng,
            collect_every=every,
            model_reporters={"x": lambda model: float(model.swarm.position[:, 0].sum())},
            agent_reporters={"place": lambda agent: agent.position.tolist()} if agents else None,
        )
        self.stops_after = stops_after
        self.add_robots(AGENT3, n_robots)

    def step(self):
        super().step()
        self.running = self.steps < self.stops_after


@comparable
@pytest.mark.parametrize("period", [-1, 1, 3])
@pytest.mark.parametrize("more", [{}, {"agents": True}, {"every": 2}, {"stops_after": 3}, {"every": 0}])
def test_the_rows_are_those_of_mesa(period, more):
    how = {"rng": [1, 2], "max_steps": 7, "data_collection_period": period, "number_processes": 1, **QUIET}
    parameters = {"n_robots": [1, 2], **more}
    assert batch_run(Reporting, parameters, **how) == mesa.batch_run(Reporting, parameters, **how)


class OnlyOfAgents(SwarmModel):
    """A model whose data collector has reports of agents only."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT3, 2)
        self.datacollector = mesa.DataCollector(agent_reporters={"number": lambda agent: agent.unique_id})


@pytest.mark.parametrize(("period", "steps"), [(-1, [3]), (1, [1, 2, 3])])
def test_a_model_with_reports_of_agents_only_has_rows_too(period, steps):
    rows = batch_run(OnlyOfAgents, {}, rng=5, max_steps=3, data_collection_period=period, **QUIET)
    assert list(dict.fromkeys(row["Step"] for row in rows)) == steps
    assert {row["AgentID"] for row in rows} == {agent.unique_id for agent in OnlyOfAgents(rng=5).agents}
    assert all(row["number"] == row["AgentID"] for row in rows)


@pytest.mark.parametrize("period", [-1, 1, 3])
def test_the_rows_are_those_of_the_data_collector_after_these_steps(period):
    rows = batch_run(Reporting, {"n_robots": 2}, rng=5, max_steps=7, data_collection_period=period, **QUIET)
    wanted = {-1: [7], 1: [1, 2, 3, 4, 5, 6, 7], 3: [1, 4, 7]}[period]
    frame = Reporting(n_robots=2, rng=5).run(7).datacollector.get_model_vars_dataframe()
    assert [row["Step"] for row in rows] == wanted
    assert [row["x"] for row in rows] == frame["x"].iloc[[step - 1 for step in wanted]].tolist()
    assert all((row["RunId"], row["iteration"], row["n_robots"], row["rng"]) == (0, 0, 2, 5) for row in rows)


def test_there_is_a_row_for_each_agent_that_is_reported():
    model = Reporting(agents=True, rng=3).run(4)
    rows = batch_run(Reporting, {"agents": True}, rng=3, max_steps=4, **QUIET)
    assert [row["AgentID"] for row in rows] == [agent.unique_id for agent in model.agents]
    assert [row["place"] for row in rows] == [agent.position.tolist() for agent in model.agents]
    assert sum(row["AgentID"] in {robot.unique_id for robot in model.agents_by_type[Robot]} for row in rows) == 2


def test_processes_return_the_same_rows_in_the_same_order():
    how = {"parameters": {"odd": [0.0, 1.0]}, "rng": [1, 2, 3], "max_steps": 2, "data_collection_period": 1, **QUIET}
    rows = batch_run(Counted, **how)
    assert [row["RunId"] for row in rows] == [run for run in range(6) for _ in range(2)]
    assert batch_run(Counted, number_processes=2, **how) == rows


@pytest.mark.parametrize("seeds", [np.array([1, 2]), range(1, 3), (1, 2)])
def test_seeds_may_be_in_any_sequence_and_parameters_too(seeds):
    rows = batch_run(Counted, {"odd": np.array([0.5])}, rng=seeds, max_steps=1, **QUIET)
    assert [row["place"] for row in rows] == [Counted(odd=0.5, rng=seed).run(1).place for seed in (1, 2)]


def test_a_text_is_one_value_and_a_model_may_be_named():
    rows = batch_run("fire_fighting", {"strategy": "B", "n_robots": 2}, rng=1, max_steps=1, **QUIET)
    assert [row["strategy"] for row in rows] == ["B"]


def test_an_error_of_one_run_is_raised(tmp_path):
    with pytest.raises(RuntimeError, match="it broke"):
        batch_run(Raising, {"diary": str(tmp_path / "diary")}, rng=[1, 2, 3], max_steps=1, **QUIET)


@pytest.mark.parametrize(
    ("given", "more", "error", "words"),
    [
        (mesa.Model, {}, InvalidValueError, "expected a SwarmModel class"),
        (Counted(rng=1), {}, InvalidValueError, "expected a SwarmModel class"),
        ("fire_fightin", {}, UnknownNameError, "fire_fighting"),
        (Counted, {"parameters": {"rng": [1, 2]}}, InvalidValueError, r"rng=\[1, 2, 3\]"),
        (Counted, {"parameters": {"od": 1}}, UnknownNameError, "did you mean 'odd'"),
        (Counted, {"parameters": {"odd": []}}, InvalidValueError, "no value for odd"),
        (Counted, {"parameters": [1]}, InvalidValueError, "expected a dict"),
        (Counted, {"max_steps": 0}, InvalidValueError, "max_steps is 0"),
        (Counted, {"data_collection_period": 0}, InvalidValueError, "data_collection_period is 0"),
        (Counted, {"number_processes": 0}, InvalidValueError, "number_processes is 0"),
        (Counted, {"rng": [1, 1, 2]}, InvalidValueError, "rng has 1 twice; expected different seeds"),
        (Counted, {"rng": np.array([3, 2, 3])}, InvalidValueError, "rng has 3 twice"),
        (Counted, {"rng": [1, np.random.SeedSequence(1)]}, InvalidValueError, "rng has 1 twice"),
        (Counted, {"rng": [np.random.SeedSequence([1, 2])] * 2}, InvalidValueError, "rng has .*SeedSequence.* twice"),
        (Counted, {"rng": [[1, 2], [1, 2]]}, InvalidValueError, r"rng has \[1, 2\] twice"),
        (Counted, {"rng": "12"}, InvalidValueError, "rng is '12'; expected a whole number, or a list of them"),
        (Counted, {"rng": [1, -1]}, InvalidValueError, "rng is -1; expected a whole number of at least 0"),
        (Counted, {"rng": np.random.RandomState(1)}, InvalidValueError, "rng is RandomState"),
        (Counted, {"rng": [np.random.RandomState(1)]}, InvalidValueError, "rng is RandomState"),
        (Counted, {"rng": np.random.default_rng(1)}, InvalidValueError, "rng has Generator.*, which runs would share"),
        (Counted, {"parameters": {"odd": [1.0, 2.0, 1.0]}}, InvalidValueError, "odd in parameters has 1.0 twice"),
    ],
)
def test_wrong_values_are_refused_in_one_line_before_anything_runs(given, more, error, words):
    with pytest.raises(error, match=words) as raised:
        batch_run(given, **{"parameters": {}, **QUIET, **more})
    assert len(str(raised.value)) <= 300
    assert "\n" not in str(raised.value)


def test_runs_that_nothing_can_repeat_may_be_many_and_children_of_a_seed_are_different_ones():
    children = np.random.SeedSequence(5).spawn(2)
    assert len(batch_run(Counted, {}, rng=[None, None], max_steps=1, **QUIET)) == 2
    rows = batch_run(Counted, {}, rng=children, max_steps=1, **QUIET)
    assert [row["place"] for row in rows] == [Counted(rng=child).run(1).place for child in children]
