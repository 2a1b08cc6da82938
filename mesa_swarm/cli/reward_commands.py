"""What the command reward-lab does with what was typed."""

from pathlib import Path

import numpy as np

from mesa_swarm.errors import check_choice
from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, oscillation, trained
from mesa_swarm.experiments.learning_figures import reward_figure
from mesa_swarm.experiments.tables import aligned, csv_text
from mesa_swarm.files import check_writable, write_all
from mesa_swarm.learning import QPolicy
from mesa_swarm.learning.actions import checked_actions
from mesa_swarm.learning.reward_lab import Profile, learned_profile, reward_profile
from mesa_swarm.learning.rewards import REWARDS
from mesa_swarm.progress import progress_bar
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.viewing.pictures import png


def reward_lab(*, rewards: str, actions: int, steps: int, seeds: int, rng: int, out: Path, progress: bool) -> None:
    """Train robots by each reward, draw what they learned, measure how they dither; print the table and the paths.

    Parameters
    ----------
    rewards : str
        Such as "a,b,c".
    actions : int
        4 or 8.
    steps : int
        Of training.
    seeds : int
        Runs by each reward, from seed `rng` on; the picture shows the first.
    rng : int
    out : Path
        Folder of reward_lab.png, curves.csv, marks.csv and oscillations.csv.
    progress : bool
        Whether a bar is shown.
    """
    kinds = parsed_rewards(rewards)
    checked_actions(actions)
    folder = check_writable(out)
    profiles, rows = {}, []
    with progress_bar(len(kinds) * seeds, "runs", progress) as bar:
        for kind in kinds:
            for seed in range(rng, rng + seeds):
                policy = trained(kind, actions, seed, steps=steps)
                if seed == rng:
                    profiles[kind] = reward_profile(kind, actions=actions), learned_profile(policy, AGENT9)
                rows += [(kind, actions, seed, scene, *_dithering(policy, scene, seed)) for scene in SCENES]
                bar.update()
    print("\n".join(aligned(_summary(kinds, rows))))
    figure = reward_figure({f"reward {kind}, {actions} actions": pair for kind, pair in profiles.items()})
    contents: dict[str, str | bytes] = {
        "reward_lab.png": png(figure),
        "curves.csv": curves_csv(profiles),
        "marks.csv": marks_csv(profiles),
        "oscillations.csv": csv_text([("reward", "actions", "seed", "scene", *MEASURES), *rows]),
    }
    print("\n".join(map(str, write_all(folder, contents))))


def parsed_rewards(text: str) -> list[str]:
    """Return the rewards that were typed with commas between them, each once.

    Examples
    --------
    >>> parsed_rewards("b, c")
    ['b', 'c']
    """
    kinds = [check_choice("reward", part.strip(), REWARDS) for part in text.split(",")]
    return list(dict.fromkeys(kinds))


def _dithering(policy: QPolicy, scene: str, seed: int) -> list[float]:
    measured = oscillation(policy, scene=scene, rng=seed)
    return [round(measured[name], 6) for name in MEASURES]


def _summary(kinds: list[str], rows: list[tuple]) -> list[list[str]]:
    table = [["scene", "reward", *MEASURES]]
    for scene in SCENES:
        for kind in kinds:
            chosen = np.array([row[4:] for row in rows if (row[0], row[3]) == (kind, scene)], dtype=float)
            turns, travels, corridor, threshold = chosen.mean(axis=0)
            shares = [f"{100 * corridor:.1f} %", f"{100 * threshold:.1f} %"]
            table.append([scene, kind, f"{turns:.1f}", f"{travels:.1f}", *shares])
    return table


def curves_csv(profiles: dict[str, tuple[Profile, Profile]]) -> str:
    """Return a line for each reward, action and distance: the reward there, the value learned, the probability."""
    lines: list[tuple] = [("reward", "action", "distance", "r", "Q", "P")]
    for kind, (paid, learned) in profiles.items():
        for a, name in enumerate(paid.actions):
            for i, x in enumerate(learned.distance):
                r = float(paid.values[np.searchsorted(paid.distance, x - 1e-9), a])
                likely = None if learned.policy is None else learned.policy[i, a]
                lines.append((kind, name, round(float(x), 6), r, float(learned.values[i, a]), likely))
    return csv_text(lines)


def marks_csv(profiles: dict[str, tuple[Profile, Profile]]) -> str:
    """Return a line for each mark."""
    lines: list[tuple] = [("reward", "curve", "mark", "action", "start", "end", "size")]
    for kind, pair in profiles.items():
        for curve, profile in zip(("reward", "learned"), pair, strict=True):
            lines += [(kind, curve, m.kind, m.action, m.start, m.end, m.size) for m in profile.marks]
    return csv_text(lines)
