"""What the command diagnose does with what was typed."""

from collections.abc import Sequence

from mesa_swarm.analysis.pathology import Pathologies
from mesa_swarm.cli.commands import print_pairs
from mesa_swarm.experiments.diagnosis import NEEDED, check_wheels, pathologies_of
from mesa_swarm.gallery import find_model
from mesa_swarm.parameters import parsed_settings

MOST_TOLD = 20


def diagnose(model: str, settings: Sequence[str], *, steps: int, rng: int, progress: bool) -> None:
    """Run a model, and print where robots got nowhere: how often of each kind, and the longest episodes."""
    model_class = find_model(model)
    built = model_class(**parsed_settings(model_class, settings), rng=rng)
    check_wheels(built)
    built.watch(last=None, columns=NEEDED)
    found = pathologies_of(built.run(steps, progress=progress))
    layers = ", ".join(f"{index} {layer.name}" for index, layer in enumerate(built.control.layers))
    print_pairs({"steps": built.steps, "robots": len(built.swarm), "layers": layers, **found.counts()})
    print("\n".join(["", *told(found, [robot.unique_id for robot in built.robots])]))


def told(found: Pathologies, ids: Sequence[int]) -> list[str]:
    """Return the episodes as sentences, the longest first, at most 20; robots are told by their unique_id.

    Parameters
    ----------
    found : Pathologies
    ids : sequence of int, length n
        The unique_id of each row.

    Examples
    --------
    >>> from mesa_swarm.analysis.pathology import Episode
    >>> told(Pathologies((Episode(kind="stuck", robots=(0,), first_step=10, last_step=49),)), [7])
    ['Robot 7 drove and did not move, in steps 10 to 49.']
    """
    longest = sorted(found, key=lambda episode: -episode.steps)
    sentences = [episode.describe(ids) for episode in longest[:MOST_TOLD]] or ["No pathology was found."]
    more = len(longest) - MOST_TOLD
    return [*sentences, f"... and {more} more, none of them longer."] if more > 0 else sentences
