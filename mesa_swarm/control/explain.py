"""Why a robot did what it did: the reason that its winning layer gives."""

from dataclasses import dataclass

import numpy as np

from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.control.layer import Layer
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.snapshots import Snapshots
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import KINDS


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a robot did what it did in one step; as a text it is one sentence.

    `layer` is "" if none was active; `does` is the command in words, such as "turns right while moving"; `sensors` are
    the proximity sensors that triggered the layer.
    """

    robot: int
    step: int
    layer: str
    does: str
    reason: str
    sensors: tuple[int, ...]

    def __str__(self) -> str:
        start = f"step {self.step:,}: robot {self.robot} {self.does}"
        return f"{start}; {self.layer}: {self.reason}" if self.layer else f"{start}; no layer was active"


def explanation(
    control: Arbiter, swarm: Swarm, snapshots: Snapshots, row: int, step: int, kinds: tuple[str, ...] = KINDS
) -> Explanation:
    """Return why the robot in this row did what it did in a stored step, when this control drove it."""
    moment, winner = moment_of(swarm, snapshots.at(step), row, kinds)
    if winner >= len(control.layers):
        raise BehaviourError(
            f"layer {winner} drove robot {swarm.agents[row].unique_id} in step {step:,}, of {len(control.layers)} "
            "layers; a custom layer must write the index that `decide` is given"
        )
    layer = control.layers[winner] if winner >= 0 else None
    reason = Reason("") if layer is None else reason_of(layer, moment)
    if winner >= 0:
        reason = control.arbiter_of(winner).explain(reason, moment.columns)
    if layer is not None and control.arbiter_of(winner).sums:
        # What the robot did is the sum of all that were active; the reason is that of one of them.
        detail = f" ({reason.words})" if reason.sensors else ""
        reason = Reason(f"its share of the sum of all active layers is the largest{detail}", reason.sensors)
    return Explanation(
        robot=swarm.agents[row].unique_id,
        step=step,
        layer="" if layer is None else control.names[winner],
        does=moment.motion,
        reason=reason.words,
        sensors=reason.sensors,
    )


def moment_of(
    swarm: Swarm, columns: dict[str, np.ndarray], row: int, kinds: tuple[str, ...] = KINDS
) -> tuple[Moment, int]:
    """Return what one robot knew, where bodies are of these kinds, and which layer won."""
    table, d = swarm.table, swarm.columns["design"][row]
    design = swarm.designs[d]
    command = columns["command"][row, : design.numbers]
    front, left, right = (int(index) for index in table.forward[d])
    sensors = table.counts[d]
    moment = Moment(
        distance=columns["distance"][row, :sensors],
        kind=columns["kind"][row, :sensors],
        sensors=table.proximity[d, :sensors],
        bearing=table.bearing[d, :sensors],
        forward=(front, left, right),
        command=command,
        turns=bool(design.turns),
        moved=_motion_of(design, command),
        columns={name: column[row] for name, column in columns.items()},
        kinds=kinds,
    )
    return moment, int(columns["layer"][row])


def _motion_of(design: RobotDesign, command: np.ndarray) -> tuple[float, ...] | None:
    """Return the motion that a command asks for, None where the command itself states it."""
    if design.turns is not None:
        return None
    motion = np.zeros((1, 3))
    design.drive.motion(command[None].copy(), np.array([design.radius]), motion)
    return tuple(motion[0].tolist())


def reason_of(layer: Layer, moment: Moment) -> Reason:
    """Return the reason that a layer gives by its method ``reason(moment)``; for others the reason is the readings."""
    if hasattr(layer, "reason"):
        return layer.reason(moment)
    seeing = tuple(int(s) for s in np.flatnonzero(moment.kind >= 0))
    return Reason(", ".join(map(moment.reading, seeing)) or "its sensors see nothing", seeing)
