"""Figures D.1 to D.4: the thesis's maps."""

import numpy as np

from mesa_swarm import Map, Shape, SwarmModel
from mesa_swarm_studies.drawing import world_picture
from mesa_swarm_studies.judging import PASSED, UNDECIDED, Check, Result, judged_fact, judged_number
from mesa_swarm_studies.laboratory import Laboratory
from mesa_swarm_studies.registry import Item

WIDTH, HEIGHT = 800, 600
WALL = 20.0
# Listing 4.1, y downwards: corners of rectangles; centre and radius of discs.
RECTANGLES = (
    (0, 0, 20, 600), (0, 0, 800, 20), (780, 0, 800, 600), (0, 580, 800, 600), (70, 70, 110, 530),
    (110, 280, 400, 320), (220, 0, 260, 150), (480, 0, 520, 500),
)  # fmt: skip
DISCS = ((650, 160, 30), (650, 360, 30), (300, 450, 50))
LISTED = {"original": len(RECTANGLES) + len(DISCS)}
FIRES = 7


def boxes(shapes: tuple[Shape, ...]) -> set[tuple[float, ...]]:
    """Return each shape as in the listing, with y upwards, rounded."""
    return {tuple(round(value, 6) for value in shape.bounds) for shape in shapes}


def listed_boxes() -> set[tuple[float, ...]]:
    """Return the bounds of all shapes of the listing, with y upwards."""
    rectangles = [(a, HEIGHT - d, c, HEIGHT - b) for a, b, c, d in RECTANGLES]
    discs = [(x - r, HEIGHT - y - r, x + r, HEIGHT - y + r) for x, y, r in DISCS]
    return {tuple(round(float(value), 6) for value in box) for box in (*rectangles, *discs)}


def original(laboratory: Laboratory) -> Result:
    """Make figure D.1: the map whose every number the thesis lists."""
    drawn = Map.load("original")
    discs = sum(shape.is_disc for shape in drawn.obstacles)
    same = boxes(drawn.obstacles) & listed_boxes()
    checks = (
        judged_number(
            "obstacles as in Listing 4.1", f"{LISTED['original']}", len(same), low=LISTED["original"],
            high=len(drawn.obstacles),
        ),
        judged_fact("three discs among them", "3", discs == len(DISCS), measured=str(discs)),
    )  # fmt: skip
    return result_of(drawn, checks)


def sparse(laboratory: Laboratory) -> Result:
    """Make figure D.2: the map of low complexity."""
    drawn = Map.load("sparse")
    kinds = {shape.kind for shape in inside(drawn)}
    covered = [share_covered(Map.load(name)) for name in ("openspace", "sparse", "original")]
    checks = (
        judged_fact(
            "covered area between those of original and openspace",
            "low complexity",
            covered[0] < covered[1] < covered[2],
            measured=", ".join(f"{100 * share:.1f} %" for share in covered),
        ),
        judged_fact(
            "rectangles and discs",
            "rectangles and discs",
            kinds == {"rectangle", "disc"},
            measured=", ".join(sorted(kinds)),
        ),
        judged_fact(
            "the text's other name, maze, loads it too",
            "maze.map",
            boxes(Map.load("maze").obstacles) == boxes(drawn.obstacles),
            measured="the same map",
            main=False,
        ),
        numbers_known(drawn),
    )
    return result_of(drawn, checks)


def openspace(laboratory: Laboratory) -> Result:
    """Make figure D.3: four walls."""
    drawn = Map.load("openspace")
    count = len(inside(drawn))
    checks = (four_walls(drawn), judged_fact("no obstacle within them", "nothing", count == 0, measured=str(count)))
    return result_of(drawn, checks)


def openspace_fire(laboratory: Laboratory) -> Result:
    """Make figure D.4: four walls and seven fires."""
    drawn = Map.load("openspace_fire")
    radii = np.array([fire.radius for fire in drawn.fires])
    centre = np.hypot(*(np.asarray(drawn.fires[1].position) - (WIDTH / 2, HEIGHT / 2)))
    checks = (
        four_walls(drawn),
        judged_fact("seven fires", "7", len(radii) == FIRES, measured=str(len(radii))),
        judged_fact(
            "the second is the largest", "a large central one", int(radii.argmax()) == 1,
            measured=f"radius {radii[1]:g}, others at most {np.delete(radii, 1).max():g}",
        ),
        judged_number("it is central: distance from the centre", "central", float(centre), high=WALL),
        numbers_known(drawn),
    )  # fmt: skip
    return result_of(drawn, checks)


def four_walls(drawn: Map) -> Check:
    """Judge whether the border of a map is walled."""
    walls = {tuple(round(float(v), 6) for v in (a, HEIGHT - d, c, HEIGHT - b)) for a, b, c, d in RECTANGLES[:4]}
    count = len(walls & boxes(drawn.obstacles))
    return judged_fact("four walls", "4", count == 4, measured=str(count))


def numbers_known(drawn: Map) -> Check:
    """Return that other parts cannot be compared, where the thesis prints a picture and no numbers."""
    parts = len(inside(drawn)) + len(drawn.fires)
    known = max(LISTED.get(drawn.name, 0) - 4, 0)
    return Check(
        claim="every part is positioned as in the thesis",
        reported="a picture, no numbers",
        measured=f"{known} of {parts} parts can be compared; the map was redrawn",
        criterion="all can be compared",
        outcome=PASSED if known == parts else UNDECIDED,
        main=False,
    )


def inside(drawn: Map) -> list[Shape]:
    """Return the obstacles without the walls at the border."""
    walls = {(0.0, 0.0), (WIDTH, HEIGHT)}
    return [s for s in drawn.obstacles if not {s.bounds[:2], s.bounds[2:]} & walls or s.is_disc]


def share_covered(drawn: Map) -> float:
    """Return the share of the map within its walls that obstacles cover."""
    covered = sum(np.pi * s.radius**2 if s.is_disc else s.geometry.area for s in inside(drawn))
    return float(covered / ((WIDTH - 2 * WALL) * (HEIGHT - 2 * WALL)))


def result_of(drawn: Map, checks: tuple[Check, ...]) -> Result:
    """Return the result of a map, with the checks that all of them share."""
    again = Map.from_svg(drawn.to_svg())
    from_svg = judged_fact(
        "its SVG is the same map",
        "each with its .svg source",
        boxes(again.obstacles) == boxes(drawn.obstacles) and len(again.fires) == len(drawn.fires),
        measured=f"{len(again.obstacles)} obstacles, {len(again.fires)} fires",
    )
    size = judged_fact(
        "800 x 600",
        "800 x 600",
        (drawn.width, drawn.height) == (WIDTH, HEIGHT),
        measured=f"{drawn.width:g} x {drawn.height:g}",
    )
    return Result(
        checks=(size, *checks, from_svg),
        pictures={"": world_picture(SwarmModel(map=drawn, rng=1), drawn.name)},
        settings=f"`Map.load({drawn.name!r})`",
    )


ITEMS = (
    Item(figure="D.1", title="map original", section="D.2, Listing 4.1", make=original),
    Item(figure="D.2", title="map sparse", section="D.2", make=sparse),
    Item(figure="D.3", title="map openspace", section="D.2", make=openspace),
    Item(figure="D.4", title="map openspace_fire", section="D.2", make=openspace_fire),
)
