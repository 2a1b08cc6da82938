"""The rows of every run and step are stored as Parquet, a file a run, and each data set reads as one table."""

import numpy as np
import pandas as pd
import pytest

from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.base.files import open_draft
from mesa_swarm.experiments.compare import compare
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.model.gallery import find_model

FIRE = find_model("fire_fighting")


class Reporting(SwarmModel):
    """Robots with reports that have other types in other runs: of 2 robots, of 3, and of more."""

    def __init__(self, *, n_robots: int = 2, every: int = 1, rng=None):
        number = {2: None, 3: 1, 4: 2.5}.get(n_robots)
        more = {"only of some": lambda model: 1.0} if n_robots == 3 else {}
        super().__init__(
            rng=rng,
            collect_every=every,
            model_reporters={
                "now": lambda model: model.completed,
                "number": lambda model: number,
                "either": lambda model: "abc" if n_robots == 3 else np.float64(2.0),
                "masked": lambda model: np.ma.masked if model.completed == 1 else np.int64(7),
                **more,
            },
            agent_reporters={"place": lambda robot: robot.position, "far": lambda robot: robot.position[0] > 100},
        )
        self.add_robots(AGENT3, n_robots)

    def results(self):
        return {"robots": len(self.robots)}


def swept(folder, model=Reporting, values=(2, 3, 4), **more):
    """Return a sweep with series, and its two data sets."""
    how = {"seeds": 2, "steps": 4, "jobs": 1, "series": True, **more}
    made = sweep(model, {"n_robots": list(values)}, out=folder, **how)
    return made, *(pd.read_parquet(folder / "series" / name) for name in ("model", "agents"))


def test_the_rows_of_models_are_those_of_their_data_collectors(tmp_path):
    made, of_models, _ = swept(tmp_path)
    table = made.frame()
    assert len(of_models) == 6 * 4
    for (key, number, rng), rows in of_models.groupby(["run", "n_robots", "rng"]):
        (row,) = table[table["run"] == key].to_dict("records")
        assert (row["n_robots"], row["rng"]) == (number, rng)
        frame = Reporting(n_robots=number, rng=rng).run(4).datacollector.get_model_vars_dataframe()
        assert rows["step"].tolist() == rows["now"].tolist() == [1, 2, 3, 4]
        assert rows["total_collisions"].tolist() == frame["total_collisions"].tolist()


def test_the_rows_of_agents_are_by_run_step_and_unique_id(tmp_path):
    made, _, of_agents = swept(tmp_path, values=[3], settings={"every": 2})
    assert list(of_agents.columns) == ["run", "every", "n_robots", "rng", "step", "unique_id", "place", "far"]
    for (key, rng), rows in of_agents.groupby(["run", "rng"]):
        assert key in set(made.frame()["run"])
        model = Reporting(n_robots=3, rng=rng).run(4)
        assert rows[["step", "unique_id"]].to_numpy().tolist() == sorted(
            rows[["step", "unique_id"]].to_numpy().tolist()
        )
        last = rows[rows["step"] == 4].set_index("unique_id")
        assert len(last) == len(model.agents)
        assert all(last.loc[robot.unique_id, "place"].tolist() == robot.position.tolist() for robot in model.robots)


def test_columns_have_the_same_types_in_all_files_though_runs_report_other_ones(tmp_path):
    _, of_models, _ = swept(tmp_path)
    by_robots = {number: rows.iloc[0] for number, rows in of_models.groupby("n_robots")}
    assert of_models["number"].dtype == float
    assert np.isnan(by_robots[2]["number"])
    assert (by_robots[3]["number"], by_robots[4]["number"]) == (1.0, 2.5)
    assert (by_robots[2]["either"], by_robots[3]["either"]) == ("2.0", "abc")
    assert of_models["only of some"].notna().sum() == 8
    assert of_models["masked"].isna().sum() == 6


def test_of_a_model_without_reports_of_agents_the_poses_of_robots_are_stored(tmp_path):
    _, _, of_agents = swept(tmp_path, FIRE, values=[2])
    model = FIRE(n_robots=2, rng=2).run(4)
    last = of_agents[(of_agents["rng"] == 2) & (of_agents["step"] == 4)]
    assert last["unique_id"].tolist() == [robot.unique_id for robot in model.robots]
    assert last[["x", "y"]].to_numpy().tolist() == model.swarm.position.tolist()
    assert last["heading"].tolist() == model.swarm.heading.tolist()


def test_one_data_set_may_be_chosen_and_the_runs_are_done_again_for_the_other(tmp_path):
    first, second, third = (
        sweep(FIRE, seeds=2, steps=3, jobs=1, out=tmp_path, series=series) for series in ("model", "model", "agents")
    )
    assert [made.done_before for made in (first, second, third)] == [0, 2, 0]
    assert first.frame().equals(third.frame())
    assert len(pd.read_parquet(tmp_path / "series/agents")) == 2 * 3 * len(FIRE(rng=1).robots)


