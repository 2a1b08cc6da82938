import os
import random
import string
from pathlib import Path

import pytest

from mesa_swarm.base.errors import InvalidValueError, JobError
from mesa_swarm.experiments import jobs
from mesa_swarm.experiments.jobs import read_job, recorded_to, sample_jobs
from mesa_swarm.experiments.run_records import RunRecords, chosen_options
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model
from support.pace import work_within

RICH = """
[[run]]
name = "points"
model = "fire_fighting"
map = "openspace_fire"
robots = 5
steps = 10
seeds = [3, 4]
measure = ["fires out"]
record = { file = "runs/{name}/{seed}.arrow", every = 5, columns = ["position"] }
[run.parameters]
k1 = 0.001
strategy = "A"
[run.grid]
leave = [100.0, 200.0]
[[run]]
model = "collision_avoidance"
steps = 10
[run.sample]
kind = "sobol"
points = 4
rng = 2
ranges = { distance = [5.0, 20.0], n_robots = [2, 6] }
"""
MODEL = 'model = "fire_fighting"\n'


@pytest.fixture
def read(tmp_path):
    """Read a text, or bytes, as a job file."""

    def read_text(text):
        file = tmp_path / "job.toml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_job(file)

    return read_text


def refused(read, text):
    with pytest.raises(JobError) as caught:
        read(text)
    message = str(caught.value)
    assert message.startswith("job.toml: ")
    assert "\n" not in message
    return message


def test_a_job_names_model_map_robots_parameters_steps_seeds_recordings_and_measures(read, tmp_path):
    job = read(RICH)
    first, second = job.experiments
    assert (first.name, first.model_class, first.steps) == ("points", find_model("fire_fighting"), 10)
    assert first.settings == {"map": "openspace_fire", "n_robots": 5, "k1": 0.001, "strategy": "A"}
    assert (tuple(first.points), tuple(first.seeds)) == (({"leave": 100.0}, {"leave": 200.0}), (3, 4))
    assert first.measures == ("fires out",)
    assert job.records[0].path("points", 3) == tmp_path / "runs" / "points" / "3.arrow"
    assert job.records[0].options == {"every": 5, "columns": ["position"], "exact": False}
    assert job.records[1] is None
    assert (second.name, len(second.points), list(second.seeds)) == ("run_2", 4, [1])
    assert all(5 <= point["distance"] <= 20 and point["n_robots"] in range(2, 7) for point in second.points)


@pytest.mark.parametrize(("count", "first"), [(2, "run_1"), (11, "run_01")])
def test_runs_without_names_are_numbered_so_that_their_names_sort(read, count, first):
    names = [one.name for one in read(f"[[run]]\n{MODEL}steps = 5\n" * count).experiments]
    assert (len(names), names[0], names[-1]) == (count, first, f"run_{count}")
    assert names == sorted(names)


def test_steps_are_by_default_those_that_the_model_declares(read):
    assert read(MODEL).experiments[0].steps == find_model("fire_fighting").steps_to_compare


