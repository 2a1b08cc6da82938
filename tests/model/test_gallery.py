"""Models by name and address: files, modules, installed packages, and how wrong ones are refused."""

import json
import os
import subprocess
import sys

import pytest

from mesa_swarm import AGENT9, compare, show, sweep
from mesa_swarm.base.errors import InvalidValueError, RecordingError, SwarmError, UnknownNameError
from mesa_swarm.cli import main
from mesa_swarm.model import gallery
from mesa_swarm.model.gallery import (
    check_model_name,
    description,
    find_model,
    gallery_names,
    loaded_models,
    model_address,
    model_names,
    short_name,
)
from mesa_swarm.model.parameters import parameters_of
from support.own_models import BARE, install_package, write_model


@pytest.fixture(autouse=True)
def folder(model_folder):
    """Work in an empty folder."""
    return model_folder


@pytest.fixture
def typed(capsys):
    """Type a command; get its exit status, output and errors."""

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            main(line.split())
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


@pytest.fixture
def installed(folder, monkeypatch):
    """Install a package with one model that works and one that does not."""
    site = folder / "site"
    install_package(site, {"ant_hill": "anthill.trails:AntTrails", "spoilt": "anthill.trails:Nothing"})
    monkeypatch.syspath_prepend(str(site))
    return site


def test_a_file_is_imported_once_and_its_class_is_the_same_by_every_path(folder):
    path = write_model(folder)
    found = find_model("./mine.py:Foraging")
    assert found is find_model(str(path)) is find_model("mine.py") is find_model("mine:Foraging")
    assert (found.__module__, model_address(found)) == ("mine", "mine:Foraging")


def test_a_package_in_the_current_folder_is_found_by_its_module(folder):
    write_model(folder / "swarms", "foragers.py")
    assert find_model("swarms.foragers:Foraging").__module__ == "swarms.foragers"


def test_files_of_one_name_and_those_named_as_a_module_are_different_modules(folder):
    write_model(folder / "one")
    write_model(folder / "two")
    write_model(folder, "json.py")
    first, second, third = map(find_model, ("one/mine.py", "two/mine.py", "./json.py:Foraging"))
    assert len({first, second, third}) == 3
    assert sys.modules["json"] is json
    assert (model_address(first), model_address(second), model_address(third)) == ("mine:Foraging",) * 2 + (
        "json:Foraging",
    )


def test_a_file_may_import_what_lies_beside_it(folder):
    (folder / "sub").mkdir()
    (folder / "sub" / "lengths.py").write_text("LONG = 3\n")
    (folder / "sub" / "mine.py").write_text(
        "from lengths import LONG\nfrom mesa_swarm import SwarmModel\nclass Long(SwarmModel):\n    size = LONG\n"
    )
    assert find_model("sub/mine.py:Long").size == 3


WRONG = {
    "./nothing.py:A": (UnknownNameError, "no such file"),
    "./two.py": (InvalidValueError, r"has several models; add one of :First, :Second"),
    "./two.py:Third": (UnknownNameError, "there is no class 'Third'; known models: First, Second"),
    "./two.py:number": (InvalidValueError, "is 3; expected a subclass of mesa_swarm.SwarmModel"),
    "./two.py:Path": (InvalidValueError, "expected a subclass of mesa_swarm.SwarmModel"),
    "./none.py": (InvalidValueError, "has no model; expected a subclass"),
    "./fails.py:A": (InvalidValueError, r"cannot be imported: fails.py, line 3: ZeroDivisionError: division by zero"),
    "./leaves.py:A": (InvalidValueError, "cannot be imported: leaves.py, line 2: SystemExit: 7"),
    "./needs.py:A": (InvalidValueError, "needs.py, line 1: ModuleNotFoundError: No module named 'not_there_at_all'"),
    "./half.py:A": (InvalidValueError, "half.py, line 1: SyntaxError"),
    "not_there_at_all.models:A": (UnknownNameError, "there is no module 'not_there_at_all'"),
    "mesa_swarm.nothing:A": (UnknownNameError, "there is no module 'mesa_swarm.nothing'"),
    "fire_figting": (UnknownNameError, "did you mean 'fire_fighting'"),
    "\0.py:A": (UnknownNameError, "no such file"),
    "": (UnknownNameError, "unknown model ''"),
}


