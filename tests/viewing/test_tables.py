import pandas as pd
import pytest
from pandas.testing import assert_frame_equal
from pyarrow import parquet

from mesa_swarm.viewing.export import export


@pytest.mark.parametrize("table", ["robots", "fires", "contacts"])
def test_a_parquet_file_is_read_back_as_the_table_to_the_bit(run, tmp_path, table):
    (path,) = export(run, tmp_path / "a.parquet", table=table)
    assert_frame_equal(pd.read_parquet(path), run.to_pandas(table), check_exact=True)


def test_the_loads_too(pushed, tmp_path):
    (path,) = export(pushed, tmp_path / "a.parquet", table="loads")
    assert_frame_equal(pd.read_parquet(path), pushed.to_pandas("loads"), check_exact=True)


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
