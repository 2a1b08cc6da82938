"""What is refused is refused in words: what was got, and what is expected."""

import math
import sysconfig
import traceback
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import (
    LONGEST,
    InvalidValueError,
    SwarmError,
    check_count,
    check_flag,
    check_number,
    error_line,
    locate_error,
    place_of_error,
    shortened,
    unknown_name,
)
from mesa_swarm.model.parameters import Choice, Parameter


@pytest.mark.parametrize("wrong", [0, 11, 2.5, math.nan, math.inf, "3", True, None, 10**400])
def test_any_other_value_than_such_a_count_is_refused_with_the_permitted_range(wrong):
    with pytest.raises(InvalidValueError, match=r"expected a whole number at least 1 and at most 10$"):
        check_count("n", wrong, minimum=1, maximum=10)


@pytest.mark.parametrize("kind", [int, np.int64, np.uint64])
@pytest.mark.parametrize("count", [2**53 + 1, 2**63 - 1])
def test_a_large_whole_number_is_returned_exactly_and_a_larger_one_refused(kind, count):
    assert check_count("rng", kind(count), maximum=2**63 - 1) == count
    with pytest.raises(InvalidValueError, match=f"rng is {count}; expected a whole number"):
        check_count("rng", kind(count), maximum=count - 1)


def test_limits_of_counts_are_shown_to_the_last_digit():
    with pytest.raises(InvalidValueError, match=r"at most 2147483647$"):
        check_count("n", 2**40)
    with pytest.raises(InvalidValueError, match=r"at least 0 and at most 1e\+09$"):
        check_number("x", -1, minimum=0, maximum=1e9)


@pytest.mark.parametrize("wrong", ["no", "yes", 0, 1, None, np.array([True]), [True]])
def test_whatever_is_neither_true_nor_false_is_refused(wrong):
    with pytest.raises(InvalidValueError, match=r"^shared is .*; expected True or False$"):
        check_flag("shared", wrong)


def test_the_nearest_known_name_is_suggested():
    expected = "unknown map 'orginal'; did you mean 'original'? known: original, sparse"
    assert unknown_name("map", "orginal", ["original", "sparse"]) == expected


def test_known_names_are_listed_as_far_as_a_message_has_room():
    names = [f"model_{i}" for i in range(100)]
    for got in ("model_7x", "é" * 200, 7):
        sentence = unknown_name("model", got, names, beside=40)
        assert len(sentence) <= 260
        assert sentence.endswith(", ...")
    assert unknown_name("model", "x", []) == "unknown model 'x'; known: "


def test_numpy_s_true_and_false_are_taken():
    assert [check_flag("shared", flag) for flag in (True, False, np.True_, np.False_)] == [True, False, True, False]


def test_numbers_of_numpy_and_paths_are_shown_as_plain_ones():
    assert shortened((np.float64(5000.0), np.int64(-3))) == "(5000.0, -3)"
    assert shortened(np.float32(0.5)) == "0.5"
    assert shortened(np.array([1e5, 3.0])) == "[100000.0, 3.0]"
    assert shortened([Path("a.toml")]) == "['a.toml']"
    assert len(shortened(np.zeros(10**7))) <= 80


def test_an_error_of_ours_is_shown_as_it_is_and_any_other_by_name_on_one_line():
    assert error_line(InvalidValueError("n is 0;\nexpected 1")) == "n is 0; expected 1"
    assert error_line(KeyError("map")) == "KeyError: 'map'"
    assert error_line(ValueError("first\r\nsecond\u2028third")) == "ValueError: first second third"
    assert error_line(ValueError()) == "ValueError"
    assert error_line(SwarmError()) == "SwarmError"


def test_an_error_in_words_is_printable_and_at_most_300_characters_with_its_beginning_and_its_end():
    assert error_line(OSError("a\x1b[31m\u202eb.png")) == "OSError: a\ufffd[31m\ufffdb.png"
    long = error_line(ValueError(f"begins {'x' * 1000} ends"))
    assert len(long) == LONGEST == 300
    assert long.startswith("ValueError: begins x")
    assert " ... " in long
    assert long.endswith("x ends")


def test_an_error_that_cannot_be_written_as_text_is_named():
    class UnreadableError(Exception):
        def __str__(self):
            raise ZeroDivisionError

    assert error_line(UnreadableError()) == "UnreadableError"


