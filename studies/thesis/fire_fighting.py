"""Figures 9.2 and 9.3: strategies A and B, and where A wins, if anywhere; single robots (9.4) and followers (9.5)."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from mesa_swarm import AGENT_FIRE, Map, SwarmModel
from mesa_swarm.experiments import Interval, bootstrap_mean, fires_figure, mean_interval, pair_differences, with_limits
from mesa_swarm.fire import FireConstants, design_constants, is_hot, next_temperature, robots_needed
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, plain_axes, world_picture
from mesa_swarm_studies.judging import (
    Check,
    Result,
    judged_difference,
    judged_fact,
    judged_mean,
    judged_measure,
    judged_share,
)
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item
from mesa_swarm_studies.thesis.fire_company import ITEMS as OF_COMPANY
from mesa_swarm_studies.thesis.fire_company import LARGEST

MOST_STEPS = 15_000
# Steps of work per step of rest, at the largest fire: of the default constants.
WORK_TO_REST = 100.0 / 60.0


def fire_run(
    rng: int,
    *,
    strategy: str,
    robots: int = 10,
    size: float = 1.0,
    rest: float = 60.0,
    steps: int = MOST_STEPS,
    alone: bool = True,
) -> dict[str, Any]:
    """Let robots fight the seven fires; return how many they put out, when, and how many robots were at the largest.

    `size` is a factor of all fires' areas; robots and constants are the same. A robot that rests longer works in
    proportion, as with the default constants, so that only the rhythm changes. `alone` is whether fires may fall to a
    single robot.
    """
    model = fire_model(rng, strategy, robots, size, rest)
    if not alone:
        model.fire_constants = shared_constants(model.fires.area)
    model.run(steps)
    out = model.fires.out_step
    history = model.fires.history.robots
    others = np.delete(model.fires.out, LARGEST)
    return {
        "out": int(model.fires.out.sum()),
        "others out": int(others.sum()),
        "largest out": bool(model.fires.out[LARGEST]),
        "all out at": int(out.max()) if model.fires.out.all() else None,
        "largest out at": int(out[LARGEST]) if out[LARGEST] >= 0 else None,
        "most at the largest": int(history[:, LARGEST].max(initial=0)),
        "together at the largest": float(np.mean(history[:, LARGEST] >= 2)) if len(history) else 0.0,
    }


def fire_model(rng: int, strategy: str, robots: int = 10, size: float = 1.0, rest: float = 60.0) -> SwarmModel:
    """Return the model of a run before its first step."""
    return find_model("fire_fighting")(rng=rng, strategy=strategy, n_robots=robots, map=grown_map(size), **rhythm(rest))


def shared_constants(areas: Iterable[float]) -> FireConstants:
    """Return constants by which no fire falls to one robot, and the largest to 17 at once."""
    return design_constants(areas=areas, robots=17, alone=False)


def grown_map(size: float) -> Map | str:
    """Return the map with the area of its fires times a factor; areas are (radius / 10)^2."""
    if size == 1.0:
        return "openspace_fire"
    plain = Map.load("openspace_fire")
    fires = tuple(replace(fire, radius=fire.radius * size**0.5) for fire in plain.fires)
    return replace(plain, name=f"openspace_fire times {size:g}", fires=fires)


def rhythm(rest: float) -> Mapping[str, float]:
    """Return the constants of robots that rest for this many steps, and work in proportion."""
    constants = design_constants(stay_time=WORK_TO_REST * rest, rest_time=rest)
    return {"leave": round(constants.leave, 9), "join": round(constants.join, 9)}


ROBOTS = (5, 10, 20, 30, 50)
SIZES = (0.5, 1.0, 2.0)
# Of the default constants, and around it.
REST = 60.0
RESTS = (15.0, REST, 240.0)
SEEDS = 24
# Of the intervals in a cell: with two comparisons in each of 45, one in twenty such studies has any by chance
# (Bonferroni).
CONFIDENCE = 1.0 - 0.05 / (2 * len(ROBOTS) * len(SIZES) * len(RESTS))
# Half of the steps of the thesis's two runs, which are enough for those that finish.
MOST_STEPS_OF_MAP = 8_000
SIDES = ("A", "B")


@dataclass(frozen=True, kw_only=True, slots=True)
class Cell:
    """Strategies A and B at one number of robots, size of fires and rest time, over paired seeds.

    `out` has the mean numbers of fires that A and B put out, `more` is the paired difference, B less A. `sooner` are
    the steps by which B was done sooner, over the `pairs` in which both put out all fires.
    """

    robots: int
    size: float
    rest: float
    out: tuple[float, float]
    more: Interval
    sooner: Interval
    pairs: int

    @property
    def winner(self) -> str:
        """The strategy that puts out clearly more fires, or else is clearly done sooner; "" for neither."""
        return sign(self.more) or sign(self.sooner)


def sign(difference: Interval) -> str:
    """Return which strategy the interval of a difference, B less A, favours: "A", "B" or ""."""
    if not difference.excludes_zero:
        return ""
    return "B" if difference.estimate > 0 else "A"


def compared(laboratory: Laboratory) -> list[Cell]:
    """Return all cells of the map."""
    robots = laboratory.pick(ROBOTS, (5, 20))
    sizes, rests = laboratory.pick(SIZES, (1.0,)), laboratory.pick(RESTS, (REST,))
    steps = laboratory.pick(MOST_STEPS_OF_MAP, 3_000)
    places = [{"robots": n, "size": size, "rest": rest} for size in sizes for rest in rests for n in robots]
    points = [{**place, "strategy": side, "steps": steps} for place in places for side in SIDES]
    rows = laboratory.grid(fire_run, points, laboratory.fresh_seeds(SEEDS))
    return [cell_of(place, *pair) for place, pair in zip(places, zip(rows[::2], rows[1::2], strict=True), strict=True)]


def cell_of(place: dict, leaving: Sequence[dict], waiting: Sequence[dict]) -> Cell:
    """Return the cell of paired runs of A and of B."""
    more = pair_differences(column(leaving, "out"), column(waiting, "out"))
    sooner = pair_differences(column(waiting, "all out at"), column(leaving, "all out at"))
    left, waited = (mean_interval(column(rows, "out")).estimate for rows in (leaving, waiting))
    by, earlier = (mean_interval(values, CONFIDENCE) for values in (more, sooner))
    return Cell(**place, out=(left, waited), more=by, sooner=earlier, pairs=len(sooner))


def cells_figure(cells: Sequence[Cell]) -> Figure:
    """Return the map: a panel for each size of fires, a row for each rest time, a column for each number of robots."""
    sizes = sorted({cell.size for cell in cells})
    figure = Figure(figsize=(2.8 + 3.4 * len(sizes), 3.6), layout="constrained")
    panels = figure.subplots(1, len(sizes), squeeze=False, sharey=True).ravel()
    for axes, size in zip(panels, sizes, strict=True):
        shown = draw_panel(axes, [cell for cell in cells if cell.size == size])
        axes.set_title(f"fires {size:g} times as large", fontsize=10)
    panels[0].set_ylabel("rest, steps")
    figure.colorbar(shown, ax=list(panels), label="fires more that B puts out")
    figure.suptitle("better strategy: more fires out, or all out sooner", fontsize=11)
    return figure


def draw_panel(axes: Axes, cells: Sequence[Cell]) -> AxesImage:
    """Draw the cells of one size, each with the winner and by how many fires."""
    robots, rests = sorted({cell.robots for cell in cells}), sorted({cell.rest for cell in cells})
    place = {(cell.rest, cell.robots): cell for cell in cells}
    table = [[place[rest, n].more.estimate for n in robots] for rest in rests]
    shown = axes.imshow(
        table, cmap=ListedColormap(LIGHT.diverging), norm=TwoSlopeNorm(0.0, -3.0, 3.0), aspect="auto", origin="lower"
    )
    for y, rest in enumerate(rests):
        for x, n in enumerate(robots):
            cell = place[rest, n]
            axes.text(x, y, f"{cell.winner or '='}\n{cell.more.estimate:+.1f}", ha="center", va="center", fontsize=8)
    axes.set_xticks(range(len(robots)), [str(n) for n in robots])
    axes.set_yticks(range(len(rests)), [f"{rest:g}" for rest in rests])
    axes.set_xlabel("robots")
    return shown


def winners_in_words(cells: Sequence[Cell]) -> tuple[str, ...]:
    """Return where each strategy wins, and how the difference changes over robots, sizes and rest times."""
    of = {side: [cell for cell in cells if cell.winner == side] for side in ("A", "B", "")}
    remarks = [
        f"Over robots, sizes of fires and rest times, {len(cells)} cells of paired seeds: B is clearly better in "
        f"{len(of['B'])}, A in {len(of['A'])}, neither in {len(of[''])}. At most {MOST_STEPS_OF_MAP:,} steps and "
        f"{SEEDS} seeds a cell; intervals of {CONFIDENCE:.2%} correct for multiple comparisons (Bonferroni)."
    ]
    remarks += [f"A is clearly better {named(cell)}." for cell in of["A"]]
    plain = [cell for cell in cells if cell.size == 1.0 and cell.rest == REST]
    remarks.append("On the map as it is: " + "; ".join(over_robots(cell) for cell in plain) + ".")
    return tuple(remarks)


def over_robots(cell: Cell) -> str:
    """Return how the strategies compare with this number of robots."""
    gain = with_limits(cell.sooner, signed=True)
    sooner = f", B sooner by {gain} steps in {cell.pairs} pairs that both ended" if cell.pairs > 1 else ""
    return f"{cell.robots} robots, {cell.out[0]:.1f} fires out with A and {cell.out[1]:.1f} with B{sooner}"


def named(cell: Cell) -> str:
    """Return the settings of a cell, and by how much A is better there."""
    by = with_limits(cell.more, signed=True)
    what = f"{by} fires" if sign(cell.more) else f"{with_limits(cell.sooner, signed=True)} steps sooner"
    return (
        f"with {cell.robots} robots, fires {cell.size:g} times as large and a rest of {cell.rest:g} (B less A: {what})"
    )


PAIRS = 200
FIRES = 7
FIGHTING = (
    "map openspace_fire, AGENT_FIRE, 10 robots, the default constants (growth 2,000 steps, two robots extinguish "
    "the largest fire in 1,600, stay 100, rest 60), at most 15,000 steps; the thesis gives no constants and no number "
    "of robots"
)


def fires(laboratory: Laboratory) -> Result:
    """Make a picture of fires as they are drawn, and judge the requirements of their rules (9.2)."""
    model = fire_model(1, "B").run(laboratory.pick(600, 60))
    area = model.fires.area
    drawn = model.fires.radius**2 / area
    checks = (
        judged_fact(
            "the drawn area is proportional to the fire's",
            "proportional",
            bool(np.ptp(drawn) < 1e-9),
            measured=f"radius^2 / area {drawn.min():g} at each",
        ),
        *requirements(),
    )
    title = f"Fire-fighting, strategy B, step {model.steps}: black to red is T, pale is out"
    return Result(checks=checks, pictures={"": world_picture(model, title)}, settings=FIGHTING)


def requirements() -> list[Check]:
    """Return whether the rules of fires meet the thesis's requirements, each on its own."""
    chosen = design_constants()
    k = (chosen.k1, chosen.k2, chosen.k3, chosen.k4, chosen.leave, chosen.join)
    needed = [robots_needed(chosen, area, t) for area, t in ((4, 0.5), (16, 0.5), (16, 1.0))]
    fall = [0.5 - next_temperature(0.5, 4.0, n, k) for n in range(4)]
    steps = {
        "effort depends on T and area (robots needed at area 4 and T 0.5, 16 and 0.5, 16 and 1)": (
            needed[0] < needed[1] < needed[2],
            ", ".join(f"{n:.2f}" for n in needed),
        ),
        "an unattended fire grows with time": (next_temperature(0.5, 4.0, 0, k) > 0.5, f"{-fall[0]:+.5f} a step"),
        "there is a terminal temperature": (next_temperature(1.0, 4.0, 0, k) == 1.0, "1"),
        "capacity is additive in robots, each at a constant rate": (
            bool(np.allclose(np.diff(fall), k[1] / 4.0)),
            f"{np.diff(fall)[0]:.5f} a robot and step",
        ),
        "a robot too hot leaves, and may return only when it has cooled": (
            is_hot(k[4], False, k) and is_hot((k[4] + k[5]) / 2, True, k) and not is_hot(k[5], True, k),
            f"hot at {k[4]:g}, until {k[5]:g}",
        ),
        "a robot cools at a constant rate": (k[3] > 0, f"{k[3]:g} a step"),
        "only robots near enough to extinguish take heat": heat_is_near(),
    }
    return [judged_fact(claim, "required (9.2)", held, measured=what) for claim, (held, what) in steps.items()]


