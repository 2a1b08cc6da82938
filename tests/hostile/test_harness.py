"""The harness of attacks finds what it is there to find."""

import time

import pytest

from support.hostile import Tally, attack, table

KEPT = []


def work(what):
    if what == "raw":
        raise KeyError(what)
    if what == "long":
        raise ValueError("x" * 301)
    if what == "refuse":
        raise ValueError("one line")
    if what == "spin":
        while True:
            pass
    if what == "sleep":
        time.sleep(60)
    if what == "memory":
        return b"x" * (700 << 20)
    if what == "kept":
        KEPT.append(b"x" * (700 << 20))
    if what == "huge":
        return [b"x" * (100 << 20) for _ in range(1000)]
    return what


@pytest.mark.parametrize(
    ("what", "status"),
    [
        ("good", "accepted"),
        ("refuse", "refused"),
        ("raw", "raw"),
        ("long", "raw"),
        ("spin", "CPU"),
        ("memory", "memory"),
        ("kept", "memory"),
        ("huge", "memory"),
    ],
)
def test_each_way_to_end_is_named_and_what_follows_is_still_tried(what, status):
    inputs = [("first", "good"), ("attack", what), ("last", "good")]
    # Only what spins is stopped early: on a busy host the 700 MB of the others take seconds.
    cpu = 0.2 if what == "spin" else 60
    results = list(attack(work, inputs, refusals=ValueError, cpu=cpu))
    assert [result.status for result in results] == ["accepted", status, "accepted"]


def test_what_other_tests_have_gathered_is_not_counted():
    gathered = b"x" * (600 << 20)
    (result,) = attack(work, [("good", "good")], refusals=ValueError, cpu=1)
    assert (result.status, len(gathered)) == ("accepted", 600 << 20)
    assert 0 < result.megabytes < 400


def test_what_sleeps_is_a_hang(monkeypatch):
    monkeypatch.setattr("support.hostile.PATIENCE", -9)
    assert [result.status for result in attack(work, [("a", "sleep")], refusals=ValueError, cpu=1)] == ["hang"]


def test_the_table_adds_up_what_is_of_one_area():
    one, other = Tally("maps"), Tally("maps")
    one.check("a", True)
    other.check("b", False, "why")
    assert table([one.row(), other.row()])[1].split() == ["maps", "2", "1", "-", "-"]
