"""Fire-fighting: robots extinguish seven fires, the largest of which needs more than one robot.

WHAT IS IT? A task shared by robots, by default without communication. A robot at a fire cools it, and is heated
by it; too hot, it must leave until it has cooled down. One robot alone cannot extinguish the large central fire.

HOW IT WORKS. Layers: Avoid, FightFire, Explore. Under strategy A a robot that is too hot turns away and explores,
ignoring all fires. Under strategy B it backs off until it takes no more heat, waits, and returns to the same fire.
The fires follow T <- T + k1 (T + 1) - (k2 / A) n, the robots H <- H + k3 T A - k4.

HOW TO USE IT. k1 is the growth of fires, k2 extinguishing, k3 heating of robots, k4 their cooling; `leave` and `join`
are the heats at which a robot leaves and may return. `design_constants` computes all six from requirements. With
communication robots within range go to one that is at a fire (state), or to the fire that it sees (goal). With `follow`
they follow robots ahead; with `choice` they go to the hottest fire that they feel; with `spread` fires ignite others.

THINGS TO NOTICE. Under B robots gather at the large fire without being called: waiting near it is enough.
Under A they leave one after the other, and the fire recovers between their visits, unless they call for help.

THINGS TO TRY. Fires that start at T = 0.3 fall to their first visitor. With how many robots is A as good as B? Where
no fire falls to a single robot, by `design_constants(areas=model.fires.area, robots=17, alone=False)`, with 30 robots?

EXTENDING IT. Let exploring robots prefer places that they have not visited.

REFERENCE. Thesis, chapter 9, appendix B. Communication as in Balch and Arkin, Autonomous Robots 1 (1994).
"""

from typing import Annotated

from mesa_swarm import AGENT_FIRE, AGENT_HEAT, Choice, Radio, Seed, Slider, SwarmModel, count, until_zero
from mesa_swarm.control import Avoid, Explore, Follow, Respond, Subsumption
from mesa_swarm.control.respond import TO
from mesa_swarm.errors import InvalidValueError, check_choice, check_count, check_number
from mesa_swarm.fire import FightFire, FireConstants, SeekHeat, Spreading, design_constants

DEFAULT = design_constants()
# Under A a hot robot flees fires; under B it waits in front of one.
FLEES = {"A": "when hot", "B": "never"}
DESIGNS = {"nearest": AGENT_FIRE, "hottest": AGENT_HEAT}
FARTHEST = 1000.0


class FireFighting(SwarmModel):
    """Robots that put out fires with strategy A or B.

    Stops running when all fires are out.

    Examples
    --------
    >>> FireFighting(strategy="A", rng=1).run(10).results()["fires out"]
    0
    """

    compares = "strategy", ("A", "B")
    steps_to_compare = 15_000
    headline = "all fires out at", "put out all fires"
    fires_burning = count("fires.out", equals=False)
    robots_at_fires = count("fire", at_least=0)
    stops = until_zero("fires_burning")

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 50, 1, "robots")] = 10,
        strategy: Annotated[str, Choice(("A", "B"), "what a hot robot does: A leaves, B waits nearby")] = "B",
        map: Annotated[str, Choice(("openspace_fire",), "walls and obstacles")] = "openspace_fire",
        k1: Annotated[float, Slider(0.0001, 0.003, 0.0001, "growth of fires per step")] = DEFAULT.k1,
        k2: Annotated[float, Slider(0.001, 0.05, 0.001, "extinguishing per robot and step, over area")] = DEFAULT.k2,
        k3: Annotated[float, Slider(0.0, 0.5, 0.001, "heating of robots per step, times T times area")] = DEFAULT.k3,
        k4: Annotated[float, Slider(0.0, 2.0, 0.01, "cooling of robots per step")] = DEFAULT.k4,
        leave: Annotated[float, Slider(1, 1000, 1, "heat at which a robot leaves")] = DEFAULT.leave,
        join: Annotated[float, Slider(0, 999, 1, "heat down to which it cools before it fights again")] = DEFAULT.join,
        communication: Annotated[str, Choice(("none", *TO), "what robots at fires broadcast")] = "none",
        communication_range: Annotated[float, Slider(0, FARTHEST, 10, "range of broadcasts, map units")] = 200.0,
        follow: Annotated[str, Choice(("off", "on"), "whether robots follow the nearest robot ahead")] = "off",
        choice: Annotated[str, Choice(tuple(DESIGNS), "the fire that a robot goes to")] = "nearest",
        spread: Annotated[float, Slider(0, 0.01, 0.0001, "probability of a spark per step, of a fire at T = 1")] = 0.0,
        initial_temperature: Annotated[float, Slider(0.01, 1, 0.01, "temperature of all fires at the start")] = 1.0,
        history_every: Annotated[int, Slider(1, 100, 1, "steps between rows of the fires' history")] = 10,
        rng: Seed = None,
    ) -> None:
        reporters = {"fires_burning": "fires_burning", "robots_at_fires": "robots_at_fires"}
        super().__init__(map=map, rng=rng, history_every=history_every, model_reporters=reporters)
        self.fire_constants = FireConstants(k1, k2, k3, k4, leave, join)
        if not len(self.fires):
            raise InvalidValueError(f"map {self.map.name} has no fires; choose one with fires, such as openspace_fire")
        for fire in self.fires:
            fire.temperature = initial_temperature
        if check_number("spread", spread, minimum=0, maximum=1):
            self.add_process(Spreading(rate=spread))
        self.add_robots(DESIGNS[check_choice("choice", choice, DESIGNS)], check_count("n_robots", n_robots))
        seeks = (SeekHeat(),) if choice == "hottest" else ()
        reach = check_number("communication_range", communication_range, minimum=0, maximum=FARTHEST)
        if check_choice("communication", communication, ("none", *TO)) != "none":
            self.communication = Radio(range=reach, state=communication == "state", goal=communication == "goal")
        helps = () if self.communication is None else (Respond(to=communication),)
        follows = (Follow(gap=None, cruise_speed=1.0),) * (check_choice("follow", follow, ("off", "on")) == "on")
        fights = *seeks, FightFire(strategy=strategy), *helps, *follows
        self.control = Subsumption(Avoid(fires=FLEES[check_choice("strategy", strategy, FLEES)]), *fights, Explore())

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: fires out, and the step at which each and all were out, or None."""
        last = int(self.fires.out_step.max()) if len(self.fires) and self.fires.out.all() else None
        spreads = any(isinstance(process, Spreading) for process in self.processes)
        times = self.fires.times_out(len(self.map.fires) if spreads else None)
        return {"fires out": int(self.fires.out.sum()), **times, "all fires out at": last}