def heat_is_near() -> tuple[bool, str]:
    """Return whether in a run only robots within reach of a fire took heat, and of how many robot-steps."""
    model, wrong, seen = fire_model(1, "B"), 0, 0
    reach = 10.0
    for _ in range(300):
        before = ~model.fires.out
        model.step()
        gap = np.linalg.norm(model.swarm.position[:, None] - model.fires.position[None], axis=2)
        gap = np.where(before, gap - model.fires.radius - model.swarm.radius[:, None], np.inf).min(axis=1)
        wrong += int(np.count_nonzero((model.swarm.columns["heat"] > 0) & (gap > reach + 1e-9)))
        seen += len(gap)
    return wrong == 0, f"{wrong} of {seen:,} robot-steps otherwise"


def paired_runs(laboratory: Laboratory) -> tuple[list[dict], list[dict]]:
    """Return the paired runs of A and of B that two figures share."""
    steps = laboratory.pick(MOST_STEPS, 4_000)
    points = [{"strategy": strategy, "steps": steps} for strategy in "AB"]
    first, second = laboratory.grid(fire_run, points, laboratory.fresh_seeds(PAIRS, quick=6))
    return first, second


def strategy_a(laboratory: Laboratory) -> Result:
    """Make figure 9.2: robots at each fire under A."""
    leaving, _ = paired_runs(laboratory)
    most = column(leaving, "most at the largest")
    checks = (
        large_left(leaving),
        others_out(leaving),
        judged_share(
            "never more than one robot is at the large fire",
            "never more than one",
            [count <= 1 for count in most],
            low=0.8,
            main=False,
        ),
        judged_mean(
            "share of the time with two or more robots there",
            "0",
            column(leaving, "together at the largest"),
            high=0.05,
            main=False,
        ),
    )
    return Result(
        checks=checks,
        pictures={"": history_figure(laboratory, "A")},
        settings=f"{FIGHTING}; {len(leaving)} seeds",
        remarks=(f"In no run were more than {max(most)} robots at the large fire at once.",),
    )


