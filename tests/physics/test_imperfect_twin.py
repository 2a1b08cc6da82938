"""Disturbed readings and wheels, and losses of radio, beside twins of plain Python integers and NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT_FIRE, LineSensor, RobotDesign, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.kernels.draws import mix_bits
from mesa_swarm.physics.broadcasts import is_lost
from mesa_swarm.physics.disturbances import (
    BODY,
    FATE,
    LENGTH,
    LINE,
    PHASE,
    PLACE,
    RADIATION,
    SLIP,
    WHEEL,
    Imperfect,
    draw_normal,
    draw_uniform,
    spoil,
    spoil_wheels,
)
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from mesa_swarm.world.statics import OBSTACLE
from support.scenes import ahead, empty

words, numbers, seeds = st.integers(0, 2**64 - 1), st.integers(0, 10**6), st.integers(0, 2**32 - 1)
few = settings(max_examples=30)
LARGEST_WORD = 2**64
SHARE = 2.0**-53
KEY = 12345


def splitmix(state):
    """Return the output of SplitMix64 (Steele, Lea and Flood 2014) for a state, with plain integers."""
    z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) % LARGEST_WORD
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % LARGEST_WORD
    return z ^ (z >> 31)


def hashed(word, *parts):
    """Return a number in [0, 1) that a word and some whole numbers decide, each a step of SplitMix64."""
    for part in parts:
        word = splitmix((word + 0x9E3779B97F4A7C15 * int(part)) % LARGEST_WORD)
    return (word >> 11) * SHARE


@given(words)
def test_bits_are_mixed_as_splitmix64_mixes_them(word):
    assert int(mix_bits(np.uint64(word))) == splitmix(word)


@given(words, numbers, numbers, st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]))
def test_a_broadcast_is_lost_where_the_hash_of_word_sender_and_hearer_is_below_the_probability(word, a, b, share):
    assert is_lost(np.uint64(word), a, b, share) == (hashed(word, a, b) < share)


@given(words, numbers, numbers, numbers, st.integers(0, 3))
def test_chance_is_the_hash_of_key_robot_channel_moment_and_question(key, number, channel, moment, what):
    assert draw_uniform(np.uint64(key), number, channel, moment, what) == hashed(key, number, channel, moment, what)


@given(words, numbers, numbers, numbers)
def test_a_normal_number_has_its_length_and_its_phase_from_two_questions(key, number, channel, moment):
    length, phase = (hashed(key, number, channel, moment, what) for what in (LENGTH, PHASE))
    expected = math.sqrt(-2.0 * math.log(1.0 - length)) * math.cos(2.0 * math.pi * phase)
    assert draw_normal(np.uint64(key), number, channel, moment) == pytest.approx(expected, abs=1e-12)


def test_no_two_questions_and_no_two_kinds_of_channels_share_their_numbers():
    assert len({FATE, PLACE, PHASE, LENGTH}) == 4
    channels = sorted((0, RADIATION, WHEEL, BODY, LINE))
    assert min(np.diff(channels)) >= 360, "a design has at most 360 sensors"


def fate_of(limits, number, channel, step):
    """Return what happens to a value in a step: "lost", "outlier" or the factor of its error."""
    error, dropout, outliers, hold, _, _ = limits
    moment = step // hold
    fate = hashed(KEY, number, channel, moment, FATE)
    if fate < dropout:
        return "lost", 0.0
    if fate < dropout + outliers:
        return "outlier", hashed(KEY, number, channel, moment, PLACE)
    return "error", 1.0 + error * float(draw_normal(np.uint64(KEY), number, channel, moment))


settings_of_values = st.builds(
    Imperfection,
    error=st.sampled_from([0.0, 0.3, 2.0]),
    dropout=st.sampled_from([0.0, 0.3]),
    outliers=st.sampled_from([0.0, 0.4]),
    hold=st.integers(1, 3),
    period=st.integers(1, 3),
    lag=st.sampled_from([0.0, 2.0]),
)


@few
@given(seeds, settings_of_values, st.integers(0, 20), st.sampled_from([(0, -1.0), (RADIATION, 0.0), (LINE, 1.0)]))
def test_each_reading_is_lost_replaced_disturbed_or_held_by_its_own_chance(seed, given_, step, channels):
    first, nothing = channels
    rng, limits = np.random.default_rng(seed), given_.limits
    reading, last = rng.choice([-1.0, 0.0, 5.0, 19.0], (6, 3)), rng.uniform(0, 9, (6, 3))
    kind, last_kind = rng.integers(-1, 4, (6, 3)).astype(np.int8), rng.integers(-1, 4, (6, 3)).astype(np.int8)
    largest, design = np.array([[20.0, 30.0, -1.0], [10.0, 0.0, 20.0]]), rng.integers(2, size=6)
    number = rng.integers(1000, size=6)
    expected = [array.copy() for array in (reading, kind, last, last_kind)]
    for i, s in np.ndindex(6, 3):
        most = largest[design[i], s]
        if most < 0:
            continue
        what, share = fate_of(limits, number[i], first + s, step)
        read, seen = reading[i, s], kind[i, s]
        if step % given_.period:
            read, seen = last[i, s], last_kind[i, s]
        elif what == "lost":
            read, seen = nothing, -1
        elif what == "outlier":
            read, seen = most * share, OBSTACLE
        elif read >= 0:
            read = np.clip(read * share, 0.0, most)
        for array, value in zip(expected, (read, seen, read, seen), strict=True):
            array[i, s] = value
    got = reading, kind, last, last_kind
    spoil(*got, largest, nothing, first, limits, design, number, step, np.uint64(KEY))
    for mine, theirs in zip(got, expected, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-12)


@few
@given(
    seeds,
    settings_of_values,
    st.sampled_from([0.0, 2.5]),
    st.sampled_from([0.0, 0.2]),
    st.sampled_from([(0.0, 0.5), (0.3, 0.25)]),
    st.integers(0, 20),
)
def test_each_wheel_is_lost_replaced_disturbed_held_late_slips_and_uses_its_charge(
    seed, given_, battery, failure, slips, step
):
    rng, limits = np.random.default_rng(seed), given_.limits
    command, held, wheels = (rng.uniform(-1, 1, (6, 2)) for _ in range(3))
    used, broken, speed = rng.choice([0.0, 2.5, 3.0], 6), rng.random(6) < 0.2, rng.choice([0.0, 0.5, 2.0], 6)
    design, sideways, number = rng.integers(2, size=6), np.array([False, True]), rng.integers(1000, size=6)
    numbers = np.array([2, 2])
    share = 1.0 - math.exp(-1.0 / given_.lag) if given_.lag else 1.0
    expected = [array.copy() for array in (command, held, wheels, used, broken)]
    driven, stored, rolling, charge, gone = expected
    for i in range(6):
        gone[i] |= hashed(KEY, number[i], BODY, step, FATE) < failure
        stands = gone[i] or (battery > 0 and used[i] >= battery)
        for w in range(2):
            if step % given_.period == 0:
                stored[i, w] = command[i, w]
            what, factor = fate_of(limits, number[i], WHEEL + w, step)
            wanted = {"lost": 0.0, "outlier": speed[i] * (2 * factor - 1), "error": stored[i, w] * factor}[what]
            late = wheels[i, w] + share * ((0.0 if stands else wanted) - wheels[i, w])
            rolling[i, w] = 0.0 if stands else np.clip(late, -speed[i], speed[i])
        length = np.hypot(*rolling[i])
        if sideways[design[i]] and length > speed[i]:
            rolling[i] *= speed[i] / length
        slipping = [hashed(KEY, number[i], WHEEL + w, step, SLIP) < slips[0] for w in range(2)]
        driven[i] = rolling[i] * np.where(slipping, 1 - slips[1], 1)
        charge[i] += np.abs(rolling[i]).sum() / 2 / speed[i] if speed[i] else 0.0
    got = command, held, wheels, used, broken
    bodies = speed, design, sideways, numbers, number
    spoil_wheels(*got, *bodies, np.full(2, battery), limits, (failure, *slips), step, np.uint64(KEY))
    for mine, theirs in zip(got, expected, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-12)


# ---- a swarm


def driven(imperfections, design=AGENT3, steps=1):
    model = empty()
    model.add_robots(design, poses=[(100, 150, 0.0), (200, 150, 0.0)])
    model.control = Subsumption(ahead(speed=0.5))
    model.imperfections = imperfections
    return model.run(steps)


@pytest.mark.parametrize(
    "one",
    [
        Imperfections(driving=Imperfection(dropout=1.0)),
        Imperfections(failure=1.0),
        Imperfections(battery=1e-9, driving=Imperfection(hold=2)),
    ],
    ids=["lost commands", "break-downs", "empty batteries"],
)
def test_wheels_that_stand_slip_wholly_and_the_command_is_what_was_requested(one):
    model = driven(one, steps=3)
    assert model.swarm.command.tolist() == [[0.5, 0.5]] * 2
    assert model.swarm.slip.tolist() == [[1.0, 1.0]] * 2


def test_wheels_that_are_not_commanded_do_not_slip_whatever_they_do():
    model = empty()
    model.add_robots(AGENT3, poses=[(100, 150, 0.0)])
    model.control = Subsumption(ahead(speed=0.0))
    model.imperfections = Imperfections(driving=Imperfection(outliers=1.0))
    model.run(3)
    assert model.swarm.position[0].tolist() != [100, 150]
    assert model.swarm.slip.tolist() == [[0.0, 0.0]]


def test_the_wheels_that_are_driven_are_the_commands_unless_imperfections_change_these_and_no_command_is_written():
    swarm = driven(None).swarm
    for imperfections, speed in ((Imperfections(driving=Imperfection(dropout=1.0)), 0.0), (Imperfections(), 0.5)):
        wheels = Imperfect(imperfections, swarm, KEY).driven_wheels(swarm, 5)
        assert wheels.tolist() == [[speed, speed]] * 2
        assert (wheels is swarm.columns["command"]) == (speed == 0.5)
        assert swarm.command.tolist() == [[0.5, 0.5]] * 2


def test_imperfect_wheels_leave_readings_and_imperfect_readings_leave_wheels_as_they_are():
    ideal = driven(None, steps=20)
    reading = driven(Imperfections(sensing=Imperfection(outliers=1.0)), steps=20)
    driving = driven(Imperfections(driving=Imperfection(error=0.5)), steps=20)
    assert (reading.swarm.position == ideal.swarm.position).all()
    assert (driving.swarm.position != ideal.swarm.position).any()
    for model in (ideal, reading, driving):
        model.sense()
    assert (driving.swarm.distance == ideal.swarm.distance).all()
    assert (reading.swarm.distance != ideal.swarm.distance).all()


def test_lost_radiation_reads_0_and_a_lost_line_reads_bright_ground():
    design = RobotDesign(name="both", sensors=(*AGENT_FIRE.sensors, LineSensor()))
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(design, poses=[(330, 300, 0.0)])
    model.imperfections = Imperfections(sensing=Imperfection(outliers=1.0))
    model.sense()
    assert 0.0 < model.swarm.radiation[0, 0] <= 1.0
    model.imperfections = Imperfections(sensing=Imperfection(dropout=1.0))
    model.sense()
    assert model.swarm.radiation[0, 0] == 0.0
    assert not model.swarm.line[0, 0]
