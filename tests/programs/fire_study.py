"""Fire-fighting, written against version 0.1.0: designed constants, paired seeds, a sweep, Mesa's own runs."""

import inspect
import tempfile

import mesa
import numpy as np

from mesa_swarm import AGENT_FIRE, SwarmModel, compare, disc, sweep
from mesa_swarm.analysis import clusters, coverage, nearest_neighbour_distances, polarization
from mesa_swarm.control import Avoid, Explore, Follow, Gather, Subsumption
from mesa_swarm.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.run_pictures import ethogram, trace
from mesa_swarm.fire import FightFire, FireConstants, design_constants
from mesa_swarm.fire.constants import robots_needed
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.parameters import parameters_of
from mesa_swarm.reporters import held


class CrowdedFires(SwarmModel):
    """A model of a user: positional scenery, flat keyword parameters, results."""

    def __init__(self, *, n_robots: int = 12, strategy: str = "B", history_every: int = 5, rng=None) -> None:
        constants = design_constants(growth_time=1500, robots=3, extinguish_time=900, area=9, largest_area=9)
        super().__init__(
            map="openspace",
            rng=rng,
            fire_constants=constants,
            history_every=history_every,
            model_reporters={**held("burning", every=20), "hot": lambda model: int(model.swarm.hot.sum())},
        )
        self.add_fire((500, 300), radius=30, temperature=0.6)
        self.add_fire((250, 250), area=4.0)
        self.add_obstacle(disc((380, 300), 25))
        self.add_robots(AGENT_FIRE, n_robots)
        avoid = Avoid(distance=12, fires="when hot" if strategy == "A" else "never")
        self.control = Subsumption(avoid, FightFire(strategy=strategy), Explore())

    @property
    def burning(self) -> int:
        return int((~self.fires.out).sum())

    def results(self) -> dict:
        return {"fires out": float(self.fires.out.sum()), "collisions": float(self.total_collisions)}


def main() -> None:
    constants = design_constants(growth_time=1500, robots=2, extinguish_time=900)
    by_hand = FireConstants(k1=0.001, k2=0.02, k3=0.08, k4=0.25, leave=250, join=150)
    print("constants", [round(getattr(constants, name), 6) for name in ("k1", "k2", "k3", "k4", "leave", "join")])
    print("needed", round(robots_needed(constants, area=16), 4), by_hand.join, len(constants.remarks) > 0)

    model = FireFighting(n_robots=8, strategy="A", map="openspace_fire", rng=4)
    model.collect_every = model.fires.history.every = 50
    model.run(200, progress=False)
    print("fire_fighting", model.steps, model.running, model.state_hash())
    print("history", model.fires.history.steps.tolist(), model.fires.history.temperature.round(4)[-1].tolist())
    print("collected", model.datacollector.model_vars["collisions"], list(parameters_of(FireFighting))[:3])
    position = np.asarray(model.swarm.position)
    groups = clusters(position, 60.0)
    print("analysis", groups.count, groups.grouped, round(float(polarization(model.swarm.heading)), 9))
    print("distances", nearest_neighbour_distances(position).round(6).tolist()[:3])

    crowd = CrowdedFires(n_robots=9, rng=np.random.SeedSequence(7))
    kept = crowd.watch(last=40, every=5, columns=("position", "layer", "fire"))
    crowd.run(120)
    crowd.robots[0].remove()
    crowd.fires[1].temperature = 0.25
    crowd.run(30)
    print("crowd", len(crowd.robots), kept.steps.tolist(), kept["position"].shape, crowd.state_hash())
    print("burning", crowd.datacollector.model_vars["burning"][::50], crowd.results())
    print("covered", round(coverage(kept["position"], np.ones((15, 20), bool), crowd.map.bounds), 9))

    gathered = SwarmModel(map="sparse", rng=3, engine="shapely")
    gathered.add_robots(AGENT_FIRE, 3)
    gathered.control = Subsumption(Avoid(), Follow(), Gather(), Explore())
    print("shapely", gathered.run(5).state_hash())

    found = compare(CrowdedFires, "strategy", ["A", "B"], 3, steps=120, settings={"n_robots": 20}, jobs=1)
    print("compare", {value: found.column(value, "collisions") for value in ("A", "B")}, len(found.table()) > 100)
    with tempfile.TemporaryDirectory() as folder:
        made = sweep("fire_fighting", {"n_robots": [3, 5]}, seeds=[1, 2], steps=40, out=folder, jobs=1)
        frame = made.frame()
        print("sweep", made.runs, made.failed, frame["n_robots"].tolist(), frame["rng"].tolist(), frame["steps"].sum())

    again = {"rng": [1, 2]} if "rng" in inspect.signature(mesa.batch_run).parameters else {"iterations": 2}
    rows = mesa.batch_run(CrowdedFires, {"n_robots": [2, 4]}, max_steps=20, display_progress=False, **again)
    print("batch_run", len(rows), sorted(row["n_robots"] for row in rows), int(rows[0]["Step"]))

    watched = FireFighting(n_robots=3, rng=1)
    watched.watch(last=None)
    print("pictures", len(trace(FireFighting(n_robots=3, rng=1), 50).axes), len(ethogram(watched.run(50)).axes))
    try:
        SwarmModel(rng=1, history_every=-1)
    except InvalidValueError as error:
        print("refused", isinstance(error, (SwarmError, ValueError)), "history_every" in str(error))


if __name__ == "__main__":
    main()
