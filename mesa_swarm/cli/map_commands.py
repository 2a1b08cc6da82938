"""What the commands `map import` and `map show` do with what was typed."""

from pathlib import Path

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.files import checked_file, write_whole
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.pictures import png, world_figure
from mesa_swarm.world.map import Map

MOST_AREAS = 12


def import_map(file: str, out: Path | None, force: bool) -> None:
    """Read a map and write it in another format."""
    world = Map.load(file)
    target = Path(f"{Path(file).stem}.toml") if out is None else out
    if target.exists() and not force:
        raise InvalidValueError(f"{target} exists already; choose another name or add --force")
    world.save(target)
    print(described(world))
    print(target)


def show_map(file: str, out: Path | None) -> None:
    """Print what is on a map, and draw it if asked."""
    world = Map.load(file)
    if out is not None:
        checked_file(out, ".png")
    print(described(world))
    if out is not None:
        print(write_whole(out, png(world_figure({world.name: SwarmModel(map=world, rng=1)}))))


def described(world: Map) -> str:
    """Return a map's name, size, and how many there are of everything, on five lines.

    Examples
    --------
    >>> print(described(Map.load("openspace_fire")))
    name          openspace_fire
    size          800 x 600
    obstacles     4 (4 rectangles)
    ground marks  0
    fires         7 (areas 2.25, 16, 4, 2.89, 1.69, 2.25, 2.89)
    """
    solid = [shape.kind for shape in world.obstacles if shape.contact]
    facts = {
        "name": world.name,
        "size": f"{world.width:g} x {world.height:g}",
        "obstacles": f"{len(solid)}{_kinds(solid)}",
        "ground marks": len(world.obstacles) - len(solid),
        "fires": f"{len(world.fires)}{_areas(world)}",
    }
    return "\n".join(f"{name:12}  {fact}" for name, fact in facts.items())


def _kinds(solid: list[str]) -> str:
    counts = {kind: solid.count(kind) for kind in ("disc", "rectangle", "polygon") if kind in solid}
    words = [f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in counts.items()]
    return f" ({', '.join(words)})" if words else ""


def _areas(world: Map) -> str:
    areas = [f"{fire.area:.3g}" for fire in world.fires]
    shown = [*areas[:MOST_AREAS], *(["..."] if len(areas) > MOST_AREAS else [])]
    return f" (areas {', '.join(shown)})" if areas else ""
