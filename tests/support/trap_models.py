"""A small model in a module of its own, which mesa.batch_run and sweep both take."""

from mesa_swarm.robots.design import AGENT3
from mesa_swarm.swarm_model import SwarmModel


class Counted(SwarmModel):
    """Its description has the number of its steps and where its robot stands."""

    def __init__(self, *, odd: float = 0.0, rng=None) -> None:
        super().__init__(rng=rng, model_reporters={"taken": "completed", "place": "place"})
        self.odd = odd
        self.add_robots(AGENT3, 1)

    @property
    def place(self) -> float:
        """The first coordinate of the robot."""
        return float(self.swarm.position[0, 0])

    def results(self) -> dict[str, float]:
        """Return the steps and the place."""
        return {"taken": self.completed, "place": self.place}
