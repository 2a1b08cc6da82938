"""Collision avoidance: robots that explore and turn away from near bodies.

WHAT IS IT? Robots drive straight on until one of their three forward infrared sensors detects a near body;
then they turn away. It is the simplest behaviour of the thesis, and the top layer of all others.

HOW IT WORKS. Two layers; the first active layer drives: Avoid (left sensor activated: turn right; right: turn
left; front: turn to the robot's preferred side) and Explore (straight on, with optional random turns at intervals).
With a `spot_distance` there is a layer above them: Avoid on the spot, for bodies nearer than that.

HOW TO USE IT. `distance` is the range of Avoid. `turn` stops one wheel ("translational") or turns on the spot
("stationary"). `turn_interval` is the number of steps between random turns. The design WIDE3 senses the full front.
E_PUCK, KILOBOT and other real robots are 10 units wide too; pictures show how many metres and seconds that makes.

THINGS TO NOTICE. Robots that turn on the spot swing to and fro for ever in a corridor that activates both
their sides; those that turn with one wheel stopped get out. A single robot does not reach parts of the map.

THINGS TO TRY. Obstacles at random places, some of which move; more robots; random turns; a distance larger than the
corridors. One robot, with slip and sensor errors and without: why does it visit more of the map with them?

EXTENDING IT. Put a custom rule between the layers with `behaviour`.

REFERENCE. Thesis, sections 5.2.2 and 5.3.1.
"""

from dataclasses import replace
from typing import Annotated

from mesa_swarm import (
    AGENT3,
    AGENT6,
    AGENT9,
    REAL_ROBOTS,
    Choice,
    ProximitySensor,
    RobotDesign,
    Seed,
    Slider,
    SwarmModel,
    scatter,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import check_choice, check_count

WIDE3 = RobotDesign(
    name="WIDE3", sensors=tuple(ProximitySensor(bearing_degrees=b, field_of_view_degrees=60) for b in (0, 60, -60))
)
DESIGNS = {"AGENT3": AGENT3, "AGENT6": AGENT6, "AGENT9": AGENT9, "WIDE3": WIDE3}
DESIGNS |= {name: robot.design() for name, robot in REAL_ROBOTS.items()}


class CollisionAvoidance(SwarmModel):
    """Robots that explore a map and avoid obstacles and each other.

    Examples
    --------
    >>> CollisionAvoidance(n_robots=3, rng=1).run(5).steps
    5
    """

    compares = "turn", ("translational", "stationary")
    steps_to_compare = 3_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 200, 1, "robots")] = 10,
        design: Annotated[str, Choice(tuple(DESIGNS), "the robots' bodies and sensors")] = "AGENT9",
        distance: Annotated[float, Slider(0, 50, 1, "distance below which robots turn away, map units")] = 15.0,
        turn: Annotated[str, Choice(("translational", "stationary"), "how robots turn away")] = "translational",
        front: Annotated[
            str, Choice(("tendency", "random", "back up"), "what something ahead makes it do")
        ] = "tendency",
        sides: Annotated[str, Choice(("last", "ignore both"), "which of two activated sides counts")] = "last",
        spot_distance: Annotated[
            float, Slider(0, 20, 0.5, "distance below which robots turn on the spot, map units")
        ] = 0.0,
        max_speed: Annotated[float, Slider(0.1, 5, 0.1, "maximum wheel speed, map units per step")] = 1.0,
        turn_interval: Annotated[int, Slider(0, 1000, 10, "steps between random turns, 0 for none")] = 0,
        slip_probability: Annotated[float, Slider(0, 1, 0.01, "probability of slip, per wheel and step")] = 0.0,
        error_probability: Annotated[float, Slider(0, 1, 0.01, "probability of an error, per sensor and step")] = 0.0,
        map: Annotated[str, Choice(("original", "sparse", "openspace"), "walls and obstacles")] = "original",
        obstacles: Annotated[int, Slider(0, 50, 1, "obstacles at random places besides those of the map")] = 0,
        moving_obstacles: Annotated[int, Slider(0, 20, 1, "further obstacles, which move")] = 0,
        obstacle_speed: Annotated[float, Slider(0.1, 2, 0.1, "speed of obstacles that move, map units per step")] = 0.5,
        rng: Seed = None,
    ) -> None:
        real = REAL_ROBOTS.get(check_choice("design", design, DESIGNS))
        super().__init__(map=map, rng=rng, scale=None if real is None else real.scale)
        robot_design = replace(DESIGNS[design], max_speed=max_speed)
        robot_design = robot_design.with_proximity(error_probability=error_probability, error_magnitude=0.2)
        robot_design = robot_design.with_slip(probability=slip_probability, magnitude=0.5)
        scatter(self, check_count("obstacles", obstacles))
        scatter(self, check_count("moving_obstacles", moving_obstacles), speed=obstacle_speed)
        self.add_robots(robot_design, check_count("n_robots", n_robots))
        spot = (Avoid(distance=spot_distance, turn="stationary", name="AvoidOnTheSpot"),) if spot_distance else ()
        avoid = Avoid(distance=distance, turn=turn, front=front, sides=sides)
        self.control = Subsumption(*spot, avoid, Explore(turn_interval=turn_interval))

    def results(self) -> dict[str, float]:
        """Return the measure used by a comparison: collisions per robot and 1,000 steps."""
        return {"collisions per robot and 1,000 steps": 1000.0 * self.total_collisions / max(self.robot_steps, 1)}
