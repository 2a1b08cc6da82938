"""Commands of installed packages, entry points of `mesa_swarm.commands`: added, listed, and refused one by one."""

import sys

import pytest

CODE = """
import typer

many = typer.Typer()


def greet(name: str, *, loud: bool = False) -> None:
    '''Greet a robot.'''
    print(name.upper() if loud else name)


@many.command()
def one() -> None:
    '''Print one.'''
    print(1)


def fail() -> None:
    from mesa_swarm.base.errors import InvalidValueError

    raise InvalidValueError("n is 3; expected 4")


number = 7
"""


@pytest.fixture
def install(monkeypatch, tmp_path):
    """Return a function that installs a package with these commands: names with the objects of its module."""

    def do(package, code=CODE, **points):
        site = tmp_path / f"{package}_site"
        about = site / f"{package}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = [f"{name} = {package}:{value}" for name, value in points.items()]
        (about / "entry_points.txt").write_text("\n".join(["[mesa_swarm.commands]", *lines]))
        (site / f"{package}.py").write_text(code)
        monkeypatch.syspath_prepend(site)
        monkeypatch.delitem(sys.modules, package, raising=False)

    return do


def test_a_function_of_a_package_is_a_command_with_its_arguments_and_options(typed, install):
    install("robot_greetings", greet="greet")
    assert typed("greet epuck --loud") == (0, "EPUCK\n", "")
    assert typed("greet")[0] == 2
    assert "Greet a robot." in typed("greet --help")[1]
    assert any(line.split() == ["greet", "Greet", "a", "robot."] for line in typed("--help")[1].splitlines())


def test_a_typer_is_a_group_of_commands_even_if_it_has_one_only(typed, install):
    install("robot_groups", many="many")
    assert typed("many one") == (0, "1\n", "")


def test_an_error_of_a_command_is_one_line(typed, install):
    install("robot_failures", fail="fail")
    assert typed("fail") == (2, "", "mesa-swarm: n is 3; expected 4\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "value", "reason"),
    [
        ("1 / 0\n", "greet", "cannot be loaded: robot_broken.py, line 1: ZeroDivisionError"),
        ("raise SystemExit(3)\n", "greet", "cannot be loaded: "),
        (CODE, "missing", "has no attribute 'missing'"),
        (CODE, "number", "is 7; expected a function or a typer.Typer"),
        ("def f(x: int | str) -> None: ...\n", "f", "cannot be loaded: "),
    ],
)
def test_a_command_that_cannot_be_loaded_is_refused_in_one_line_and_others_work(typed, install, code, value, reason):
    install("robot_broken", code, broken=value)
    install("robot_greetings", greet="greet")
    for line in ("broken", "broken --any=1 words"):
        status, out, err = typed(line)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert err.startswith(f"mesa-swarm: the command broken (robot_broken:{value}) ")
        assert reason in err
    assert typed("greet me")[:2] == (0, "me\n")
    assert typed("list")[0] == 0
    status, out, err = typed("--help")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines() if line.strip().startswith("broken")] == ["broken"]
    assert "  greet " in out


def test_a_command_of_two_packages_is_refused_with_the_names_of_both(typed, install):
    install("robots_a", greet="greet")
    install("robots_b", greet="greet")
    status, _, err = typed("greet me")
    assert status == 2
    assert "is of more than one package: robots_a and robots_b; uninstall all but one" in err


def test_our_own_commands_are_never_replaced(typed, install):
    install("robot_lists", list="fail")
    assert "fire_fighting" in typed("list")[1]
    assert typed("--help")[1].count("\n  list ") == 1


def test_a_misspelt_command_of_a_package_is_suggested(typed, install):
    install("robot_greetings", greet="greet")
    assert "Did you mean 'greet'" in typed("gret")[2]
    assert "Did you mean 'reproduce'" in typed("reproduc")[2]


def test_no_installed_command_is_loaded_for_one_of_ours(typed, install):
    install("robot_greetings", greet="greet")
    typed("list")
    typed("reproduce --list")
    assert "robot_greetings" not in sys.modules
    typed("greet me")
    assert "robot_greetings" in sys.modules