def strategy_b(laboratory: Laboratory) -> Result:
    """Make figure 9.3: robots at each fire under B, and how both compare around there."""
    leaving, waiting = paired_runs(laboratory)
    cells = compared(laboratory)
    checks = (
        all_out(waiting),
        more_out(leaving, waiting),
        judged_share(
            "robots meet at the large fire: two or more at once",
            "implicit cooperation",
            [count >= 2 for count in column(waiting, "most at the largest")],
            low=0.9,
        ),
        everywhere("B is at least as good with 5 to 50 robots", cells, lambda c: c.size == 1.0 and c.rest == REST),
        everywhere("B is at least as good with every size of fires and rest time", cells, lambda c: True),
    )
    return Result(
        checks=checks,
        pictures={"": history_figure(laboratory, "B"), "where": cells_figure(cells)},
        settings=f"{FIGHTING}; {len(waiting)} paired seeds",
        remarks=(paired_in_words(leaving, waiting), *winners_in_words(cells)),
    )


def large_left(leaving: list[dict], where: str = "", *, main: bool = True) -> Check:
    """Return the check that A leaves the large fire burning; `where` begins the claim."""
    burning = [not out for out in column(leaving, "largest out")]
    claim = f"{where}A leaves the large central fire burning"
    return judged_share(claim, "left burning (one run)", burning, low=0.8, main=main)


