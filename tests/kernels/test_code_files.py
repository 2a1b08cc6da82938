"""Files of machine code: damaged ones are as good as none, those of an installation are read wherever it lies."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.kernels import code_files
from mesa_swarm.kernels.code_files import (
    MOST_VERSIONS,
    REPORTED,
    SEAL_BYTES,
    drop_damaged,
    file_of,
    is_stored,
    read_code,
    why_not_stored,
    why_unwritable,
    write_code,
)
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.machines import name_machine
from support.disks import read_only


@compiled
def tripled(x):
    return 3 * x


@pytest.fixture
def folders(monkeypatch, tmp_path):
    """Empty folders of an installation and of a user; a function that forbids writing to one of them."""
    monkeypatch.setattr(code_files, "HOME", tmp_path / "home")
    monkeypatch.setattr(code_files, "_folder_of_user", lambda: tmp_path / "user")
    monkeypatch.setattr(code_files, "SHIPPED", tmp_path / "shipped")
    monkeypatch.setattr(code_files, "problems", [])
    monkeypatch.setenv(REPORTED, "")  # is unset again after the test
    monkeypatch.delenv(REPORTED)
    for cached in (code_files.list_folders, why_unwritable):
        cached.cache_clear()
    yield Folders(tmp_path / "home" / name_machine(), tmp_path / "user" / name_machine())
    for cached in (code_files.list_folders, why_unwritable):
        cached.cache_clear()


class Folders:
    """Those of an installation and of a user, for this machine."""

    def __init__(self, home, user):
        self.home, self.user = home, user

    def forbid(self, folder):
        """Put a file where the folder would be: not even the system's administrator can write there."""
        if folder.exists():
            folder.rename(folder.with_name("kept"))
        folder.parent.mkdir(exist_ok=True)
        folder.write_text("")
        code_files.list_folders.cache_clear()
        why_unwritable.cache_clear()


def test_what_was_written_is_read_and_replaced_by_what_is_written_later(folders):
    for code in (b"first", b"", b"second"):
        write_code("a/f.nbc", code)
        assert list(read_code("a/f.nbc")) == [code]
    assert [path.name for path in folders.home.rglob("*")] == ["a", "f.nbc"]
    assert not folders.user.exists()


CODE = bytes(range(256)) * 3
DAMAGES = st.one_of(
    st.integers(0, len(CODE) + SEAL_BYTES - 1).map(lambda end: lambda whole: whole[:end]),
    st.integers(0, len(CODE)).map(lambda n: lambda whole: b"\0" * n),
    st.binary(max_size=900).map(lambda noise: lambda whole: noise),
    st.tuples(st.integers(0, len(CODE) + SEAL_BYTES - 1), st.integers(1, 255)).map(
        lambda flip: lambda whole: whole[: flip[0]] + bytes([whole[flip[0]] ^ flip[1]]) + whole[flip[0] + 1 :]
    ),
    st.tuples(st.integers(0, len(CODE)), st.integers(16, 400)).map(
        lambda hole: lambda whole: whole[: hole[0]] + b"\0" * hole[1] + whole[hole[0] + hole[1] :]
    ),
    st.binary(min_size=1, max_size=50).map(lambda more: lambda whole: whole + more),
)


@given(DAMAGES)
def test_a_file_that_is_cut_off_emptied_or_changed_anywhere_holds_nothing(tmp_path_factory, damage):
    folder = tmp_path_factory.mktemp("code")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(code_files, "list_folders", lambda: (folder,))
        write_code("f.nbc", CODE)
        whole = (folder / "f.nbc").read_bytes()
        (folder / "f.nbc").write_bytes(damage(whole))
        assert is_stored("f.nbc") == (damage(whole) == whole)
        assert list(read_code("f.nbc")) == ([CODE] if damage(whole) == whole else [])


def stored_anew(x):
    """Call a new dispatcher of a function; return the result, and whether the code was on disk."""
    function = compiled(tripled.py_func)
    return function(x), bool(function.stats.cache_hits)