@pytest.mark.parametrize("address", WRONG)
def test_a_wrong_address_is_refused_in_one_line(folder, address):
    (folder / "two.py").write_text(
        "from pathlib import Path\nfrom mesa_swarm import SwarmModel\nnumber = 3\n"
        "class First(SwarmModel): pass\nclass Second(SwarmModel): pass\n"
    )
    (folder / "none.py").write_text("from mesa_swarm import SwarmModel\n")
    (folder / "fails.py").write_text("\n\n1 / 0\n")
    (folder / "leaves.py").write_text("import sys\nsys.exit(7)\n")
    (folder / "needs.py").write_text("import not_there_at_all\n")
    (folder / "half.py").write_text("def half(:\n")
    kind, words = WRONG[address]
    with pytest.raises(kind, match=words) as refused:
        find_model(address)
    assert "\n" not in str(refused.value)
    assert "fails" not in sys.modules


@pytest.mark.parametrize("name", [3, None, ["a"]])
def test_what_is_no_text_is_not_a_model(name):
    with pytest.raises(SwarmError, match="unknown model"):
        check_model_name(name)


def test_an_address_is_checked_without_an_import(folder):
    (folder / "fails.py").write_text("1 / 0\n")
    assert check_model_name("./fails.py:A") == "./fails.py:A"


def test_the_gallery_has_only_models_of_its_own(installed):
    assert "ant_hill" in model_names()
    assert "ant_hill" not in gallery_names()


def test_an_installed_model_is_listed_and_one_that_cannot_be_loaded_is_listed_with_the_reason(installed, typed):
    found, faults = loaded_models()
    assert found["ant_hill"].__name__ == "AntTrails"
    assert list(faults) == ["spoilt"]
    status, out, _ = typed("list")
    assert status == 0
    assert "ant_hill\n    Robots that forage.\n      n_robots=2                   robots\n" in out
    assert (
        "spoilt\n    not loaded: spoilt (an entry point of anthill): anthill.trails:Nothing: there is no class" in out
    )
    status, _, err = typed("run spoilt --steps 1")
    assert (status, err.count("\n")) == (2, 1)
    assert "there is no class 'Nothing'; known models: AntTrails" in err


def test_a_name_in_two_packages_is_refused_with_both_addresses(installed, monkeypatch):
    other = installed.parent / "other"
    install_package(other, {"ant_hill": "termites.trails:AntTrails"}, "termites")
    monkeypatch.syspath_prepend(str(other))
    with pytest.raises(InvalidValueError, match=r"anthill\.trails:AntTrails, termites\.trails:AntTrails"):
        find_model("ant_hill")


def test_a_model_of_the_gallery_is_never_replaced_by_an_installed_one(folder, monkeypatch):
    install_package(folder / "site", {"boids": "anthill.trails:AntTrails"})
    monkeypatch.syspath_prepend(str(folder / "site"))
    assert find_model("boids").__name__ == "Boids"


