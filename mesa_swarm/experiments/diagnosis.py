"""What a watched model shows of behaviour that gets nowhere."""

from mesa_swarm.analysis.pathology import Pathologies, find_pathologies
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.model import SwarmModel
from mesa_swarm.robots.snapshots import check_kept

NEEDED = ("position", "heading", "command", "layer", "distance", "kind")


def pathologies_of(model: SwarmModel) -> Pathologies:
    """Find the episodes in which robots got nowhere, in the steps that `model.watch()` has kept.

    Parameters
    ----------
    model : SwarmModel
        Watched with ``every=1``; with ``last=None`` no step is lost.

    Returns
    -------
    Pathologies
        Its rows are those of `model.swarm`; see `analysis.find_pathologies` for what counts.

    Raises
    ------
    InvalidValueError
        If nothing was kept, columns are missing, steps were left out, or robots have a drive whose commands are
        not the speeds of wheels left and right.

    Examples
    --------
    >>> from mesa_swarm.gallery import find_model
    >>> model = find_model("collision_avoidance")(n_robots=3, rng=1)
    >>> kept = model.watch(last=None)
    >>> len(pathologies_of(model.run(100)))
    0
    """
    swarm, kept = model.swarm, check_kept(model.watched, NEEDED, "diagnose", "watch(last=None)")
    if kept.every != 1:
        raise InvalidValueError(f"every {kept.every}th step was kept; expected all of them: watch with every=1")
    check_wheels(model)
    return find_pathologies(
        steps=kept.steps,
        position=kept["position"],
        heading=kept["heading"],
        command=kept["command"],
        layer=kept["layer"],
        distance=kept["distance"],
        kind=kept["kind"],
        radius=swarm.radius,
        max_speed=swarm.max_speed,
        forward=swarm.table.forward[swarm.design],
    )


def check_wheels(model: SwarmModel) -> None:
    """Refuse a model with robots whose commands are not the speeds of wheels left and right.

    Raises
    ------
    InvalidValueError
    """
    for design in model.swarm.designs:
        if not design.turns:
            raise InvalidValueError(
                f"robots of the design {design.name} have no wheels left and right; diagnose those that have"
            )