def others_out(leaving: list[dict]) -> Check:
    """Return the check that A puts out most of the other fires."""
    others = column(leaving, "others out")
    return judged_mean("A puts out most others: of 6", "the others out (one run)", others, low=5.0)


def all_out(waiting: list[dict]) -> Check:
    """Return the check that B puts out all fires."""
    every = [out == FIRES for out in column(waiting, "out")]
    return judged_share("B puts out all seven fires", "all out (one run)", every, low=0.9)


def more_out(leaving: list[dict], waiting: list[dict], where: str = "", *, main: bool = True) -> Check:
    """Return the check that B puts out more fires than A; `where` begins the claim."""
    claim, sides = f"{where}B puts out more fires than A", {"A": leaving, "B": waiting}
    return judged_measure(claim, "7 against 6 (one run each)", "out", sides, main=main)


def everywhere(claim: str, cells: list[Cell], wanted: Callable[[Cell], bool]) -> Check:
    """Judge whether A is clearly better in none of the wanted cells."""
    chosen = [cell for cell in cells if wanted(cell)]
    count = {side: sum(cell.winner == side for cell in chosen) for side in ("A", "B", "")}
    return judged_fact(
        claim,
        "not examined",
        count["A"] == 0,
        measured=f"A clearly better in {count['A']}, B in {count['B']}, neither in {count['']} of {len(chosen)} cells",
        criterion="A clearly better in no cell",
        main=False,
    )