@pytest.mark.parametrize("name", sample_jobs())
def test_every_sample_job_can_be_read_by_its_name(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert all(len(experiment) == 1 for experiment in read_job(name).experiments)


def test_a_file_of_ones_own_comes_before_the_sample_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fire_fighting_1.toml").write_text(MODEL + "steps = 7")
    assert read_job("fire_fighting_1.toml").experiments[0].steps == 7


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ('modl = "boids"', "unknown key 'modl'; did you mean 'model'?"),
        ("steps = 3", "model is missing"),
        ('model = "fire_figting"', "did you mean 'fire_fighting'?"),
        (MODEL + "steps = 0", "steps is 0"),
        (MODEL + "steps = true", "steps is True"),
        (MODEL + "robots = 2.5", "robots is 2.5"),
        (MODEL + "robots = 100000", "do not fit"),
        (MODEL + "seeds = [1, 1]", "expected different ones"),
        (MODEL + "seeds = []", "number of seeds is 0"),
        (MODEL + "seeds = [-1]", "seeds is -1"),
        (MODEL + "record = 3", "record is 3; expected a valid table"),
        (MODEL + "record = {}", "[record] file is missing"),
        (MODEL + 'record = { file = "a.arrow", evry = 2 }', "[record] unknown key 'evry'; did you mean 'every'?"),
        (MODEL + 'record = { file = "a.arrow", every = 0 }', "every is 0"),
        (MODEL + 'record = { file = "a.arrow", exact = 1 }', "[record] exact is 1"),
        (MODEL + 'record = { file = "a.arrow", columns = ["postion"] }', "did you mean 'position'?"),
        (MODEL + 'record = { file = "a.arrow", overwrite = true }', "[record] unknown key 'overwrite'"),
        (MODEL + 'record = "a.arrow"\nseeds = 2', "put {seed} into its name"),
        (MODEL + 'record = "a_{sed}.arrow"', "did you mean 'seed'?"),
        (MODEL + 'record = "{seed.real}.arrow"', "unknown place"),
        (MODEL + 'record = "{{seed}}.arrow"', "is not a name for a recording"),
        (MODEL + 'record = "job.toml"', "does not end in .arrow"),
        (MODEL + 'record = "a/.arrow"', "is not a name for a recording"),
        (MODEL + 'record = "-rf.arrow"', "is not a name for a recording"),
        (MODEL + 'record = "{seed}.arrow"\nseeds = 20_000', "number of recordings is 20000"),
        (f"[[run]]\n{MODEL}record = 'a.arrow'\n" * 2, "two runs are recorded to"),
        (f"[[run]]\n{MODEL}record = 'a.arrow'\n[[run]]\n{MODEL}record = 'A.arrow'", "two runs are recorded to"),
        (MODEL + 'measure = ["fires ot"]', "did you mean 'fires out'?"),
        (MODEL + "measure = [1]", "measure is 1"),
        (MODEL + "parameters = 3", "parameters is 3"),
        (MODEL + "[parameters]\nn_robotz = 3", "did you mean 'n_robots'?"),
        (MODEL + "[parameters]\nk1 = nan", "k1 is nan"),
        (MODEL + '[parameters]\nk1 = "high"', "k1 is 'high'"),
        (MODEL + "robots = 3\n[parameters]\nn_robots = 3", "n_robots is set twice"),
        (MODEL + "robots = 3\n[grid]\nn_robots = [3]", "n_robots is set and varied at once"),
        (MODEL + "[grid]\nk1 = []", "expected a list of values"),
        (MODEL + "[grid]\nk1 = [1, 1.0]", "1.0 twice"),
        (MODEL + "[sample]\npoint = 4", "[sample] unknown key 'point'; did you mean 'points'?"),
        (MODEL + '[sample]\nkind = "sobol"\npoints = 5\nranges = { k1 = [0, 1] }', "such as 8"),
        (MODEL + '[sample]\nkind = "sobl"\npoints = 4\nranges = { k1 = [0, 1] }', "did you mean 'sobol'?"),
        (
            MODEL + '[sample]\nkind = "sobol"\npoints = 4\nranges = { k1 = [1, 0] }',
            "the lower end first",
        ),
        (
            MODEL + '[sample]\nkind = "sobol"\npoints = 4\nranges = { strategy = [1, 0] }',
            "unknown strategy 1; known: A, B",
        ),
        (MODEL + 'name = "a/b"', "it names a folder"),
        (f"{MODEL}[[run]]\n{MODEL}", "'model' stands beside [[run]]"),
        ("run = 3", "double brackets"),
        (f"[[run]]\n{MODEL}[[run]]\n{MODEL}steps = -1", "run 2: steps is -1"),
        (f'[[run]]\n{MODEL}name = "a"\n[[run]]\n{MODEL}name = "a"', "two runs are named 'a'"),
        ("steps = ", "Invalid value (at end of document)"),
        (b"model = \xff", "UTF-8"),
        ("a" + ".a" * 4_000 + " = 1", "dotted names"),
        (MODEL + "steps" + ".a" * 4_000 + " = 1", "dotted names"),
        ("a = " + "[" * 5_000, "nested too deeply"),
        (MODEL + "steps = " + "9" * 5_000, "4300"),
    ],
)
def test_a_wrong_job_is_refused_in_one_line_that_names_file_and_place(read, text, reason):
    assert reason in refused(read, text)


def test_a_map_in_the_jobs_folder_is_read_and_kept(read, tmp_path):
    (tmp_path / "maps").mkdir()
    Map.load("openspace_fire").save(tmp_path / "maps" / "mine.toml")
    assert read(MODEL + 'map = "maps/mine.toml"').experiments[0].settings["map"] == Map.load("openspace_fire")


@pytest.mark.parametrize("name", ["nul.arrow", "CON.arrow", "runs/com1/a.arrow", "aux.old.arrow", "CONOUT$.arrow"])
def test_a_recording_is_no_device_of_any_system(read, name):
    assert "is the name of a device" in refused(read, f'{MODEL}record = "{name}"')


WAYS_OUT = (
    "../mine.toml",
    "/etc/mine.toml",
    "maps/../../mine.toml",
    "C:/mine.toml",
    "..\\mine.toml",
    "\\\\host\\a.toml",
)


@pytest.mark.parametrize(
    "table",
    ["map = '{}'", "parameters = {{ map = '{}' }}", "grid = {{ map = ['{}'] }}", "record = '{}'", "record.file = '{}'"],
)
@pytest.mark.parametrize("way", WAYS_OUT)
def test_a_path_that_leads_out_of_the_jobs_folder_is_refused(read, way, table):
    assert "leads out of the job's folder" in refused(read, MODEL + table.format(way))


