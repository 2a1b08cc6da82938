"""Numbers, cells and lines of tables."""

import math

import pytest

from mesa_swarm.experiments.statistics import Interval
from mesa_swarm.experiments.tables import aligned, csv_text, fitting, percent, with_limits


@pytest.mark.parametrize(
    ("interval", "signed", "text"),
    [
        (Interval(1234.56, 1200.1, 1269.0), False, "1,235 [1,200, 1,269]"),
        (Interval(0.123, 0.05, 0.2), True, "+0.123 [+0.050, +0.200]"),
        (Interval(7.0, math.nan, math.nan), False, "7"),
        (Interval(math.nan, math.nan, math.nan), False, "-"),
        (Interval(0.0, 0.0, 0.0), True, "+0 [+0, +0]"),
        (Interval(math.inf, math.nan, math.nan), True, "+inf"),
        (Interval(1e308, -1e308, math.inf), False, "1e+308 [-1e+308, inf]"),
        (Interval(1.5e-9, 1.25e-9, 2e-9), False, "1.5e-09 [1.25e-09, 2e-09]"),
        (Interval(0.5, 0.5, 0.500000001), False, "0.500000 [0.500000, 0.500000]"),
    ],
)
def test_an_estimate_has_digits_according_to_the_width_of_its_interval(interval, signed, text):
    assert with_limits(interval, signed=signed) == text


def test_the_limits_of_a_share_are_whole_percent():
    assert percent(Interval(0.5, 0.31, 0.69)) == "31-69 %"


def test_columns_are_straight_and_a_rule_is_below_the_first_row():
    assert aligned([["a", "b"], ["long", "1"]]) == ["a     b", "-------", "long  1"]


def test_first_cells_of_rows_that_are_too_wide_go_on_lines_of_their_own():
    assert fitting([["", "b"], ["c" * 99, "1"]])[2:] == ["c" * 99, "   1"]


def test_nothing_is_an_empty_field_of_csv():
    assert csv_text([["a", None], [1, "b,c"]]).splitlines() == ["a,", '1,"b,c"']