@pytest.mark.slow
def test_an_installed_model_is_run_and_compared_by_processes_of_their_own(installed):
    code = (
        "from mesa_swarm import compare; from mesa_swarm.dashboard import page_models\n"
        "if __name__ == '__main__':\n"
        "    found = compare('ant_hill', seeds=2, jobs=2)\n"
        "    print(found.column(2, 'x') == compare('ant_hill', seeds=2, jobs=1).column(2, 'x'), page_models())\n"
    )
    path = os.pathsep.join([str(installed), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("True [")
    assert "'ant_hill'" in done.stdout
    assert "spoilt" not in done.stdout


@pytest.mark.slow
def test_workers_import_the_files_of_models_even_if_they_were_started_before(folder):
    compare("agglomeration", "n_robots", [4, 5], seeds=1, steps=2, jobs=2)
    write_model(folder)
    write_model(folder / "sub")
    for address in ("./mine.py:Foraging", "sub/mine.py"):
        results = [compare(address, seeds=2, jobs=jobs).column(2, "x") for jobs in (1, 2)]
        assert results[0] == results[1]


def test_runs_of_a_file_are_done_once_wherever_its_folder_is(folder):
    for place in ("here", "there"):
        write_model(folder / place)
        made = sweep(f"{place}/mine.py:Foraging", {"n_robots": [2]}, seeds=2, out=folder / "results", jobs=1)
    assert made.done_before == 2


@pytest.mark.slow
def test_commands_take_addresses_and_name_files_after_the_class(folder, typed):
    write_model(folder, name="AntTrails")
    assert typed("run ./mine.py:AntTrails --steps 5 --quiet")[0] == 0
    assert typed("list ./mine.py")[1].startswith("./mine.py\n    Robots that forage.\n      n_robots=2")
    assert typed("diagnose mine:AntTrails --steps 5 --quiet")[0] == 0
    assert typed("picture ./mine.py:AntTrails --kind trace --steps 5 --quiet")[1] == "results/ant_trails_trace.png\n"
    assert typed("compare ./mine.py:AntTrails --seeds 2 --jobs 1 --quiet")[0] == 0
    assert typed("reality-gap ./mine.py:AntTrails --seeds 2 --jobs 1 --quiet")[0] == 0
    assert {path.name for path in (folder / "results").iterdir()} == {
        "ant_trails_trace.png",
        "compare_ant_trails",
        "reality_gap_ant_trails",
    }


def test_a_job_names_a_file_in_its_own_folder(folder, typed):
    write_model(folder / "jobs")
    (folder / "jobs" / "a.toml").write_text('model = "./mine.py:Foraging"\nsteps = 3\nseeds = 2\n')
    assert typed("run jobs/a.toml --quiet")[0] == 0
    assert typed("sweep jobs/a.toml --jobs 1 --quiet")[1] == "results/a/runs.parquet: 2 runs\n"
    (folder / "jobs" / "b.toml").write_text('model = "../mine.py:Foraging"\nsteps = 3\n')
    status, _, err = typed("run jobs/b.toml")
    assert (status, "leads out of the job's folder" in err) == (2, True)


def test_a_recording_is_run_again_only_with_a_model_that_the_user_names(folder, typed):
    write_model(folder)
    typed("run ./mine.py:Foraging --steps 5 --record run.arrow --quiet")
    del sys.modules["mine"]
    gallery._FILES.paths.clear()
    status, _, err = typed("verify run.arrow --quiet")
    assert (status, "mesa-swarm verify FILE --model mine:Foraging" in err) == (2, True)
    assert "mine" not in sys.modules
    assert typed("verify run.arrow --model ./mine.py:Foraging --quiet")[:2] == (
        0,
        "all 5 rows to step 5 are the same\n",
    )
    model = find_model("./mine.py:Foraging")
    assert model.verify("run.arrow").same
    assert model.resume("run.arrow", step=3).run(2).state_hash() == model(rng=1).run(5).state_hash()


@pytest.mark.slow
def test_a_recording_of_a_program_is_that_of_the_same_file_by_its_address(folder, typed):
    path = write_model(folder)
    text = path.read_text() + (
        "\n\nif __name__ == '__main__':\n    model = Foraging(rng=1)\n"
        "    with model.record('run.arrow'):\n        model.run(3)\n"
    )
    path.write_text(text)
    subprocess.run([sys.executable, "mine.py"], check=True)
    assert typed("verify run.arrow --model ./mine.py:Foraging --quiet")[0] == 0
    write_model(folder, "other.py", "Other")
    with pytest.raises(RecordingError, match=r"is of 'Foraging', which is neither Other nor a loaded subclass of it"):
        find_model("./other.py").verify("run.arrow")


def test_a_bare_model_has_the_parameters_of_its_signature_and_those_of_every_model(folder):
    (folder / "bare.py").write_text(BARE)
    bare = find_model("./bare.py")
    known = parameters_of(bare)
    assert list(known) == ["n_robots", "flag", "size", "note", "shape", "noise", "slip", "imperfections"]
    assert (known["n_robots"].parse("3"), known["flag"].parse("false"), known["size"].parse("")) == (3, False, None)
    assert description(bare) == ""


def test_a_model_is_shown_by_its_name_class_or_address(folder):
    write_model(folder)
    model = find_model("boids")(n_robots=4, rng=1)
    canvases = [show(model), show(type(model), n_robots=4), show("boids", n_robots=4), show("./mine.py", rng=1)]
    assert {type(canvas).__name__ for canvas in canvases} == {"SwarmCanvas"}
    with pytest.raises(InvalidValueError, match="n_robots: given beside a model"):
        show(model, n_robots=4)
    with pytest.raises(InvalidValueError, match="model is RobotDesign"):
        show(AGENT9)


def test_names_for_files_are_made_of_addresses():
    assert short_name("a.b:HTTPThing") == "httpthing"
    assert short_name("./x y.py") == "model"
    assert short_name("../../etc/passwd.py:A/B") == "model"