@pytest.mark.parametrize("linked", ["mine.toml", "maps"])
def test_a_path_through_a_link_is_refused(read, tmp_path, linked):
    away = tmp_path.parent / f"{tmp_path.name}_away"
    away.mkdir()
    Map.load("openspace_fire").save(away / "mine.toml")
    os.symlink(away / "mine.toml" if linked == "mine.toml" else away, tmp_path / linked)
    name = "mine.toml" if linked == "mine.toml" else "maps/mine.toml"
    assert "reached by a link" in refused(read, f'{MODEL}map = "{name}"')
    assert "reached by a link" in refused(read, f'{MODEL}record = "{name}"')


def test_a_missing_job_suggests_the_nearest_sample():
    with pytest.raises(JobError, match=r"did you mean 'fire_fighting_1.toml'"):
        read_job("fire_fihting_1.toml")


def mutated(text, chance):
    """Return a job text with one to three things wrong, or by chance none."""
    for _ in range(chance.randint(1, 3)):
        text = chance.choice([without, doubled, spoilt, cut, replaced])(text, chance)
    return text


def without(text, chance):
    lines = text.splitlines()
    return "\n".join(lines[:at] + lines[at + 1 :]) if (at := chance.randrange(len(lines) or 1)) < len(lines) else text


def doubled(text, chance):
    lines = text.splitlines() or [""]
    line = chance.choice(lines)
    lines.insert(chance.randrange(len(lines)), line)
    return "\n".join(lines)


def spoilt(text, chance):
    at = chance.randrange(len(text) or 1)
    return text[:at] + chance.choice([*string.printable, "\0", "\u202e", "é", ""]) + text[at + 1 :]


def cut(text, chance):
    return text[: chance.randrange(len(text) or 1)] if chance.random() < 0.2 else text


def replaced(text, chance):
    lines = text.splitlines() or [""]
    at = chance.randrange(len(lines))
    value = chance.choice(
        [
            "-1",
            "nan",
            "inf",
            "true",
            '""',
            "[]",
            "{}",
            "1e400",
            "1979-05-27",
            "[[1]]",
            '"../x.toml"',
            "9" * 30,
            '"a\\nb"',
        ]
    )
    lines[at] = f"{lines[at].partition('=')[0]}= {value}"
    return "\n".join(lines)


def check_mutated(read, count, first):
    standard = Path(jobs.__file__).with_name("standard_jobs")
    bases = [RICH, *((standard / name).read_text() for name in sample_jobs())]
    fine = 0
    read(RICH)  # imports and compilation are not part of the second
    for number in range(first, first + count):
        chance = random.Random(number)
        text = mutated(chance.choice(bases), chance)
        try:
            with work_within(1, text):
                read(text)
            fine += 1
        except JobError as error:
            message = str(error)
            assert message.startswith("job.toml: "), text
            assert message.isprintable(), text
            assert len(message) < 600, text
    assert 0 < fine < count


@pytest.mark.slow
def test_a_hundred_spoilt_jobs_are_read_or_refused_in_one_clear_line(read):
    check_mutated(read, 100, first=0)


@pytest.mark.long
def test_two_thousand_spoilt_jobs_are_read_or_refused_in_one_clear_line(read):
    check_mutated(read, 2_000, first=100)


def test_a_link_that_is_put_there_after_the_job_was_read_is_not_followed(tmp_path):
    records = RunRecords(folder=tmp_path, file="runs/{seed}.arrow")
    (tmp_path / "away").mkdir()
    (tmp_path / "runs").symlink_to(tmp_path / "away")
    with pytest.raises(InvalidValueError, match="reached by a link"):
        records.path("run_1", 1)


def test_a_job_is_recorded_to_files_in_any_folder_with_the_options_that_it_has():
    job = recorded_to(read_job("fire_fighting_1.toml"), Path("/runs/{name}.arrow"))
    assert (job.name, [len(experiment) for experiment in job.experiments]) == ("fire_fighting_1", [1])
    assert job.records[0].path("first", 7).as_posix() == "/runs/first.arrow"


@pytest.mark.parametrize(
    ("record", "options"), [(True, {}), ({"every": 10}, {"every": 10}), (False, None), (None, None)]
)
def test_nothing_is_recorded_by_default_and_true_records_with_the_defaults(record, options):
    assert chosen_options(record) == options


def test_a_job_may_name_a_map_as_the_thesis_does_and_a_file_in_its_folder_comes_first(read, tmp_path):
    named = MODEL + 'map = "openspace_FIRE.map"'
    assert read(named).experiments[0].settings["map"] == "openspace_fire"
    (tmp_path / "openspace_FIRE.map").write_text("[Obstacle('cir', [[20, 20], 10]), Fire([[90, 90], 9])]")
    assert read(named).experiments[0].settings["map"].name == "openspace_FIRE"
