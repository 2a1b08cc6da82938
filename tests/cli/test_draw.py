"""picture, export and map: runs, recordings and maps as files."""

from pathlib import Path

import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.base import work_line as work_done
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.cli import draw
from mesa_swarm.cli.draw import DEFAULT_STEPS, drawn, parsed_steps
from mesa_swarm.maps.map import Map, builtin_maps
from mesa_swarm.model.gallery import find_model
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from support.chunks import recorded_in_full_chunks


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Return the file of 300 steps of 15 robots and 7 fires, in two chunks."""
    path = tmp_path_factory.mktemp("run") / "run.arrow"
    return recorded_in_full_chunks(FireFighting(n_robots=15, strategy="A", rng=1), path, 300)


@pytest.fixture
def exported(typed, recorded):
    """Export the recording, or another one."""
    return lambda line, source=recorded: typed(["export", str(source), *line.split()])


@pytest.mark.parametrize("name", builtin_maps())
def test_map_import_writes_what_reads_back_as_the_same_map(typed, tmp_path, name):
    status, out, _ = typed(f"map import {name}")
    assert (status, out.splitlines()[-1]) == (0, f"{name}.toml")
    assert Map.load(tmp_path / f"{name}.toml") == Map.load(name)


def test_map_import_never_replaces_a_file_unless_forced(typed, tmp_path):
    (tmp_path / "mine.toml").write_text("precious")
    status, _, err = typed("map import original mine.toml")
    assert (status, err.count("\n")) == (2, 1)
    assert "mine.toml exists already" in err
    assert (tmp_path / "mine.toml").read_text() == "precious"
    assert typed("map import original mine.toml --force")[0] == 0
    assert Map.load(tmp_path / "mine.toml") == Map.load("original")


def test_map_show_counts_what_is_there(typed):
    status, out, _ = typed("map show original")
    assert status == 0
    assert "obstacles     11 (3 discs, 8 rectangles)" in out
    assert "fires         7 (areas" in typed("map show openspace_fire")[1]


def test_map_show_draws_a_picture(typed, tmp_path):
    status, out, _ = typed("map show sparse --out drawn/sparse.png")
    assert (status, out.splitlines()[-1]) == (0, "drawn/sparse.png")
    assert (tmp_path / "drawn" / "sparse.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "steps"), [("stages", "0,20"), ("trace", "30"), ("ethogram", "30")])
def test_picture_draws_a_run_and_prints_where(typed, tmp_path, kind, steps):
    line = f"picture collision_avoidance --kind {kind} --steps {steps} --set n_robots=3 --quiet"
    path = Path("results", f"collision_avoidance_{kind}.png")
    assert typed(line) == (0, f"{path}\n", "")
    assert (tmp_path / path).read_bytes()[:4] == b"\x89PNG"
    assert [found.name for found in (tmp_path / "results").iterdir()] == [path.name]


def test_picture_takes_robots_a_seed_and_a_file_and_shows_progress(typed, tmp_path, monkeypatch):
    calls = []
    real = draw.drawn
    monkeypatch.setattr(draw, "drawn", lambda *words: (calls.append(words), real(*words))[1])
    line = "picture collision_avoidance --kind trace --steps 25 --robots 2 --rng 7 --out here/way.PNG"
    status, out, err = typed(line)
    assert (status, out) == (0, "here/way.PNG\n")
    assert err.startswith("25 of 25 steps in ")
    assert (tmp_path / "here" / "way.PNG").exists()
    ((model, *rest),) = calls
    assert rest == ["trace", [25], 2, True]
    assert model.state_hash() == find_model("collision_avoidance")(rng=7).run(25).state_hash()


def test_picture_draws_stages_unless_asked_for_another_kind(typed, monkeypatch):
    monkeypatch.setattr(draw, "DEFAULT_STEPS", {"stages": "0,5"})
    assert typed("picture agglomeration --quiet") == (0, "results/agglomeration_stages.png\n", "")


@pytest.mark.parametrize(("kind", "panels"), [("stages", 2), ("trace", 1), ("ethogram", 2)])
def test_each_kind_of_picture_runs_the_model_and_draws_its_panels(kind, panels):
    model = CollisionAvoidance(n_robots=3, rng=1)
    steps = [10, 25] if kind == "stages" else [25]
    figure = drawn(model, kind, steps, None, progress=False)
    assert (len(figure.axes), model.steps) == (panels, 25)


def test_the_default_steps_of_each_kind_can_be_parsed():
    for kind, text in DEFAULT_STEPS.items():
        assert parsed_steps(text, several=kind == "stages")


@pytest.mark.parametrize("text", ["", "1,", "a", "-5", "2.5", "1e3", "10000001", "1 2"])
@pytest.mark.parametrize("several", [True, False])
def test_text_that_is_not_steps_is_refused(text, several):
    with pytest.raises(InvalidValueError, match=r"steps is '.*'; expected .*, at most 10,000,000"):
        parsed_steps(text, several)


def test_several_steps_are_refused_where_one_is_expected():
    assert parsed_steps(" 5 , 10", several=True) == [5, 10]
    with pytest.raises(InvalidValueError, match="expected one number of steps"):
        parsed_steps("5,10", several=False)


def test_export_prints_the_files_and_shows_progress_with_the_time_left(exported, tmp_path, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    status, out, err = exported("out.svg --steps 0,300")
    assert (status, out) == (0, "out_000.svg\nout_300.svg\n")
    assert "2/2 pictures" in err
    assert "left, done at" in err
    assert exported("a.csv --table fires --every 100 --quiet") == (0, "a.csv\n", "")
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 1 + 3 * 7


def test_export_takes_steps_speed_size_trails_and_sectors(exported, tmp_path):
    line = "out.gif --from 10 --to 20 --every 5 --fps 10 --size 80x64 --trails 5 --sectors --quiet"
    assert exported(line) == (0, "out.gif\n", "")
    assert exported("out.svg --animate --to 4 --quiet") == (0, "out.svg\n", "")
    assert "<animateTransform" in (tmp_path / "out.svg").read_text()


@pytest.mark.parametrize(
    "line",
    [
        "out.doc",
        "out.png --steps 1,x",
        "out.png --steps 999",
        "out.png --size 12",
        "out.gif --fps 99",
        "out.gif --steps 3",
        "out.csv --table fire",
        "out.mp4 --size 65x65",
        "/proc/out.png",
        "nowhere/out.png",
        "nowhere/out.csv",
        "out.png --every 0",
    ],
)
def test_a_wrong_export_is_refused_in_one_line_with_status_2(exported, tmp_path, line):
    status, out, err = exported(f"{line} --quiet")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_an_export_replaces_files_only_by_force(exported, tmp_path):
    (tmp_path / "a.csv").write_text("precious")
    assert exported("a.csv --quiet")[0] == 2
    assert (tmp_path / "a.csv").read_text() == "precious"
    assert exported("a.csv --quiet --force")[0] == 0


@pytest.mark.filterwarnings("default")
def test_a_torn_recording_is_exported_up_to_its_end_with_a_warning(exported, tmp_path, recorded):
    (tmp_path / "torn.arrow").write_bytes(recorded.read_bytes()[:-200])
    status, out, err = exported("a.csv --quiet", "torn.arrow")
    assert (status, out) == (0, "a.csv\n")
    assert err == "mesa-swarm: warning: torn.arrow was not closed: its 256 whole rows are exported\n"


def test_export_makes_no_folder(exported):
    status, _, err = exported("nowhere/a.csv --quiet")
    assert (status, err) == (2, "mesa-swarm: folder nowhere does not exist; make it first, or choose another place\n")


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_an_empty_table_is_written_with_a_warning(exported, tmp_path, kind):
    model = SwarmModel(rng=1)
    with model.record(tmp_path / "bare.arrow"):
        model.run(3)
    status, out, err = exported(f"a.{kind} --table fires --quiet", "bare.arrow")
    assert (status, out) == (0, f"a.{kind}\n")
    assert err == "mesa-swarm: warning: bare.arrow has no fires in these steps: the table is empty\n"


def test_an_unknown_table_is_refused_before_an_existing_file(exported, tmp_path):
    (tmp_path / "a.csv").write_text("precious")
    assert "table 'fire'; did you mean 'fires'" in exported("a.csv --table fire --quiet")[2]
