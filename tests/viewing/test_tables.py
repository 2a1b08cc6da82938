import numpy as np
import pandas as pd
import pytest
from pandas.testing import assert_frame_equal
from pyarrow import parquet

from mesa_swarm import SwarmModel, disc
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.export import export
from mesa_swarm.world.statics import FIRE


@pytest.mark.parametrize("table", ["robots", "fires", "contacts"])
def test_a_parquet_file_is_read_back_as_the_table_to_the_bit(run, tmp_path, table):
    (path,) = export(run, tmp_path / "a.parquet", table=table)
    assert_frame_equal(pd.read_parquet(path), run.to_pandas(table), check_exact=True)


def test_the_loads_too(pushed, tmp_path):
    (path,) = export(pushed, tmp_path / "a.parquet", table="loads")
    assert_frame_equal(pd.read_parquet(path), pushed.to_pandas("loads"), check_exact=True)


def test_loads_and_driven_bodies_are_listed_with_their_kinds(tmp_path):
    model = SwarmModel(map="openspace", rng=1)
    for x, kind, mode in ((200, "puck", "pushed"), (300, "load", "pushed"), (400, "door", "driven")):
        model.add_body(disc((x, 300), 10), kind=kind, mode=mode, resistance=1.0 if mode == "pushed" else None)
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
        model.add_body(disc((500, 300), 10), kind="stone", mode="driven")
        model.run(1)
    (path,) = export(tmp_path / "run.arrow", tmp_path / "loads.csv", table="loads")
    table = pd.read_csv(path)
    assert table.groupby("step")["kind"].agg(list).tolist() == [["puck", "load", "door"]] * 2 + [
        ["puck", "load", "door", "stone"]
    ]
    assert table.columns[-1] == "kind"


def test_tables_are_written_in_pieces(run, tmp_path):
    (path,) = export(run, tmp_path / "a.parquet")
    assert parquet.ParquetFile(path).num_row_groups == 2


def test_a_csv_file_is_read_back_as_the_table(run, tmp_path):
    (path,) = export(run, tmp_path / "a.csv")
    table = run.to_pandas()
    assert_frame_equal(pd.read_csv(path).astype(table.dtypes), table, check_exact=True)


def test_only_the_steps_that_were_asked_for_are_in_the_table(run, tmp_path):
    table = run.to_pandas("fires")
    export(run, tmp_path / "a.csv", table="fires", every=50, first=100, last=210)
    assert pd.read_csv(tmp_path / "a.csv")["step"].unique().tolist() == [100, 150, 200]
    export(run, tmp_path / "b.parquet", table="fires", steps=[299, 7])
    wanted = table[table["step"].isin([7, 299])].reset_index(drop=True)
    assert_frame_equal(pd.read_parquet(tmp_path / "b.parquet"), wanted)


def test_fires_are_numbered_from_one_in_every_table(tmp_path):
    model = FireFighting(n_robots=20, strategy="A", rng=1)
    x, y, radius = model.fires.discs[2]
    model.robots[0].position, model.robots[0].heading = (x - radius - 12, y), 0.0
    model.control = Subsumption(Explore())
    columns = ("position", "fire", "fires", "contacts")
    with model.record(tmp_path / "run.arrow", columns=columns):
        model.run(300)
    recording = Recording(tmp_path / "run.arrow")
    tables = {}
    for table in ("robots", "fires", "contacts"):
        (path,) = export(recording, tmp_path / f"{table}.csv", table=table)
        tables[table] = pd.read_csv(path)
    assert tables["fires"]["fire"].tolist() == [*range(1, 8)] * 300
    stored = np.concatenate([frame["fire"] for frame in recording])
    assert {-1, 2} <= set(stored.tolist())
    assert tables["robots"]["fire"].tolist() == [fire + 1 if fire >= 0 else -1 for fire in stored]
    ids = [fire.unique_id for fire in model.fires]
    met = np.concatenate([frame["contacts"] for frame in recording])
    wanted = [ids.index(row["other"]) + 1 if row["kind"] == FIRE else row["other"] for row in met]
    assert (met["kind"] == FIRE).any()
    assert tables["contacts"]["other"].tolist() == wanted
