"""Where strategy A wins, if anywhere: over robots, the size of fires, and how long robots rest."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from mesa_swarm.experiments.statistics import Interval, mean_interval, paired_difference
from mesa_swarm.experiments.tables import in_words
from mesa_swarm.reproduction.drawing import column
from mesa_swarm.reproduction.fire_runs import fire_run
from mesa_swarm.reproduction.laboratory import Laboratory

ROBOTS = (5, 10, 20, 30, 50)
SIZES = (0.5, 1.0, 2.0)
# Of the default constants, and around it.
REST = 60.0
RESTS = (15.0, REST, 240.0)
SEEDS = 6
# Half of what the thesis's two runs are given: who is done is done by then.
MOST_STEPS_OF_MAP = 8_000
SIDES = ("A", "B")


@dataclass(frozen=True, kw_only=True, slots=True)
class Cell:
    """Strategies A and B at one number of robots, size of fires and rest time, over paired seeds.

    Parameters
    ----------
    robots : int
    size, rest : float
    out : (float, float)
        Mean number of fires that A and B put out.
    more : Interval
        Of the paired difference, B less A.
    sooner : Interval
        Steps by which B was done sooner, over pairs in which both put out all fires.
    pairs : int
        How many such pairs there are.
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
        """Who puts out clearly more fires, or, if nobody does, is clearly done sooner; "" for nobody."""
        return sign(self.more) or sign(self.sooner)


def sign(difference: Interval) -> str:
    """Return whose favour the interval of a difference, B less A, is in: "A", "B" or "".

    Examples
    --------
    >>> sign(Interval(1.0, 0.5, 1.5)), sign(Interval(0.0, -1.0, 1.0)), sign(Interval(-1.0, -2.0, -0.5))
    ('B', '', 'A')
    """
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
    rows = laboratory.grid(fire_run, points, laboratory.seeds(SEEDS))
    return [cell_of(place, *pair) for place, pair in zip(places, zip(rows[::2], rows[1::2], strict=True), strict=True)]


def cell_of(place: dict, leaving: Sequence[dict], waiting: Sequence[dict]) -> Cell:
    """Return the cell of paired runs of A and of B.

    Examples
    --------
    >>> runs = [{"out": 7, "all out at": 100}, {"out": 7, "all out at": 120}]
    >>> cell_of({"robots": 5, "size": 1.0, "rest": 60.0}, runs, runs).winner
    ''
    """
    more, _ = paired_difference(column(leaving, "out"), column(waiting, "out"))
    sooner, pairs = paired_difference(column(waiting, "all out at"), column(leaving, "all out at"))
    left, waited = (mean_interval(column(rows, "out")).estimate for rows in (leaving, waiting))
    return Cell(**place, out=(left, waited), more=more, sooner=sooner, pairs=pairs)


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
    figure.suptitle("who wins: more fires out, or all out sooner", fontsize=11)
    return figure


def draw_panel(axes: Axes, cells: Sequence[Cell]) -> AxesImage:
    """Draw the cells of one size, each with who wins and by how many fires."""
    robots, rests = sorted({cell.robots for cell in cells}), sorted({cell.rest for cell in cells})
    place = {(cell.rest, cell.robots): cell for cell in cells}
    table = [[place[rest, n].more.estimate for n in robots] for rest in rests]
    shown = axes.imshow(table, cmap="PuOr", norm=TwoSlopeNorm(0.0, -3.0, 3.0), aspect="auto", origin="lower")
    for y, rest in enumerate(rests):
        for x, n in enumerate(robots):
            cell = place[rest, n]
            axes.text(x, y, f"{cell.winner or '='}\n{cell.more.estimate:+.1f}", ha="center", va="center", fontsize=8)
    axes.set_xticks(range(len(robots)), [str(n) for n in robots])
    axes.set_yticks(range(len(rests)), [f"{rest:g}" for rest in rests])
    axes.set_xlabel("robots")
    return shown


def winners_in_words(cells: Sequence[Cell]) -> tuple[str, ...]:
    """Say where each strategy wins, and how the difference changes over robots, sizes and rest times."""
    of = {side: [cell for cell in cells if cell.winner == side] for side in ("A", "B", "")}
    told = [
        f"Over robots, sizes of fires and rest times, {len(cells)} cells of paired seeds: B is clearly better in "
        f"{len(of['B'])}, A in {len(of['A'])}, neither in {len(of[''])}. At most {MOST_STEPS_OF_MAP:,} steps and "
        f"{SEEDS} seeds a cell; the intervals are not corrected for so many comparisons: about one cell in forty "
        "may go to either by chance."
    ]
    told += [f"A is clearly better {named(cell)}." for cell in of["A"]]
    plain = [cell for cell in cells if cell.size == 1.0 and cell.rest == REST]
    told.append("On the map as it is: " + "; ".join(over_robots(cell) for cell in plain) + ".")
    return tuple(told)


def over_robots(cell: Cell) -> str:
    """Say how the strategies compare with this number of robots."""
    gain = in_words(cell.sooner, signed=True)
    sooner = f", B sooner by {gain} steps in {cell.pairs} pairs that both ended" if cell.pairs > 1 else ""
    return f"{cell.robots} robots, {cell.out[0]:.1f} fires out with A and {cell.out[1]:.1f} with B{sooner}"


def named(cell: Cell) -> str:
    """Say where a cell is, and by how much A is better there."""
    by = in_words(cell.more, signed=True)
    what = f"{by} fires" if sign(cell.more) else f"{in_words(cell.sooner, signed=True)} steps sooner"
    return (
        f"with {cell.robots} robots, fires {cell.size:g} times as large and a rest of {cell.rest:g} (B less A: {what})"
    )
