"""The study of the reward laboratory: robots that learn with each reward, what they learn, and how they oscillate."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from mesa_swarm.base.errors import check_choice, check_count, check_number
from mesa_swarm.base.wording import quantity
from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, oscillation
from mesa_swarm.experiments.experiment import Experiment, checked_experiment
from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.runs import Run, done_in_order
from mesa_swarm.experiments.tables import Study, csv_text, fitting
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.learning.actions import checked_actions
from mesa_swarm.learning.reward_lab import Profile, learned_profile, profile_of, reward_profile
from mesa_swarm.learning.rewards import CRITICAL, REWARDS
from mesa_swarm.robots.design import AGENT9

# Of the four measures of oscillation.
UNITS = (
    "flips of the turn, and of the direction of travel, per 100 of the steps with something within 30 units; "
    "shares of all steps that are in a corridor flip, or back-and-forth at a threshold."
)
# What is stored of the curves of the first seed, lists beside the measures.
CURVES = ("distance", "Q", "P")
# Of a robot alone in a scene, by its name in the results of a run.
IN_SCENES = {f"{scene}: {measure}": (scene, measure) for scene in SCENES for measure in MEASURES}
# Measures depend on these files and on the engine; after a change runs are repeated.
SOURCES = ("experiments/diagnosis.py", "experiments/reward_study.py")


@dataclass(frozen=True, slots=True, repr=False)
class RewardStudy(Study):
    """Robots that learned with rewards, by reward and seed; made by `reward_study`.

    `profiles` has by reward the curves of the reward, and of what was learned from it with the first seed; `done` each
    run with its measures.
    """

    experiment: Experiment
    profiles: dict[str, tuple[Profile, Profile]]
    done: tuple[tuple[Run, Outcome], ...]
    files: RunFiles

    def table(self, width: int | None = None) -> str:
        """Return the mean measures of each scene and reward as text, the table at most `width` columns wide."""
        rows = [["scene", "reward", *MEASURES]]
        for scene in SCENES:
            for reward in self.profiles:
                runs = [row for row in self._oscillations() if (row[0], row[3]) == (reward, scene)]
                turns, travels, corridor, threshold = np.array([row[4:] for row in runs], float).mean(axis=0)
                shares = [f"{100 * corridor:.1f} %", f"{100 * threshold:.1f} %"]
                rows.append([scene, reward, f"{turns:.1f}", f"{travels:.1f}", *shares])
        seeds = quantity(len(self.experiment.seeds), "seed")
        robots = self.experiment.settings["n_robots"]
        return "\n".join([*fitting(rows, width), "", f"Means over {robots} robots and {seeds}: {UNITS}"])

    def _oscillations(self) -> list[tuple]:
        """Return a row for each run and scene: reward, actions, seed, scene, measures."""
        return [
            (
                *(run.settings[name] for name in ("reward", "actions")),
                run.rng,
                scene,
                *(round(outcome.numbers[f"{scene}: {measure}"], 6) for measure in MEASURES),
            )
            for run, outcome in self.done
            for scene in SCENES
        ]

    def _curves(self) -> list[tuple]:
        """Return a row for each reward, action and distance: the reward there, the learned value, the probability."""
        rows: list[tuple] = []
        for kind, (paid, learned) in self.profiles.items():
            for a, name in enumerate(paid.actions):
                for i, x in enumerate(learned.distance):
                    r = float(paid.values[np.searchsorted(paid.distance, x - 1e-9), a])
                    probability = None if learned.policy is None else learned.policy[i, a]
                    rows.append((kind, name, round(float(x), 6), r, float(learned.values[i, a]), probability))
        return rows

    def _marks(self) -> list[tuple]:
        """Return a row for each mark of the curves."""
        return [
            (kind, curve, mark.kind, mark.action, mark.start, mark.end, mark.size)
            for kind, pair in self.profiles.items()
            for curve, profile in zip(("reward", "learned"), pair, strict=True)
            for mark in profile.marks
        ]

    def _texts(self) -> dict[str, str]:
        tables = {
            "curves.csv": [("reward", "action", "distance", "r", "Q", "P"), *self._curves()],
            "marks.csv": [("reward", "curve", "mark", "action", "start", "end", "size"), *self._marks()],
            "oscillations.csv": [("reward", "actions", "seed", "scene", *MEASURES), *self._oscillations()],
        }
        return {name: csv_text(rows) for name, rows in tables.items()}

    def _pictures(self) -> dict[str, bytes]:
        from mesa_swarm.experiments.learning_figures import reward_figure  # noqa: PLC0415 - slow to load
        from mesa_swarm.viewing.figures import png  # noqa: PLC0415

        settings = self.experiment.settings
        titles = {f"reward {kind}, {settings['actions']} actions": pair for kind, pair in self.profiles.items()}
        return {"reward_lab.png": png(reward_figure(titles, settings["critical"]))}


def reward_study(
    rewards: Sequence[str] = REWARDS,
    *,
    actions: int = 8,
    critical: float = CRITICAL,
    steps: int = 20_000,
    seeds: int = 1,
    rng: int = 1,
    robots: int = 15,
    jobs: int = 1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
    until: Callable[[Any], object] | str | None = None,
    series: bool | str = False,
    tables: Sequence[str] = (),
) -> RewardStudy:
    """Let robots of the model `QLearning` learn with each reward, and measure how they oscillate in both scenes.

    Parameters
    ----------
    rewards : sequence of str
        Of "a", "b" and "c".
    actions : int
        4 or 8.
    critical : float
        The critical distance as a share of the range, above 0, at most 1.
    steps : int
        In which the robots learn.
    seeds, rng : int
        How many runs with each reward, and the seed of the first, of which the curves are.
    robots : int
        Which learn together.
    jobs : int
        Processes, -1 for one on each core; the result does not depend on it.
    progress : bool
    out : path, optional
        Folder in which each run is stored as soon as it is done: a study that was interrupted, or killed, continues
        when it is called again with the same folder.
    until, series, tables
        See `sweep`; series and tables need `out`.

    Examples
    --------
    >>> study = reward_study(["b"], actions=4, steps=20, robots=2)
    >>> [outcome.steps for _, outcome in study.done]
    [20]
    """
    kinds = list(dict.fromkeys(check_choice("reward", kind, REWARDS) for kind in rewards))
    check_number("critical", critical, above=0, maximum=1)
    first, count = check_count("rng", rng), check_count("seeds", seeds, minimum=1)
    workers, files = checked_jobs(jobs), RunFiles.checked(out, series=series, tables=tables)
    experiment = files.of(
        checked_experiment(
            "q_learning",
            {"reward": kinds},
            seeds=range(first, first + count),
            steps=steps,
            settings={"actions": checked_actions(actions), "critical": critical, "beta": 5e-3, "n_robots": robots},
            until=until,
        )
    )
    with files.ledger(fits=_is_measured) as ledger:
        runs = [_with_measures(run, first) for run in experiment.runs()]
        done = done_in_order(runs, work=partial(_learned, first), ledger=ledger, workers=workers, progress=progress)
    measured = tuple((run, _without_curves(outcome)) for run, outcome in done)
    files.write(experiment, lambda: measured)
    curves = {run.settings["reward"]: outcome.numbers for run, outcome in done if run.rng == first}
    learned = {kind: profile_of(*(np.array(numbers[name]) for name in CURVES)) for kind, numbers in curves.items()}
    paid = {kind: reward_profile(kind, actions=actions, critical=critical) for kind in kinds}
    return RewardStudy(experiment, {kind: (paid[kind], learned[kind]) for kind in kinds}, measured, files)


def _with_measures(run: Run, first: int) -> Run:
    """Return a run with a key of its own: its results are measures of oscillation, and of the first seed curves."""
    return replace(run, key=fingerprint(run.key, engine_hash(*SOURCES), run.rng == first))


def _learned(first: int, run: Run) -> Outcome:
    """Do one run, and measure what its robots do with what they have learned; with the first seed note the curves."""
    model = run.made()
    watch = run.watched(model)
    policy = model.learner.policy()
    measures = {scene: oscillation(policy, scene=scene, rng=run.rng) for scene in SCENES}
    results: dict[str, Any] = {name: measures[scene][measure] for name, (scene, measure) in IN_SCENES.items()}
    if run.rng == first:
        profile = learned_profile(policy, AGENT9)
        curves = profile.distance, profile.values, np.asarray(profile.policy)
        results |= {name: curve.tolist() for name, curve in zip(CURVES, curves, strict=True)}
    return run.stored(model, watch, Outcome(model.steps, model.state_hash(), results))


def _without_curves(outcome: Outcome) -> Outcome:
    """Return an outcome with the measures only, as tables have them."""
    return replace(outcome, results={name: outcome.numbers[name] for name in IN_SCENES})


def _is_measured(outcome: Outcome) -> bool:
    """Return whether an outcome is that of a run of a study: all measures, and perhaps the curves."""
    measured = all(isinstance(outcome.numbers.get(name), int | float) for name in IN_SCENES)
    return measured and outcome.numbers.keys() in ({*IN_SCENES}, {*IN_SCENES, *CURVES})