def test_series_change_nothing_else_and_a_sweep_without_them_needs_no_new_runs(tmp_path):
    table = swept(tmp_path)[0].frame()
    again = sweep(Reporting, {"n_robots": [2, 3, 4]}, seeds=2, steps=4, jobs=1, out=tmp_path)
    assert again.done_before == 6
    assert table.drop(columns="run").equals(again.frame())


def test_what_a_kill_interrupted_has_whole_files_and_ends_in_the_same_ones(tmp_path):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    _, *wanted = swept(whole)
    swept(cut)
    *_, last = sorted((cut / "series/agents").iterdir())
    last.unlink()  # as if its run had been under way
    draft = open_draft(last)
    draft.write(b"PAR1 half")
    draft.close()
    made, *found = swept(cut)
    assert made.done_before == 5
    assert all(one.equals(other) for one, other in zip(wanted, found, strict=True))
    files = [sorted(file.relative_to(home) for file in home.rglob("*.parquet")) for home in (whole, cut)]
    assert files[0] == files[1]


def test_runs_of_an_earlier_sweep_are_put_aside_and_not_mixed_with_those_of_the_table(tmp_path):
    swept(tmp_path)
    made, of_models, of_agents = swept(tmp_path, values=[2], seeds=1)
    assert set(of_models["run"]) == set(of_agents["run"]) == set(made.frame()["run"])
    assert [len(list((tmp_path / "series/earlier" / name).iterdir())) for name in ("model", "agents")] == [5, 5]


def test_processes_and_shards_store_the_same_series(tmp_path):
    _, *one = swept(tmp_path / "one")
    for shard in (1, 2):
        sweep(
            Reporting,
            {"n_robots": [2, 3, 4]},
            seeds=2,
            steps=4,
            out=tmp_path / "two",
            series=True,
            jobs=2,
            shard=(shard, 2),
        )
    made, *two = swept(tmp_path / "two")
    assert made.done_before == 6
    assert all(first.equals(second) for first, second in zip(one, two, strict=True))


def test_a_run_that_ends_in_an_error_has_no_series_and_is_not_done_again(tmp_path):
    made = [swept(tmp_path, values=[-1, 2], seeds=1)[0] for _ in range(2)]
    assert [(one.failed, one.done_before) for one in made] == [(1, 0), (1, 2)]
    assert made[0].frame()["run"].notna().tolist() == [False, True]


def test_compare_and_reality_gap_store_series_beside_their_ledgers(tmp_path):
    comparison = compare(FIRE, seeds=2, steps=3, jobs=1, out=tmp_path / "a", series="model")
    of_models = pd.read_parquet(tmp_path / "a/series/model")
    assert sorted(set(zip(of_models["strategy"], of_models["rng"], strict=True))) == [
        ("A", 1),
        ("A", 2),
        ("B", 1),
        ("B", 2),
    ]
    assert compare(FIRE, seeds=2, steps=3, jobs=1, out=tmp_path / "a", series="model").done_before == 4
    assert len(comparison.runs) * 3 == len(of_models)
    reality_gap("fire_fighting", dial=(0, 0.5), seeds=1, steps=3, out=tmp_path / "b", series=True)
    assert pd.read_parquet(tmp_path / "b/series/agents")["imperfections"].drop_duplicates().sort_values().tolist() == [
        0,
        0.5,
    ]


class Clashing(SwarmModel):
    """A model with reports that are named as its parameter, and as a column of series."""

    def __init__(self, *, n_robots: int = 2, name: str = "n_robots", rng=None):
        super().__init__(rng=rng, model_reporters={name: lambda model: -1})

    def results(self):
        return {"one": 1}


def test_a_parameter_with_the_name_of_a_reporter_has_a_column_beside_it(tmp_path):
    _, of_models, of_agents = swept(tmp_path, Clashing, tables=["behaviorspace"])
    assert set(zip(of_models["parameter n_robots"], of_models["n_robots"], strict=True)) == {(2, -1), (3, -1), (4, -1)}
    assert of_agents.empty
    head = (tmp_path / "behaviorspace.csv").read_text().splitlines()[6]
    assert head.startswith('"[run number]","parameter n_robots","rng","[step]",')
    assert head.endswith(',"n_robots"')


@pytest.mark.parametrize("name", ["run", "rng", "step", "unique_id"])
def test_a_reporter_that_is_named_as_a_column_of_all_series_is_refused_before_any_run(name, tmp_path):
    with pytest.raises(InvalidValueError, match=f"reporter '{name}' is named as another column of the series; rename"):
        swept(tmp_path, Clashing, settings={"name": name})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"series": "all"}, "unknown series 'all'"),
        ({"series": True}, "series are wanted and no folder is named"),
        ({"tables": ["csv"]}, "tables are wanted and no folder is named"),
        ({"tables": ["xls"]}, "unknown form of a table 'xls'"),
        ({"tables": 3}, "tables is 3; expected names"),
    ],
)
def test_wrong_series_and_tables_are_refused_in_one_line(wrong, words):
    for study in (compare, reality_gap):
        with pytest.raises(SwarmError, match=words):
            study("fire_fighting", seeds=1, steps=3, **wrong)