def paired_in_words(leaving: list[dict], waiting: list[dict]) -> str:
    """Return what paired runs add to one run of each strategy."""
    more = sum(b > a for a, b in zip(column(leaving, "out"), column(waiting, "out"), strict=True))
    fewer = sum(b < a for a, b in zip(column(leaving, "out"), column(waiting, "out"), strict=True))
    times = [time for time in column(waiting, "all out at") if time is not None]
    large = sum(column(leaving, "largest out"))
    quick = with_limits(bootstrap_mean(times)) if times else "-"
    return (
        f"Of {len(leaving)} pairs B put out more fires in {more} and fewer in {fewer}. A put out the large fire in "
        f"{large} of {len(leaving)} runs. B finished after {quick} steps, in {len(times)} runs."
    )


def history_figure(laboratory: Laboratory, strategy: str) -> Figure:
    """Return a figure of the robots at each fire over time, for the first seed."""
    model = fire_model(1, strategy).run(laboratory.pick(6_000, 600))
    return fires_figure({f"strategy {strategy}, seed 1, fire {LARGEST + 1} is the large one": model})


SHARED_SEEDS = 100
# Of the runs under both constants; as many as are needed where no fire falls to one robot (seeds 10,000 to 10,003).
TEAM = 30
# Of claims about as many robots of which one alone puts out some fires.
EASILY = f"with the default constants and {TEAM} robots "


def shared(laboratory: Laboratory) -> Result:
    """Judge whether a single robot can put out a fire (9.4), and A against B where it cannot."""
    steps, seeds = laboratory.pick(MOST_STEPS, 2_000), laboratory.fresh_seeds(SHARED_SEEDS)
    one = {"robots": 1, "strategy": "B", "steps": steps}
    several = [{"robots": TEAM, "strategy": side, "steps": steps} for side in SIDES]
    several += [{**point, "alone": False} for point in several]
    points = [one, {**one, "strategy": "A"}, {**one, "alone": False}, {**one, "strategy": "A", "alone": False}]
    *single, easy_a, easy_b, leaving, waiting = laboratory.grid(fire_run, [*points, *several], seeds)
    plain, held = [*single[0], *single[1]], [*single[2], *single[3]]
    return Result(
        checks=(
            *alone_checks(plain, held),
            *(large_left(leaving), others_out(leaving), all_out(waiting), more_out(leaving, waiting)),
            large_left(easy_a, EASILY, main=False),
            more_out(easy_a, easy_b, EASILY, main=False),
        ),
        pictures={
            "": outs_figure(
                {
                    f"A, {TEAM} robots": leaving,
                    f"B, {TEAM} robots": waiting,
                    "a single robot": held,
                    "a single robot, default constants": plain,
                }
            )
        },
        settings=(
            "design_constants(areas=..., robots=17, alone=False): even the smallest fire grows while one robot fights "
            f"it; {TEAM} robots, map openspace_fire, at most {MOST_STEPS:,} steps. A single robot: {len(held)} runs, "
            "half of them with each strategy"
        ),
        remarks=(
            f"With the default constants a single robot puts out {min(column(plain, 'out'))} to "
            f"{max(column(plain, 'out'))} of the seven fires. Where even the smallest (area 1.69) takes two "
            "robots, the largest (area 16) takes 17 that work and rest: more than the ten of 9.2 and 9.3.",
        ),
    )


def alone_checks(plain: list[dict], held: list[dict]) -> list[Check]:
    """Return the checks of a single robot, with the default constants and where no fire falls to one."""

    def none_out(claim: str, rows: list[dict], *, main: bool) -> Check:
        return judged_share(claim, "cannot (9.4)", [out == 0 for out in column(rows, "out")], low=0.9, main=main)

    return [
        none_out("a single robot puts out no fire, by the constants of 9.4", held, main=True),
        none_out("a single robot puts out no fire, by the default constants", plain, main=False),
    ]


def outs_figure(runs: Mapping[str, list[dict]]) -> Figure:
    """Return a figure of the share of runs that put out each number of fires."""
    figure, axes = plain_axes("fires out", "share of runs")
    width = 0.8 / len(runs)
    for place, (label, rows) in enumerate(runs.items()):
        shares = np.bincount(column(rows, "out"), minlength=FIRES + 1) / len(rows)
        axes.bar(np.arange(FIRES + 1) + width * (place - (len(runs) - 1) / 2), shares, 0.95 * width, label=label)
    axes.set_xticks(range(FIRES + 1))
    axes.legend(frameon=False, loc="upper center")
    return figure


