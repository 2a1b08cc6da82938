"""Behaviour that gets nowhere: turning to and fro, blocking each other, being stuck; found in kept arrays."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.analysis.pathology_finders import (
    Thresholds,
    centroid_flips,
    corridor_flips,
    head_on_pairs,
    stuck_robots,
    threshold_flips,
)
from mesa_swarm.analysis.pathology_track import Track
from mesa_swarm.errors import check_choice

# In order of precedence: what finds each kind, and how it is told.
FINDERS = {
    "corridor flip": (
        corridor_flips,
        "turned away from what was near on its left and on its right by turns, {flips} times",
    ),
    "centroid flip": (
        centroid_flips,
        "turned left and right by turns, {flips} times, after robots that other sensors saw each time",
    ),
    "head-on pair": (head_on_pairs, "faced each other at close quarters and blocked each other's way"),
    "back-and-forth at a threshold": (threshold_flips, "drove forwards and backwards by turns, {flips} times"),
    "stuck": (stuck_robots, "drove and did not move"),
}
KINDS = tuple(FINDERS)


@dataclass(frozen=True, kw_only=True, slots=True)
class Episode:
    """One stretch of behaviour that gets nowhere.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    robots : tuple of int
        Rows, ascending: two for a head-on pair, else one.
    first_step, last_step : int
        Both inclusive; of flips the first and the last.
    flips : int
        How often the turn, or the direction of travel, changed sides; 0 for the other kinds.
    layers : tuple of int
        The layers that drove the robots in these steps, ascending, -1 for none.
    """

    kind: str
    robots: tuple[int, ...]
    first_step: int
    last_step: int
    flips: int = 0
    layers: tuple[int, ...] = ()

    @property
    def steps(self) -> int:
        """How many steps it lasted."""
        return self.last_step - self.first_step + 1

    def describe(self, ids: Sequence[int] | None = None) -> str:
        """Say in one sentence what happened.

        Parameters
        ----------
        ids : sequence of int, optional
            The unique_id of each row, by which `explain` names robots too; by default they are named by their rows.

        Examples
        --------
        >>> Episode(kind="stuck", robots=(3,), first_step=10, last_step=49, layers=(1,)).describe()
        'Robot 3 drove and did not move, in steps 10 to 49 (layer 1).'
        """
        who = "Robot " if len(self.robots) == 1 else "Robots "
        who += " and ".join(str(row if ids is None else ids[row]) for row in self.robots)
        layers = ", ".join(map(str, self.layers))
        drove = f" (layer{'s' if len(self.layers) > 1 else ''} {layers})" if layers else ""
        words = FINDERS[self.kind][1].format(flips=self.flips)
        return f"{who} {words}, in steps {self.first_step} to {self.last_step}{drove}."


@dataclass(frozen=True, slots=True)
class Pathologies:
    """Episodes, by first step, then kind in the order of `KINDS`, then robots.

    Parameters
    ----------
    episodes : tuple of Episode

    Examples
    --------
    >>> found = Pathologies((Episode(kind="stuck", robots=(3,), first_step=10, last_step=49),))
    >>> len(found), found.counts()["stuck"], found.of(0)
    (1, 1, ())
    """

    episodes: tuple[Episode, ...]

    def __len__(self) -> int:
        """How many episodes there are."""
        return len(self.episodes)

    def __iter__(self) -> Iterator[Episode]:
        """Go through the episodes."""
        return iter(self.episodes)

    def __getitem__(self, index: int) -> Episode:
        """Return one episode."""
        return self.episodes[index]

    def counts(self) -> dict[str, int]:
        """Return how many episodes there are of each kind."""
        return {kind: len(self.of_kind(kind)) for kind in KINDS}

    def of(self, row: int) -> tuple[Episode, ...]:
        """Return the episodes in which the robot of this row takes part."""
        return tuple(episode for episode in self if row in episode.robots)

    def of_kind(self, kind: str) -> tuple[Episode, ...]:
        """Return the episodes of one kind."""
        check_choice("kind", kind, KINDS)
        return tuple(episode for episode in self if episode.kind == kind)


def find_pathologies(
    *,
    steps: np.ndarray,
    position: np.ndarray,
    heading: np.ndarray,
    command: np.ndarray,
    layer: np.ndarray,
    distance: np.ndarray,
    kind: np.ndarray,
    radius: np.ndarray,
    max_speed: np.ndarray,
    forward: np.ndarray,
    near: float = 20.0,
    window: int = 60,
    fewest_flips: int = 10,
    fewest_steps: int = 30,
    slow_share: float = 0.2,
    turned_degrees: float = 60.0,
    stuck_share: float = 0.1,
    forward_share: float = 0.25,
    facing_degrees: float = 30.0,
    gap: float = 5.0,
) -> Pathologies:
    """Find the episodes in which robots get nowhere.

    Let (m_L, m_R) be a robot's command. It *turns* left or right as m_R - m_L is above or below 0; its turn *flips*
    in a step if the last turn before was to the other side.

    =============================  ===================================================================================
    kind                           what it is
    =============================  ===================================================================================
    corridor flip                  the turn flips, both this turn and the one before it are away from something nearer
                                   than `near`, and one of them at least from an obstacle, fire or load: turning left,
                                   the right or the front sensor reads it; turning right, the left or the front one
    centroid flip                  the turn flips, some sensor sees a robot at both turns, other sensors do than at the
                                   turn before, and neither turn is away from a robot nearer than `near` that only
                                   the sensor of the other side reads
    head-on pair                   two robots whose rims are at most `gap` apart, each within `facing_degrees` of the
                                   other's heading, both commanded to drive forwards or to turn, and slow
    back-and-forth at a threshold  m_L + m_R flips its sign
    stuck                          commanded forwards, (m_L + m_R) / 2 >= `forward_share` of `max_speed`, without moving
    =============================  ===================================================================================

    *Flips* make an episode where `fewest_flips` of one kind in a row come within `window` steps and the robot gets
    nowhere from the first to the last of them: its displacement is below its radius, and below `slow_share` of what
    max_speed would do in that time, and its heading changes by less than `turned_degrees`. (A robot that turns round
    in a blind alley flips too, but turns away.)

    *Head-on pairs* and *stuck* robots last at least `fewest_steps`. Slow is who is displaced, in `fewest_steps` of
    such commands, by less than `stuck_share` of what max_speed would do. Without moving means that in `fewest_steps`
    of such commands both the displacement and the way along the headings are below `stuck_share` of what was commanded.

    Stretches of a kind that overlap or follow each other at once are one episode; of the first two kinds, without the
    steps in which the robot gets farther than its radius within `window` steps, and only if `fewest_flips` are left. A
    robot's step belongs to one kind: what the kinds above have taken is not there for those below.

    Parameters
    ----------
    steps : ndarray, shape (k,)
        Consecutive.
    position, heading : ndarrays, shape (k, n, 2) and (k, n), rad
        After each step.
    command, layer : ndarrays, shape (k, n, 2) and (k, n)
        Rim speeds left and right, and the layer that chose them, of each step.
    distance, kind : ndarrays, shape (k, n, s)
        What each step was decided on: -1 for nothing; 0 obstacle, 1 robot, 2 fire, 3 load.
    radius, max_speed : ndarrays, shape (n,)
    forward : ndarray, shape (n, 3)
        Index of the front, left and right sensors, -1 for none.
    near, gap : float
        Map units, at least 0.
    window, fewest_flips, fewest_steps : int
        At least 2.
    slow_share, stuck_share, forward_share : float
        Above 0, at most 1.
    turned_degrees, facing_degrees : float
        0 to 180.

    Returns
    -------
    Pathologies

    Raises
    ------
    InvalidValueError
        If an array has another shape, steps are missing, or a parameter is out of its range.

    Examples
    --------
    A robot without sensors that is commanded forwards and does not move:

    >>> k, still = 40, np.zeros((40, 1))
    >>> found = find_pathologies(
    ...     steps=np.arange(k), position=np.zeros((k, 1, 2)), heading=still, command=np.ones((k, 1, 2)),
    ...     layer=still, distance=np.empty((k, 1, 0)), kind=np.empty((k, 1, 0)), radius=[5], max_speed=[1],
    ...     forward=[[-1, -1, -1]],
    ... )
    >>> found[0].describe()
    'Robot 0 drove and did not move, in steps 1 to 39 (layer 0).'
    """
    limits = Thresholds(
        near=near, window=window, fewest_flips=fewest_flips, fewest_steps=fewest_steps, slow_share=slow_share,
        turned_degrees=turned_degrees,
        stuck_share=stuck_share, forward_share=forward_share, facing_degrees=facing_degrees, gap=gap,
    )  # fmt: skip
    track = Track.of(
        steps=steps, position=position, heading=heading, command=command, layer=layer, distance=distance, kind=kind,
        radius=radius, max_speed=max_speed, forward=forward,
    )  # fmt: skip
    taken = np.zeros(track.heading.shape, bool)
    episodes = []
    for name, (finder, _) in FINDERS.items():
        found = finder(track, limits, taken)
        episodes += [_episode(name, track, *episode) for episode in found]
        for robots, first, last, _ in found:
            taken[first : last + 1, robots] = True
    return Pathologies(tuple(sorted(episodes, key=_order)))


def _episode(kind: str, track: Track, robots: tuple[int, ...], first: int, last: int, flips: int) -> Episode:
    layers = np.unique(track.layer[first : last + 1, robots])
    return Episode(
        kind=kind,
        robots=robots,
        first_step=int(track.steps[first]),
        last_step=int(track.steps[last]),
        flips=flips,
        layers=tuple(layers.tolist()),
    )


def _order(episode: Episode) -> tuple:
    return episode.first_step, KINDS.index(episode.kind), episode.robots