def test_errors_about_places_show_plain_numbers():
    model = SwarmModel(rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(50, 50, 0.0)])
    with pytest.raises(InvalidValueError, match=r"^position \(5000.0, 1.0\) is not on map"):
        model.add_robots(AGENT9, poses=np.array([(5000.0, 1.0, 0.0)]))
    with pytest.raises(InvalidValueError, match=r"^position \[5000.0, 1.0\] is outside"):
        robot.position = np.array([5000.0, 1.0])


def test_a_path_to_a_built_in_map_is_refused_with_the_text_to_use():
    with pytest.raises(SwarmError, match="original: no such file: a path is a file; the built-in map is the text"):
        SwarmModel(map=Path("original"))


def test_a_map_is_one_of_the_names_or_a_file():
    parameter = Parameter("map", "sparse", str, Choice(("sparse", "original")))
    assert parameter.parse("original") == "original"
    assert parameter.parse("elsewhere/mine.TOML") == "elsewhere/mine.TOML"
    with pytest.raises(SwarmError, match="did you mean 'sparse'"):
        parameter.parse("spare")
    with pytest.raises(SwarmError, match="unknown strategy"):
        Parameter("strategy", "A", str, Choice(("A",))).parse("a.toml")


def test_a_name_in_another_case_is_recognised_and_a_name_in_its_own_case_comes_first():
    assert "did you mean 'AGENT9'? " in unknown_name("design", "agent9", ["AGENT3", "AGENT9"])
    assert "did you mean 'agent'? " in unknown_name("design", "agnt", ["AGNTS", "AGENT", "agent"])


def failure(source: str, file: str) -> Exception:
    """Return the error that the code of a file raises."""
    names: dict = {}
    try:
        exec(compile(source, file, "exec"), names)
    except Exception as error:
        return error.with_traceback(error.__traceback__.tb_next)
    raise AssertionError("it was to fail")


def test_the_place_of_an_error_is_the_innermost_call_in_a_user_s_code():
    of_user = "import numpy\ndef f():\n    return numpy.zeros(2).reshape(3)\nf()"
    assert place_of_error(failure(of_user, "/home/me/mine.py")) == "mine.py, line 3"
    in_ours = "from mesa_swarm import SwarmModel\n\nSwarmModel(rng=1, engine='fast')"
    refused = failure(in_ours, "/home/me/mine.py")
    assert locate_error(refused) == f"mine.py, line 3: {error_line(refused)}"
    of_python = "import json\njson.loads('{')"
    assert place_of_error(failure(of_python, "/home/me/mine.py")) == "mine.py, line 2"
    with pytest.raises(InvalidValueError) as refused_by_us:
        check_flag("flag", 3)
    assert place_of_error(refused_by_us.value).startswith("test_errors.py, line ")


def test_an_installed_package_is_a_user_s_code_if_it_imports_mesa_swarm():
    file = f"{sysconfig.get_paths()['purelib']}/anthill/trails.py"
    assert place_of_error(failure("1 / 0", file)) == ""
    assert place_of_error(failure("import mesa_swarm\n1 / 0", file)) == "trails.py, line 2"
    assert place_of_error(failure("from mesa_swarm.control import Avoid\n1 / 0", file)) == "trails.py, line 2"


def test_the_place_of_an_error_is_that_of_its_cause_and_is_named_once():
    source = "def f():\n    raise KeyError('a')\ntry:\n    f()\nexcept KeyError as e:\n    raise ValueError('b') from e"
    error = failure(source, "/home/me/mine.py")
    assert locate_error(error) == "mine.py, line 2: ValueError: b"
    again = InvalidValueError(f"it failed: {locate_error(error)}")
    again.__cause__ = error
    assert locate_error(again) == "it failed: mine.py, line 2: ValueError: b"
    error.__cause__.__cause__ = error
    assert place_of_error(error) == "mine.py, line 2", "causes in a circle end too"


def test_the_place_of_an_error_from_another_process_is_read_from_its_text():
    error, text = ValueError("b"), failure("def f():\n    1 / 0\nf()", "/home/me/mine.py")
    error.__cause__ = type("_RemoteTraceback", (Exception,), {})("".join(traceback.format_exception(text)))
    assert place_of_error(error) == "mine.py, line 2"


def test_the_place_in_a_notebook_is_a_line_of_a_cell_and_that_of_wrong_syntax_the_line_of_the_file():
    assert place_of_error(failure("\n1 / 0", "/tmp/ipykernel_42/1234.py")) == "cell of the notebook, line 2"
    assert place_of_error(failure("x = 1\ny = (", "/home/me/mine.py")) == "mine.py, line 2"
    assert place_of_error(ValueError("which was not raised")) == ""
