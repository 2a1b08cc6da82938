"""policy export: which files it writes, and what it refuses."""

import os

import pytest

from mesa_swarm import AGENT6
from mesa_swarm.cli.policies import name_in_c
from mesa_swarm.control import StateMachine
from mesa_swarm.learning import save_policy
from mesa_swarm.learning.c_machines import machine_source
from mesa_swarm.learning.c_source import NAME, c_source
from support.exported_policies import POLICIES, q


@pytest.fixture
def file(tmp_path):
    return save_policy(q(4, copies=2), tmp_path / "Mine-2.npz")


def test_a_policy_becomes_a_source_file_and_its_header(typed, file, tmp_path):
    status, out, err = typed(f"policy export {file} --out made --number float --copy 1")
    assert (status, out, err) == (0, "made/mine_2.c\nmade/mine_2.h\n", "")
    expected = c_source(q(4, copies=2), "mine_2", number="float", copy=1)
    assert {path.name: path.read_text() for path in (tmp_path / "made").iterdir()} == expected


def test_files_are_replaced_by_force_only(typed, file):
    assert typed(f"policy export {file} --name robot")[0] == 0
    status, _, err = typed(f"policy export {file} --name robot")
    assert (status, err.count("\n")) == (2, 1)
    assert "robot.c exists already; choose another name or add --force" in err
    assert typed(f"policy export {file} --name robot --force")[0] == 0


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ("--to rust", "unknown format 'rust'; known: c, onnx"),
        ("--number half", "unknown number 'half'; known: double, float"),
        ("--copy 2", "copy is 2; expected a whole number at least 0 and at most 1"),
        ("--name Robot", "the name is 'Robot'"),
        ("--name ../robot", "the name is '../robot'"),
        ("--name=", "the name is ''"),
        ("--to onnx --name ../robot", "the name is '../robot'; expected that of a file, without a folder"),
    ],
)
def test_wrong_options_are_one_line_and_leave_no_file(typed, file, tmp_path, options, line):
    status, out, err = typed(f"policy export {file} {options}")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert line in err
    assert [path.name for path in tmp_path.iterdir()] == ["Mine-2.npz"]


def test_a_missing_policy_is_one_line(typed):
    status, _, err = typed("policy export missing.npz")
    assert (status, err.count("\n")) == (2, 1)
    assert "there is no policy missing.npz" in err


def test_a_state_machine_becomes_a_source_file_for_robots_of_a_design(typed, tmp_path):
    (tmp_path / "rule.txt").write_text("go: Avoid(), Explore()")
    assert typed("policy export rule.txt --design AGENT6")[:2] == (0, "rule.c\nrule.h\n")
    expected = machine_source(StateMachine.read("go: Avoid(), Explore()"), AGENT6, "rule")
    assert (tmp_path / "rule.c").read_text() == expected["rule.c"]
    assert typed("policy export rule.txt --design mesa_swarm.robots.design:AGENT6 --force")[0] == 0
    assert (tmp_path / "rule.h").read_text() == expected["rule.h"]


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        ("go: Explore()", "--to onnx", "a state machine is exported to c only"),
        ("go: Explore()", "--design AGENT7", "unknown design 'AGENT7'"),
        ("go: Explore()", "--design math:pi", "math:pi is 3.14"),
        ("go: Explore()", "--copy 1", "copy is 1; a state machine has no sets of weights"),
        ("go to sleep", "", "line 1 is 'go to sleep'"),
        ("\xff", "", "expected"),
    ],
)
def test_wrong_state_machines_are_one_line(typed, tmp_path, text, options, line):
    (tmp_path / "rule.txt").write_bytes(text.encode("latin-1"))
    status, out, err = typed(f"policy export rule.txt {options}")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert line in err
    assert [path.name for path in tmp_path.iterdir()] == ["rule.txt"]


def test_a_text_of_an_editor_that_marks_its_encoding_is_read(typed, tmp_path):
    (tmp_path / "rule.txt").write_text("go: Explore()", encoding="utf-8-sig")
    assert typed("policy export rule.txt")[0] == 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no such pipes")
def test_a_pipe_is_not_waited_for(typed, tmp_path):
    os.mkfifo(tmp_path / "rule.txt")
    assert "rule.txt cannot be read; expected the text of a state machine" in typed("policy export rule.txt")[2]


def test_a_missing_machine_is_one_line(typed):
    assert "there is no file rule.txt" in typed("policy export rule.txt")[2]


def test_without_a_command_the_help_is_printed(typed):
    status, out, _ = typed("policy")
    assert status == 0
    assert "export" in out


@pytest.mark.parametrize("stem", ["a", "2", "Ärger 3", "---", "switch", "x" * 40])
def test_names_of_files_become_names_in_c(stem):
    assert NAME.fullmatch(name_in_c(stem))


@pytest.mark.slow
def test_a_policy_becomes_a_graph(typed, tmp_path):
    onnx = pytest.importorskip("onnx")
    file = save_policy(POLICIES["a recurrent network"], tmp_path / "mine.npz")
    assert typed(f"policy export {file} --to onnx")[:2] == (0, "mine.onnx\n")
    onnx.checker.check_model(onnx.load(tmp_path / "mine.onnx"), full_check=True)