@pytest.mark.parametrize("content", [b"", b"\0" * 50_000, b"\x80\x05.", b"damage", None])
def test_damaged_code_is_compiled_anew_and_its_file_replaced(folders, content):
    assert stored_anew(2) == (6, False)
    (file,) = folders.home.glob("*.nbc")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if content is None else content)
    assert stored_anew(2) == (6, False)
    assert list(read_code(file.name))
    assert stored_anew(2) == (6, True)


def test_whole_code_that_is_of_another_function_or_no_code_is_compiled_anew(folders):
    stored_anew(2)
    (file,) = folders.home.glob("*.nbc")
    for content in (b"no pickle", code_files.dumps((("another",), "code")), code_files.dumps(3)):
        write_code(file.name, content)
        assert stored_anew(2) == (6, False)
    assert stored_anew(2) == (6, True)


def test_code_of_a_read_only_installation_is_read_and_new_code_goes_to_the_users_folder(folders, monkeypatch):
    stored_anew(2)
    monkeypatch.setattr(code_files, "why_unwritable", lambda folder: "denied" if folder == folders.home else "")
    code_files.list_folders.cache_clear()
    assert stored_anew(2) == (6, True)
    assert not folders.user.exists()
    assert stored_anew(2.5) == (7.5, False)
    assert stored_anew(2.5) == (7.5, True)
    assert [len(list(folder.glob("*.nbc"))) for folder in (folders.home, folders.user)] == [1, 1]


def test_damaged_code_that_cannot_be_replaced_is_replaced_in_the_users_folder(folders, monkeypatch):
    stored_anew(2)
    (file,) = folders.home.glob("*.nbc")
    file.write_bytes(b"")
    monkeypatch.setattr(code_files, "why_unwritable", lambda folder: "denied" if folder == folders.home else "")
    code_files.list_folders.cache_clear()
    assert [stored_anew(2) for _ in range(2)] == [(6, False), (6, True)]
    assert file.read_bytes() == b""


def test_where_nothing_can_be_written_one_line_reports_it_and_all_is_compiled(folders, capsys):
    folders.forbid(folders.home)
    assert why_not_stored() == ""
    folders.forbid(folders.user)
    assert [stored_anew(x) for x in (2, 2.5, 2)] == [(6, False), (7.5, False), (6, False)]
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"mesa-swarm: machine code cannot be stored ({folders.home}: ")
    assert line.endswith("set NUMBA_CACHE_DIR to a folder that can be written to; until then each start compiles anew")
    assert str(folders.user) in line
    assert line.startswith(f"mesa-swarm: {why_not_stored()}")
    assert len(code_files.problems) == 3


def test_a_full_disk_is_one_line_and_nothing_stays_behind(folders, capsys, monkeypatch):
    def full(path, content):
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert stored_anew(2) == (6, False)
    assert stored_anew(2.5) == (7.5, False)
    (line,) = capsys.readouterr().err.splitlines()
    assert f"machine code cannot be stored ({folders.home}: No space left on device)" in line
    assert list(folders.home.iterdir()) == []


