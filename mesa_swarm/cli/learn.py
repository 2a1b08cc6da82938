"""Robots that learn: reward-lab, tune."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesa_swarm.base.errors import check_choice, check_number
from mesa_swarm.base.files import check_writable, write_all
from mesa_swarm.base.wording import quantity
from mesa_swarm.cli.lines import print_lines, terminal_width
from mesa_swarm.cli.options import MOST_STORED, Folder, Jobs, Quiet, Tables, resumable

if TYPE_CHECKING:
    from mesa_swarm.learning.reward_lab import Profile

commands = typer.Typer()

# Of the four measures of oscillation.
UNITS = (
    "flips of the turn, and of the direction of travel, per 100 of the steps with something within 30 units; "
    "shares of all steps that are in a corridor flip, or back-and-forth at a threshold."
)


@commands.command("reward-lab")
def reward_lab_command(
    *,
    rewards: Annotated[str, typer.Option(metavar="A,B,...", help="Of a, b and c.")] = "a,b,c",
    actions: Annotated[int, typer.Option(help="How many actions robots choose from: 4 or 8.")] = 8,
    critical: Annotated[float, typer.Option(help="Critical distance as a share of the range.")] = 0.08,
    steps: Annotated[int, typer.Option(min=1, max=MOST_STORED, help="How long 15 robots learn.")] = 20_000,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs with each reward; the first is drawn.")] = 1,
    rng: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="The first seed.")] = 1,
    out: Folder = Path("results", "reward_lab"),
    quiet: Quiet = False,
) -> None:
    """Draw reward, learned values and choice over the distance ahead; measure where robots oscillate."""
    from mesa_swarm.base.progress import progress_bar
    from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, oscillation, trained
    from mesa_swarm.experiments.learning_figures import reward_figure
    from mesa_swarm.experiments.tables import csv_text, fitting
    from mesa_swarm.learning.actions import checked_actions
    from mesa_swarm.learning.reward_lab import learned_profile, reward_profile
    from mesa_swarm.learning.rewards import REWARDS
    from mesa_swarm.robots.design import AGENT9
    from mesa_swarm.viewing.pictures import png

    kinds = list(dict.fromkeys(check_choice("reward", part.strip(), REWARDS) for part in rewards.split(",")))
    checked_actions(actions)
    check_number("critical", critical, above=0, maximum=1)
    folder = check_writable(out)
    profiles = {}
    rows: list[tuple] = [("reward", "actions", "seed", "scene", *MEASURES)]
    with progress_bar(len(kinds) * seeds, "runs", not quiet) as bar:
        for kind in kinds:
            for seed in range(rng, rng + seeds):
                policy = trained(kind, actions, seed, steps=steps, critical=critical)
                if seed == rng:
                    paid = reward_profile(kind, actions=actions, critical=critical)
                    profiles[kind] = paid, learned_profile(policy, AGENT9)
                for scene in SCENES:
                    measured = oscillation(policy, scene=scene, rng=seed)
                    rows.append((kind, actions, seed, scene, *(round(measured[name], 6) for name in MEASURES)))
                bar.update()
    print_lines([*fitting(_summary(kinds, rows), terminal_width()), ""])
    print_lines([f"Means over 15 robots and {quantity(seeds, 'seed')}: {UNITS}"], 0)
    titles = {f"reward {kind}, {actions} actions": pair for kind, pair in profiles.items()}
    figure = reward_figure(titles, critical)
    contents: dict[str, str | bytes] = {
        "reward_lab.png": png(figure),
        "curves.csv": csv_text(curves(profiles)),
        "marks.csv": csv_text(marks(profiles)),
        "oscillations.csv": csv_text(rows),
    }
    print("\n".join(map(str, write_all(folder, contents))))


def _summary(kinds: list[str], rows: list[tuple]) -> list[list[str]]:
    """Return the mean measures of each scene and reward."""
    import numpy as np

    head, *measured = rows
    table = [["scene", "reward", *head[4:]]]
    for scene in dict.fromkeys(row[3] for row in measured):
        for kind in kinds:
            chosen = np.array([row[4:] for row in measured if (row[0], row[3]) == (kind, scene)], dtype=float)
            turns, travels, corridor, threshold = chosen.mean(axis=0)
            shares = [f"{100 * corridor:.1f} %", f"{100 * threshold:.1f} %"]
            table.append([scene, kind, f"{turns:.1f}", f"{travels:.1f}", *shares])
    return table


def curves(profiles: "dict[str, tuple[Profile, Profile]]") -> list[tuple]:
    """Return a row for each reward, action and distance: the reward there, the learned value, the probability."""
    import numpy as np

    rows: list[tuple] = [("reward", "action", "distance", "r", "Q", "P")]
    for kind, (paid, learned) in profiles.items():
        for a, name in enumerate(paid.actions):
            for i, x in enumerate(learned.distance):
                r = float(paid.values[np.searchsorted(paid.distance, x - 1e-9), a])
                probability = None if learned.policy is None else learned.policy[i, a]
                rows.append((kind, name, round(float(x), 6), r, float(learned.values[i, a]), probability))
    return rows


def marks(profiles: "dict[str, tuple[Profile, Profile]]") -> list[tuple]:
    """Return a row for each mark of the curves."""
    rows: list[tuple] = [("reward", "curve", "mark", "action", "start", "end", "size")]
    for kind, pair in profiles.items():
        for curve, profile in zip(("reward", "learned"), pair, strict=True):
            rows += [(kind, curve, m.kind, m.action, m.start, m.end, m.size) for m in profile.marks]
    return rows


@commands.command("tune")
def tune_command(
    *,
    steps: Annotated[int, typer.Option(min=1, max=MOST_STORED, help="In which collisions count.")] = 1_000,
    least_speed: Annotated[
        float | None,
        typer.Option(min=-1, max=1, help="Mean forward speed, share of the full one; by default the thesis's robots'."),
    ] = None,
    robots: Annotated[int, typer.Option(min=1, max=1000, help="How many learn together.")] = 15,
    generations: Annotated[int, typer.Option(min=1, max=10_000, help="Of CMA-ES.")] = 24,
    population: Annotated[int, typer.Option(min=4, max=1000, help="Candidates a generation.")] = 8,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs of each candidate.")] = 6,
    judged: Annotated[int, typer.Option(min=2, max=1000, help="Runs with other seeds that judge the result.")] = 24,
    rng: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Seed of the search.")] = 1,
    jobs: Jobs = 1,
    out: Folder = Path("results", "tune"),
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Tune T and gamma of the Q-learner to few collisions at a speed, and compare; continue an interrupted call."""
    from mesa_swarm.experiments.tables import fitting
    from mesa_swarm.searches import tuning
    from mesa_swarm.searches.calibration import FRESH

    least_speed = tuning.LEAST_SPEED if least_speed is None else least_speed
    goal = tuning.LearningGoal(steps=steps, least_speed=least_speed, robots=robots)
    files: dict[str, Any] = {"jobs": jobs, "tables": table or ()}
    first = tuning.FIRST_SEED
    with resumable(out):
        tuned = tuning.tune(
            goal,
            generations=generations,
            population=population,
            seeds=range(first, first + seeds),
            rng=rng,
            progress=not quiet,
            out=out,
            **files,
        )
        print("\n".join(f"{name} = {value:.4g}" for name, value in tuned.settings.items()))
        judgement = tuning.comparison(tuned, seeds=range(1, judged + 1), out=out / FRESH, **files)
    print_lines([*fitting(judgement.table, terminal_width()), *judgement.remarks], 0)