SEARCHING_STEPS = 4_000
SEARCHING_SEEDS = 200


def search_run(rng: int, *, team: str, steps: int = SEARCHING_STEPS) -> dict[str, Any]:
    """Let robots look for fires; return the mean steps until a robot first fights one, `steps` where it does not.

    In the team "half" the last half of the robots follow.
    """
    model = searching_model(rng, team)
    found = np.full(len(model.swarm), steps)
    while model.steps < steps and (found == steps).any():
        model.step()
        found[(model.swarm.fire >= 0) & (found == steps)] = model.steps
    half = len(found) // 2
    groups = {"all": found, "explorers": found[:half], "followers": found[half:]}
    return {name: float(times.mean()) for name, times in groups.items()}


TEAMS: dict[str, dict[str, Any]] = {"explore": {}, "follow": {"follow": "on"}, "respond": {"communication": "goal"}}


# The same as labels.
SEARCHERS = {"half": "half follow", "explore": "explore", "follow": "follow", "respond": "go where a fire is broadcast"}


def searching_model(rng: int, team: str) -> SwarmModel:
    """Return a model of robots that explore, follow, go where fires are broadcast, or half of which follow."""
    if team != "half":
        return find_model("fire_fighting")(rng=rng, **TEAMS[team])
    model = find_model("fire_fighting")(rng=rng, n_robots=0)
    following = find_model("fire_fighting")(rng=rng, n_robots=0, follow="on").control
    model.control = {"explorers": model.control, "followers": following}
    for group in model.control:
        model.add_robots(AGENT_FIRE, 5, group=group)
    return model


def followers(laboratory: Laboratory) -> Result:
    """Judge whether robots that follow find fires sooner than those that explore (9.5, 10.4)."""
    steps, seeds = laboratory.pick(SEARCHING_STEPS, 500), laboratory.fresh_seeds(SEARCHING_SEEDS)
    teams = ("half", *TEAMS)
    points = [{"team": team, "steps": steps} for team in teams]
    rows = dict(zip(teams, laboratory.grid(search_run, points, seeds), strict=True))

    def sooner(claim: str, team: str, group: str, other: str, against: str, *, main: bool = False) -> Check:
        steps = {f"{each}, {which}": column(rows[each], which) for each, which in ((team, group), (other, against))}
        return judged_difference(claim, "may be faster (9.5)", steps, main=main)

    return Result(
        checks=(
            sooner("followers find their first fire sooner than the explorers of their team",
                   "half", "followers", "half", "explorers", main=True),
            sooner("a team of followers finds fires sooner than one of explorers", "follow", "all", "explore", "all"),
            sooner("robots that go where others broadcast a fire find one sooner", "respond", "all", "explore", "all"),
        ),
        pictures={"": search_figure({team: column(rows[team], "all") for team in teams})},
        settings=(
            f"10 robots, strategy B, default constants; mean steps until a robot first fights a fire, {steps:,} "
            "where it has not; followers drive after the nearest robot ahead, as fast as explorers, and fight what "
            "they see"
        ),
        remarks=(
            "A likely reason, which was not measured: a follower searches where its leader has searched, and comes to "
            "a fire after it. What brings robots to fires sooner is a broadcast of where one burns.",
        ),
    )  # fmt: skip


def search_figure(times: Mapping[str, list[float]]) -> Figure:
    """Return a figure of the steps until robots find a fire, a box for each team."""
    figure, axes = plain_axes("robots", "mean steps until a robot finds a fire, each run")
    names = [SEARCHERS[team] for team in times]
    axes.boxplot(list(times.values()), tick_labels=names, medianprops={"color": LIGHT.series[1], "linewidth": 1.8})
    axes.set_ylim(bottom=0)
    return figure


ITEMS = (
    *OF_COMPANY,
    Item(figure="9.2", title="robots at each fire, strategy A", section="9.4", make=strategy_a),
    Item(figure="9.3", title="robots at each fire, strategy B", section="9.4", make=strategy_b),
    Item(figure="req9.2", title="fires, and their requirements", section="9.2, 9.3", make=fires),
    Item(figure="9.4", title="fires that no single robot can put out", section="9.4", make=shared),
    Item(figure="9.5", title="followers and explorers", section="9.5, 10.4", make=followers),
)
