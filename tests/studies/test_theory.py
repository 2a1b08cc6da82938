"""What theories predict: closed forms beside independent twins, runs beside their parts, the page beside the code."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.integrate import quad

from mesa_swarm import Map, ProximitySensor, RobotDesign, SwarmModel, disc
from mesa_swarm.physics.arcs import move_along_arc
from mesa_swarm_studies.judging import AGAINST_THEORY, FAILED, PASSED, UNDECIDED, judged_theory
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import find_item, items
from mesa_swarm_studies.theory import flocks as theory_flocks
from mesa_swarm_studies.theory import kinetics as theory_kinetics
from mesa_swarm_studies.theory import motion as theory_motion
from mesa_swarm_studies.theory import sensing as theory_sensing
from mesa_swarm_studies.theory.courses import Course, apart, torus
from mesa_swarm_studies.theory.motion import CELL, CELLS, SIDE, SLIPS, Slip

PAGE = Path(__file__).parents[2] / "docs" / "appendix" / "validation.md"
NAMES = [name for name, item in items().items() if item.source == "theory"]
FAST = ("walker_coverage", "sector_hits")


@pytest.mark.parametrize(
    ("off", "within", "outcome"),
    [(0.0, 0.1, PASSED), (0.0, 0.001, UNDECIDED), (0.3, 0.1, FAILED), (-0.3, 0.1, FAILED)],
)
def test_a_theory_passes_where_a_narrow_interval_includes_it_and_fails_where_it_is_excluded(off, within, outcome):
    values = 2.0 + off + 0.05 * np.random.default_rng(1).permutation(np.linspace(-1, 1, 20))
    check = judged_theory("speed", 2.0, list(values), within=within)
    assert (check.outcome, float(check.reported)) == (outcome, 2)
    assert check.measured.endswith("], 20 runs")


def test_a_theory_of_each_run_is_compared_run_by_run():
    theory = np.linspace(1.0, 9.0, 20)
    measured = theory + 0.01 * (-1.0) ** np.arange(20)
    assert judged_theory("rate", list(theory), list(measured), within=0.01).outcome == PASSED
    assert judged_theory("rate", 5.0, list(measured), within=0.01).outcome == UNDECIDED


def test_a_wrong_theory_of_the_size_that_is_called_detectable_is_detected_in_four_of_five_repetitions():
    chance = np.random.default_rng(2)
    words = judged_theory("x", 10.0, list(10.0 + chance.permutation(np.linspace(-1, 1, 20))), within=1.0).detectable
    wrong = 10.0 * (1.0 + float(words.removesuffix(" %")) / 100.0)
    spread = np.linspace(-1, 1, 20).std(ddof=1)
    failed = [
        judged_theory("x", wrong, list(chance.normal(10.0, spread, 20)), within=1.0).outcome == FAILED
        for _ in range(400)
    ]
    assert 0.72 < np.mean(failed) < 0.88


def test_equal_numbers_and_single_runs_decide_nothing_but_what_is_exact():
    assert judged_theory("x", 1.0, [1.0, 1.0], within=0.1).outcome == PASSED
    assert judged_theory("x", 1.0, [1.1, 1.1], within=0.1).outcome == FAILED
    assert judged_theory("x", 1.0, [1.0], within=0.1).outcome == UNDECIDED


# Kinetics


def test_collisions_over_a_way_are_those_of_the_area_that_a_robot_sweeps_relative_to_the_others():
    speed = quad(lambda turn: 2.0 * math.sin(turn / 2.0), 0.0, math.pi)[0] / math.pi
    density, diameter = 0.2, 1.0
    number = density / (math.pi * diameter**2 / 4.0)
    swept = 2.0 * diameter * speed * number * theory_kinetics.contact_value(density)
    assert theory_kinetics.collisions_in_theory(density) == pytest.approx(theory_kinetics.WAY * diameter * swept)
    assert theory_kinetics.contact_value(0.0) == 1.0


def test_the_mean_time_in_contact_is_half_pi_diameters_over_the_speed():
    time = quad(lambda turn: -math.cos(turn) * math.log(math.tan(turn / 2.0)), 0.0, math.pi / 2.0)[0]
    assert time == pytest.approx(math.pi / 2.0)
    meeting = 2.0 * math.pi / 2.0  # of n = 1 / d^2 and u = 1
    assert theory_kinetics.in_contact(0.01) == pytest.approx(1.0 - math.exp(-meeting * 4.0 * 0.01 / math.pi))


def test_robots_part_with_a_density_proportional_to_their_speed_of_separation():
    layer = theory_kinetics.Rebound(robots=True)
    layer._rng = np.random.default_rng(3)
    normal = 0.7
    drawn = np.array([layer._parting(normal) for _ in range(4_000)])
    speed = np.cos(drawn[:, 0] - normal) - np.cos(drawn[:, 1] - normal)
    turns = np.linspace(0.0, 2.0 * math.pi, 400, endpoint=False)
    all_speeds = np.maximum(np.cos(turns)[:, None] - np.cos(turns)[None, :], 0.0)
    expected = (all_speeds**2).sum() / all_speeds.sum()
    assert (speed > 0.0).all()
    assert speed.mean() == pytest.approx(expected, abs=5.0 * speed.std() / math.sqrt(len(speed)))


def test_two_robots_that_rebound_part_at_once_and_both_are_counted():
    model, _ = theory_kinetics.gas(1, density=0.002, robots=2, speed=0.5, rebound=True)
    (left, right), course = model.robots, model.swarm.columns["0.Rebound.azimuth"]
    left.position, right.position = (100.0, 100.0), (110.2, 100.0)
    course[:] = 0.0, math.pi
    model.step()
    assert theory_kinetics.partners(model).tolist() == [1, 0]
    model.step()
    assert theory_kinetics.partners(model).tolist() == [-1, -1]
    assert math.cos(course[0]) < math.cos(course[1])


def test_robots_that_keep_their_course_stay_in_contact_until_they_have_passed_each_other():
    model, _ = theory_kinetics.gas(1, density=0.002, robots=2, speed=0.5, rebound=False)
    (left, right), course = model.robots, model.swarm.columns["0.Rebound.azimuth"]
    left.position, right.position = (100.0, 100.0), (110.2, 103.0)
    course[:] = 0.0, math.pi
    touched = []
    for _ in range(60):
        model.step()
        touched.append(theory_kinetics.partners(model)[0] == 1)
    first, last = touched.index(True), len(touched) - touched[::-1].index(True)
    begin = math.asin(3.0 / 10.0)
    assert all(touched[first:last])
    # d / u times ln cot of half the first angle; a whole number of steps.
    assert last - first == pytest.approx(-10.0 * math.log(math.tan(begin / 2.0)), abs=2.0)
    assert course.tolist() == [0.0, math.pi]


def test_a_gas_reports_its_density_and_rates_far_from_walls():
    numbers = theory_kinetics.gas_run(1, density=0.1, rebound=True, speed=0.5, robots=150, settling=20, steps=300)
    assert numbers["density"] == pytest.approx(0.1, rel=0.2)
    expected = theory_kinetics.collisions_in_theory(numbers["density"]) * 0.5 / (10.0 * theory_kinetics.WAY)
    assert numbers["contacts"] == pytest.approx(expected, rel=0.3)
    assert numbers["meetings"] <= numbers["contacts"]


# Motion


def enumerated(slip: Slip, steps: int) -> tuple[float, float, float]:
    """Return the mean cosine, square and displacement ahead over all ways in which wheels can slip."""
    cosine = square = ahead = 0.0
    for slips in itertools.product((False, True), repeat=2 * steps):
        weight = math.prod(slip.probability if slips_now else 1.0 - slip.probability for slips_now in slips)
        x = y = heading = 0.0
        for left, right in zip(slips[::2], slips[1::2], strict=True):
            speeds = [1.0 - slip.magnitude if slips_now else 1.0 for slips_now in (left, right)]
            turn = (speeds[1] - speeds[0]) / (2.0 * slip.radius)
            dx, dy, heading = move_along_arc(heading, sum(speeds) / 2.0, 0.0, turn, 1)
            x, y = x + dx, y + dy
        cosine += weight * math.cos(heading)
        square += weight * (x * x + y * y)
        ahead += weight * x
    return cosine, square, ahead


@pytest.mark.parametrize("slip", [*SLIPS, Slip(0.2, 0.7, 0.4)])
@pytest.mark.parametrize("steps", [1, 4])
def test_means_over_slipping_wheels_are_those_over_all_ways_to_slip(slip, steps):
    theory = [
        f(slip, steps) for f in (theory_motion.cosine_after, theory_motion.square_after, theory_motion.ahead_after)
    ]
    assert theory == pytest.approx(enumerated(slip, steps))


def test_a_persistent_walk_is_that_of_furth_for_small_turns():
    slip = Slip(0.5, 0.02, 1.0)
    memory, steps = 1.0 / theory_motion.diffusion_of(slip), 20_000
    speed = theory_motion.chords(slip)[0]
    furth = 2.0 * speed**2 * memory**2 * (steps / memory - 1.0 + math.exp(-steps / memory))
    assert theory_motion.square_after(slip, steps) == pytest.approx(furth, rel=1e-3)


def test_wheels_that_never_slip_go_straight():
    numbers = theory_motion.drive_run(1, probability=0.0, magnitude=1.0, radius=2.0, robots=3, steps=30)
    assert numbers["looks"] == [1, 10, 30]
    assert (numbers["diffusion"], numbers["cosine"]) == (0.0, [1.0, 1.0, 1.0])
    assert numbers["square"] == pytest.approx([1.0, 100.0, 900.0])
    assert numbers["ahead"] == pytest.approx([1.0, 10.0, 30.0])


def test_random_walks_visit_as_many_cells_as_all_ways_do():
    hops = 5
    ways = np.array(list(itertools.product([(1, 0), (0, 1), (-1, 0), (0, -1)], repeat=hops)))
    places = np.concatenate([np.zeros((len(ways), 1, 2), int), ways.cumsum(axis=1)], axis=1)
    distinct = np.mean([len({tuple(place) for place in way}) for way in places.tolist()])
    assert theory_motion.lattice_visit(hops) * CELLS**2 == pytest.approx(distinct)


def test_a_straight_walker_is_seen_in_a_cell_if_it_starts_in_one_of_the_squares_before_it():
    square = shapely.box(0.0, 0.0, CELL, CELL)
    areas = []
    for azimuth in (np.arange(60) + 0.5) * math.pi / 120.0:
        moved = [shapely.affinity.translate(square, -k * math.cos(azimuth), -k * math.sin(azimuth)) for k in range(31)]
        areas.append(shapely.union_all(moved).area)
    assert theory_motion.straight_visit(30) * SIDE**2 == pytest.approx(np.mean(areas), rel=1e-3)


def test_random_walkers_stand_in_the_middle_of_cells_after_every_hop():
    numbers = theory_motion.walk_run(1, robots=1, straight=False)
    cells = np.array(numbers["covered"]) * CELLS**2
    assert cells == pytest.approx(cells.round())
    assert 1 < cells[0] <= 26
    assert cells[0] <= cells[1] <= 101


def test_robots_on_a_torus_never_meet_and_start_at_their_places():
    places = np.random.default_rng(4).uniform(0.0, 50.0, (9, 2))
    model = torus(Course(), places, side=50.0, speed=1.0, steps=120, rng=1)
    assert np.mod(model.swarm.position, 50.0) == pytest.approx(places)
    start = model.swarm.position.copy()
    model.run(120)
    assert model.total_collisions == 0
    assert np.hypot(*(model.swarm.position - start).T) == pytest.approx(np.full(9, 120.0))


@pytest.mark.parametrize("n", [1, 2, 7, 100])
def test_places_are_as_far_apart_as_needed(n):
    places, width = apart(n, reach=13.0, unit=5.0)
    assert len(places) == n
    assert (np.minimum(places, width - places) > 13.0).all()
    assert (places % 5.0 == 0.0).all()
    gaps = np.hypot(*(places[:, None] - places[None, :]).transpose(2, 0, 1))[~np.eye(n, dtype=bool)]
    assert (gaps > 26.0).all()


# Sensing


@pytest.mark.parametrize("view", [40.0, 120.0, 300.0])
def test_a_sector_sees_a_disc_exactly_where_the_counted_area_has_its_centre(view):
    reach, spacing = 20.0, 1.0
    grid = np.arange(-31.5, 32.0, spacing)
    centres = np.array([(x, y) for x in grid for y in grid if math.hypot(x, y) > 10.0])[::7]
    places, width = apart(len(centres), reach=45.0)
    world = Map(
        name="one disc each",
        bounds=(0.0, 0.0, width, width),
        obstacles=tuple(disc(tuple(place + centre), 5.0) for place, centre in zip(places, centres, strict=True)),
    )
    model = SwarmModel(map=world, rng=1)
    sensor = ProximitySensor(range=reach, field_of_view_degrees=view)
    model.add_robots(RobotDesign(name="looking", radius=5.0, sensors=(sensor,)), poses=[(*p, 0.0) for p in places])
    model.sense()
    share = float((model.swarm.distance[:, 0] >= 0).mean())
    all_area = len(grid) ** 2 * spacing**2 * len(centres) * 7 / len(grid) ** 2
    assert share * all_area == pytest.approx(theory_sensing.counted_area(reach, view), rel=0.12)


def test_the_area_of_a_narrow_sector_is_that_of_steiner_less_what_the_robot_takes():
    reach, half, rho = 50.0, math.radians(20.0), 5.0
    steiner = reach**2 * half + (2.0 * reach + 2.0 * reach * half) * rho + math.pi * rho**2
    behind = steiner - theory_sensing.counted_area(reach, 40.0)
    own = math.pi * 10.0**2
    assert 0.25 * own < behind < 0.75 * own


def test_a_look_among_no_discs_sees_nothing_and_shares_rise_with_distance_and_view():
    assert np.max(theory_sensing.look_run(1, density=0.0, robots=4)["shares"]) == 0.0
    shares = np.array(theory_sensing.look_run(1, density=0.05, robots=49)["shares"])
    assert (np.diff(shares, axis=1) >= 0.0).all()
    assert (np.diff(shares, axis=0) >= 0.0).all()


# Flocks


@pytest.mark.parametrize("reach", [theory_flocks.NO_RANGE, 10.0, theory_flocks.EVERY_RANGE])
def test_neighbours_on_a_torus_are_those_of_the_shortest_distance(reach):
    side, n = 57.0, 30
    places = np.random.default_rng(5).uniform(0.0, side, (n, 2))
    layer = theory_flocks.AlignWithNoise(side=side, range=min(reach, 0.75 * side), noise=0.0)
    model = torus(layer, places, side=side, speed=0.3, steps=1, rng=1)
    unit = np.exp(1j * np.random.default_rng(6).uniform(-math.pi, math.pi, n))
    way = np.abs(places[:, None] - places[None, :])
    near = np.hypot(*np.minimum(way, side - way).transpose(2, 0, 1)) <= reach
    expected = (near & ~np.eye(n, dtype=bool)) @ unit
    assert model.control.layers[0]._of_others(unit) == pytest.approx(expected)


def test_without_noise_robots_that_are_all_neighbours_agree_at_once():
    numbers = theory_flocks.flock_run(1, robots=16, noise=0.0, range=theory_flocks.EVERY_RANGE, settling=1, steps=3)
    assert numbers["order"] == pytest.approx(1.0)
    assert numbers["square"] == pytest.approx(theory_flocks.square_of_all(16, 0.0))
    assert numbers["fluctuation"] == pytest.approx(0.0, abs=1e-9)


def test_squared_order_of_all_is_that_of_independent_noise():
    chance, n, noise = np.random.default_rng(7), 8, 0.5
    drawn = np.exp(1j * noise * chance.uniform(-math.pi, math.pi, (20_000, n)))
    squares = np.abs(drawn.mean(axis=1)) ** 2
    assert squares.mean() == pytest.approx(theory_flocks.square_of_all(n, noise), abs=5.0 * squares.std() / 141.0)


# Items and their page


class MadeUp:
    """A laboratory whose runs give numbers near theory, each off by a share and a little chance."""

    def __init__(self, off: float = 0.0) -> None:
        self.off = off

    def fresh_seeds(self, count, quick=3):
        return range(1, 1 + count)

    def grid(self, run, points, seeds, *, alone=False):
        return [[self.numbers(run.__name__, point, (-1.0) ** seed) for seed in seeds] for point in points]

    def numbers(self, name, point, sign):
        factor = 1.0 + self.off + 0.001 * sign
        return getattr(self, name)(factor, **point)

    def gas_run(self, factor, density, rebound, speed, **_):
        step = speed / (2.0 * theory_kinetics.RADIUS * theory_kinetics.WAY)
        often = theory_kinetics.collisions_in_theory(density) * step
        if rebound:
            return {"density": density, "contacts": factor * often}
        jam = 2.0 if density == theory_kinetics.DENSE else 1.0
        meetings = factor * often / theory_kinetics.contact_value(density)
        return {
            "density": density,
            "contacts": jam * factor * theory_kinetics.in_contact(density),
            "meetings": meetings,
        }

    def drive_run(self, factor, **slip):
        slip, looks = Slip(**slip), theory_motion.LOOKS
        return {
            "looks": list(looks),
            "diffusion": factor * theory_motion.diffusion_of(slip),
            "cosine": [factor * theory_motion.cosine_after(slip, t) for t in looks],
            "square": [factor * theory_motion.square_after(slip, t) for t in looks],
            "ahead": [factor * theory_motion.ahead_after(slip, t) for t in looks],
        }

    def walk_run(self, factor, robots, straight):
        visits = (
            [theory_motion.straight_visit(theory_motion.STRAIGHT_STEPS)]
            if straight
            else list(map(theory_motion.lattice_visit, theory_motion.HOPS))
        )
        return {"covered": [factor * float(theory_motion.covered_by(robots, visit)) for visit in visits]}

    def look_run(self, factor, density):
        distances, views = theory_sensing.DISTANCES, theory_sensing.FIELDS_OF_VIEW
        return {"shares": [[factor * theory_sensing.seen(x, view, density) for x in distances] for view in views]}

    def flock_run(self, factor, robots, noise, density=2.0, range=theory_flocks.RANGE):
        all_of_them = range == theory_flocks.EVERY_RANGE
        square = theory_flocks.square_of_all(robots, noise if all_of_them else 1.0)
        order = 1.0 - 0.4 * noise + 0.01 * density - 0.0001 * robots
        return {"order": factor * order, "square": factor * square, "fluctuation": factor * robots}


@pytest.fixture(scope="module")
def at_theory():
    return {name: find_item(name).make(MadeUp()) for name in NAMES}


def compared(result):
    return [check for check in result.checks if "includes the theory" in check.criterion]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_an_item_is_confirmed_where_runs_are_as_predicted(name, at_theory):
    assert at_theory[name].verdict == "confirmed"
    assert all(all(check.row) for check in at_theory[name].checks)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name != "vicsek_transition"])
@pytest.mark.parametrize("off", [-0.05, 0.05])
def test_an_item_is_not_confirmed_where_runs_are_off_by_a_twentieth(name, off):
    checks = compared(find_item(name).make(MadeUp(off)))
    assert {check.outcome for check in checks} == {FAILED}


def test_few_repetitions_of_all_comparisons_fail_by_chance(at_theory):
    number = sum(len(compared(result)) for result in at_theory.values())
    assert number >= 50
    assert 1.0 - AGAINST_THEORY**number < 0.075


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST)
def test_an_item_is_made_quickly(name, tmp_path):
    with Laboratory(tmp_path, quick=True) as laboratory:
        result = find_item(name).make(laboratory)
    assert FAILED not in {check.outcome for check in result.checks}
    assert "" in result.pictures


def sections():
    parts = re.split(r"^## ([\w.]+): .*$", PAGE.read_text(encoding="utf-8"), flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_page_has_every_item_once_in_order_and_was_made_with_all_seeds():
    page = PAGE.read_text(encoding="utf-8")
    assert list(sections()) == NAMES
    assert "Few seeds" not in page
    assert re.findall(r"^\| (\w+) \| .*\| \*\*", page, re.M) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_the_page_has_the_equations_settings_claims_and_predictions_of_the_code(name, at_theory):
    section, result = sections()[name], at_theory[name]
    assert find_item(name).about in section
    assert find_item(name).paper in section
    assert f"Settings: {result.settings}." in section
    assert all(f"- {remark}" in section for remark in result.remarks)
    lines = [line.replace("*", "") for line in section.splitlines()]
    for check in result.checks:
        line = next(line for line in lines if line.startswith(f"| {check.claim} | "))
        assert f"| {check.criterion} |" in line
        # The gas is compared with the theory of the density that each run had.
        if not name.startswith(("kinetic", "blind")):
            printed, exact = (text.replace(",", "") for text in (line.split(" | ")[1], check.reported))
            if printed != exact:  # numbers have as many digits as the intervals beside them
                half_a_digit = 0.5 * 10.0 ** -min(len(text.partition(".")[2]) for text in (printed, exact))
                assert float(printed) == pytest.approx(float(exact), abs=1.01 * half_a_digit)
    assert (PAGE.parent / "pictures" / f"{name}.png").exists()
