"""diagnose: what is found, and printed of it."""

import pytest

from mesa_swarm.analysis.pathology import KINDS, Episode, Pathologies
from mesa_swarm.cli.run import MOST_EPISODES, described_episodes
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model


def test_diagnose_finds_nothing_in_collision_avoidance_by_default(typed):
    status, out, err = typed("diagnose collision_avoidance --quiet")
    lines = out.splitlines()
    assert (status, err) == (0, "")
    assert lines[0].split() == ["steps", "2000"]
    assert [line.split()[-1] for line in lines if line.split()[:-1] and line.startswith(KINDS)] == ["0"] * len(KINDS)
    assert lines[-1] == "No pathology was found."


def test_diagnose_finds_robots_that_turn_on_the_spot_in_a_corridor(typed):
    Map(name="corridor", bounds=(0, 0, 300, 22)).save("corridor.toml")
    line = "diagnose collision_avoidance --set map=corridor.toml --set design=AGENT3 --set n_robots=2 --steps 500"
    status, out, err = typed(f"{line} --set turn=stationary")
    model = find_model("collision_avoidance")(n_robots=2, map="corridor.toml")
    ids = [robot.unique_id for robot in model.robots]
    assert status == 0
    assert "500 of 500 steps in " in err
    assert ["corridor", "flip", "2"] in [word.split() for word in out.splitlines()]
    sentences = out.splitlines()[-2:]
    assert sorted(int(sentence.split()[1]) for sentence in sentences) == ids
    assert all("turned alternately away from things near on its left and right" in s for s in sentences)
    assert all(s.endswith("to 500 (layer 0).") for s in sentences)
    assert "layers                         0 Avoid, 1 Explore" in out
    assert typed(f"{line} --quiet")[1].endswith("No pathology was found.\n")


def stuck(first, last, *robots):
    return Episode(kind="stuck", robots=robots, first_step=first, last_step=last)


def test_the_longest_episodes_come_first_with_unique_ids():
    found = Pathologies((stuck(1, 40, 0), stuck(5, 99, 1), stuck(7, 46, 0)))
    assert described_episodes(found, [11, 12]) == [
        "Robot 12 was commanded forwards but did not move, in steps 5 to 99.",
        "Robot 11 was commanded forwards but did not move, in steps 1 to 40.",
        "Robot 11 was commanded forwards but did not move, in steps 7 to 46.",
    ]


def test_a_pair_is_named_by_both_ids():
    pair = Episode(kind="head-on pair", robots=(0, 2), first_step=1, last_step=50, layers=(1,))
    assert described_episodes(Pathologies((pair,)), [4, 5, 6])[0].startswith("Robots 4 and 6 faced each other")


@pytest.mark.parametrize(("there", "lines"), [(MOST_EPISODES, MOST_EPISODES), (MOST_EPISODES + 1, MOST_EPISODES + 1)])
def test_at_most_twenty_episodes_are_described_and_the_rest_counted(there, lines):
    sentences = described_episodes(Pathologies(tuple(stuck(k, 50 + 2 * k, 0) for k in range(there))), [9])
    assert len(sentences) == lines
    assert sentences[0].endswith(f"in steps {there - 1} to {48 + 2 * there}.")
    assert (sentences[-1] == "... and 1 more, none of them longer.") == (there > MOST_EPISODES)


def test_without_episodes_no_pathology_is_reported():
    assert described_episodes(Pathologies(()), []) == ["No pathology was found."]