def test_a_user_without_a_home_has_no_folder_of_code(monkeypatch):
    for name in ("XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, "")
    monkeypatch.setattr(code_files, "AppDirs", lambda **_: type("Dirs", (), {"user_cache_dir": "~/.cache"}))
    assert code_files._folder_of_user() is None


def test_damaged_files_of_rules_are_removed_and_named_unless_a_whole_one_replaces_them(folders, monkeypatch):
    write_code("custom/a.nbc", b"code")
    write_code("custom/b.nbc", b"code")
    (folders.home / "custom" / "b.nbc").write_bytes(b"damage")
    assert drop_damaged("custom") == ["custom/b.nbc"]
    assert [path.name for path in (folders.home / "custom").iterdir()] == ["a.nbc"]
    assert drop_damaged("custom") == []


def test_a_new_folder_replaces_those_of_former_versions_and_leaves_those_of_other_machines(tmp_path):
    for name in ("kernels-0", "kernels-1", "other", "kernels-new/machine"):
        (tmp_path / name).mkdir(parents=True)
    assert why_unwritable.__wrapped__(tmp_path / "kernels-new" / "another machine") == ""
    assert {folder.name for folder in tmp_path.iterdir()} == {"kernels-new", "other"}
    assert {folder.name for folder in (tmp_path / "kernels-new").iterdir()} == {"machine", "another machine"}


def test_of_the_versions_of_a_function_for_the_same_types_the_last_few_stay(folders):
    names = [file_of("f", "int64", str(version)) for version in range(MOST_VERSIONS + 3)]
    for age, name in enumerate([file_of("f", "float64", "0"), file_of("g", "int64", "0"), *names]):
        write_code(name, b"code")
        os.utime(folders.home / name, (1000 + age, 1000 + age))
    write_code(names[-1], b"code")
    left = {path.name for path in folders.home.iterdir()}
    assert left == {file_of("f", "float64", "0"), file_of("g", "int64", "0"), *names[-MOST_VERSIONS:]}


@given(st.lists(st.tuples(st.text(), st.text()), min_size=2, max_size=2, unique=True))
def test_other_types_and_other_sources_have_other_files(pairs):
    one, other = (file_of("f", words, more) for words, more in pairs)
    assert one != other
    assert one.startswith("f-")


COMPILED_HERE = """
import sys
from mesa_swarm.model.gallery import find_model
from mesa_swarm.kernels.compiling import compilation
compilation.alone = True
model = find_model("boids")(rng=1).run(3)
print(model.state_hash(), len(compilation.compiled))
"""


@pytest.fixture(scope="module")
def installation(tmp_path_factory):
    """A copy of the package that was run once."""
    folder = tmp_path_factory.mktemp("installation")
    shutil.copytree(code_files.PACKAGE, folder / "mesa_swarm", ignore=shutil.ignore_patterns("__pycache__"))
    run(folder, {})
    return folder


def run(folder, settings, script=COMPILED_HERE):
    """Return the output and the errors of a script that uses an installation."""
    settings = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"} | settings
    settings.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, *(["-c", script] if isinstance(script, str) else script)]
    return subprocess.run(command, cwd=folder, env=settings, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_user_of_an_installation_that_is_read_only_compiles_only_what_is_missing_there(installation, tmp_path):
    expected, compiled_again = run(installation, {}).stdout.split()
    assert compiled_again == "0"
    # Of functions that Python calls: those that only compiled ones call are in these.
    first, second, *_ = sorted(installation.rglob("control.flocking.*.nbc"))
    with read_only(installation / "mesa_swarm"):
        # All is there: nothing is compiled, and nothing written.
        done = run(installation, {"XDG_CACHE_HOME": str(tmp_path)})
        assert (done.stdout.split(), done.stderr) == ([expected, "0"], "")
        assert list(tmp_path.iterdir()) == []
    first.unlink()
    second.write_bytes(second.read_bytes()[:1000])
    with read_only(installation / "mesa_swarm"):
        # A file is missing, another one damaged: the user's own replace them.
        done = run(installation, {"XDG_CACHE_HOME": str(tmp_path)})
        assert (done.stdout.split(), done.stderr) == ([expected, "2"], "")
        assert {path.name for path in tmp_path.rglob("*.nbc")} == {first.name, second.name}
        done = run(installation, {"XDG_CACHE_HOME": str(tmp_path)})
        assert (done.stdout.split(), done.stderr) == ([expected, "0"], "")
        # Nowhere to write: it works, and one line reports that nothing is stored.
        nowhere = {"XDG_CACHE_HOME": str(installation / "mesa_swarm" / "cache")}
        done = run(installation, nowhere)
        assert done.stdout.split() == [expected, "2"]
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"mesa-swarm: machine code cannot be stored ({installation}")
        # Nor does warm-up claim that it did anything.
        done = run(installation, nowhere, ["-m", "mesa_swarm", "warm-up"])
        assert (done.returncode, done.stdout) == (2, "")
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"mesa-swarm: machine code cannot be stored ({installation}")
