"""Burning: one step of all fires and of the heat in all robots (appendix B of the thesis, corrected)."""

import math
from typing import Any, NamedTuple

from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Codes, Flags, Integers, RealRows, Reals
from mesa_swarm.world.statics import FIRE, OBSTACLE

NO_FIRE = -1
# The step in which a fire went out that burns.
NOT_YET = -1


class HeatArrays(NamedTuple):
    """The arguments of `burn`, and the kinds as which sensors see the fires."""

    position: RealRows
    radius: Reals
    rows: Integers
    place: RealRows
    reach: Reals
    area: Reals
    constants: tuple[float, float, float, float, float, float]
    extinguish_range: float
    heat_of: Reals
    out: Flags
    out_step: Integers
    fighters: Integers
    temperature: Reals
    heat: Reals
    hot: Flags
    fire: Integers
    seen_as: Codes


class Burning:
    """The process with which fires burn, heat the robots near them, and are put out by these.

    A model has it from its first fire on, as the first of its `processes`; its constants are those of the model.
    Without it fires stay as they are, or burn as another process lets them.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> fire = model.add_fire((400, 300), radius=20, temperature=0.5)
    >>> model.processes
    (Burning(),)
    >>> model.run(100).fires.temperature[0] > 0.5
    np.True_
    >>> model.remove_process(model.processes[0])
    >>> fire.temperature = 0.5
    >>> model.run(100).fires.temperature[0]
    np.float64(0.5)
    """

    __slots__ = ()

    def __repr__(self) -> str:
        return "Burning()"

    def step(self, model: Any) -> None:
        """Let the fires of a model burn for one step."""
        self.kernel_for(model).run(model.steps, len(model.swarm))

    def kernel_for(self, model: Any) -> Kernel:
        """Return what lets the fires of a model burn."""
        return model.parts.fires.burning()


class LightArrays(NamedTuple):
    """What `light_all` takes, and `set_fire` of live pages.

    Temperatures that are requested, NaN for none, and the rows of fires in the table of bodies; the temperature of
    bodies; of fires which are out, since when, and robots at each; the fire of each robot; and what fires are seen as.
    """

    asked: Reals
    rows: Integers
    heat_of: Reals
    out: Flags
    out_step: Integers
    fighters: Integers
    fire: Integers
    seen_as: Codes


@compiled(nogil=True)
def light_all(block, step, first, last):
    """Light the fires again for which this is asked, and release the robots at them; return whether one cannot be."""
    a = unpack(block, LightArrays)
    for f in range(a.asked.shape[0]):
        if not math.isnan(a.asked[f]) and not 0.0 < a.asked[f] <= 1.0:
            return 1
    for f in range(a.asked.shape[0]):
        if math.isnan(a.asked[f]):
            continue
        a.heat_of[a.rows[f]], a.asked[f] = a.asked[f], math.nan
        a.out[f], a.out_step[f], a.fighters[f] = False, NOT_YET, 0
        a.seen_as[f] = FIRE
        for i in range(a.fire.shape[0]):
            if a.fire[i] == f:
                a.fire[i] = NO_FIRE
    return 0


@compiled(nogil=True)
def burn_all(block, step, first, last):
    """Do what `burn` does for all rows, as each fire counts its robots; a fire that is out is seen as an obstacle."""
    h = unpack(block, HeatArrays)
    out, seen_as = h.out, h.seen_as
    went_out = burn(
        h.position, h.radius, h.rows, h.place, h.reach, h.area, h.constants, h.extinguish_range, step,
        h.heat_of, out, h.out_step, h.fighters, h.temperature, h.heat, h.hot, h.fire,
    )  # fmt: skip
    if went_out:
        for f in range(out.shape[0]):
            seen_as[f] = OBSTACLE if out[f] else FIRE
    return 0


@compiled
def burn(
    position, radius, rows, place, reach, area, constants, extinguish_range, step,
    heat_of, out, out_step, fighters, temperature, heat, hot, fire,
):  # fmt: skip
    """Assign robots to fires, then update every temperature once; return whether a fire went out.

    Fires have these `rows` in the table of bodies, of which `place`, `reach` and `heat_of` are position, radius and
    temperature. `constants` are k1, k2, k3, k4, leave, join. A robot whose body is within `extinguish_range` of a
    fire's edge can fight it and takes its heat. Written are, of fires, the temperature, which are out, since when, and
    the robots at each; of robots the temperature, the heat taken in this step, which are too hot, and which fire each
    fights.
    """
    fighters[:] = 0
    for i in range(position.shape[0]):
        near = nearest_fire(position[i, 0], position[i, 1], radius[i], rows, place, reach, out, extinguish_range)
        if near != NO_FIRE:
            heat_robot(i, heat_of[rows[near]], area[near], constants, temperature, heat)
        else:
            heat_robot(i, 0.0, 0.0, constants, temperature, heat)
        fire[i] = near if near != NO_FIRE and not hot[i] else NO_FIRE
        if fire[i] != NO_FIRE:
            fighters[near] += 1
        hot[i] = is_hot(temperature[i], hot[i], constants)
    went_out = False
    for f in range(rows.shape[0]):
        if out[f]:
            continue
        row = rows[f]
        heat_of[row] = next_temperature(heat_of[row], area[f], fighters[f], constants)
        if heat_of[row] <= 0.0:
            out[f] = True
            out_step[f] = step
            fighters[f] = 0
            went_out = True
    if went_out:
        release_from_dead_fires(fire, out)
    return went_out


@compiled
def release_from_dead_fires(fire, out):
    """Release the robots that fight a fire that is out."""
    for i in range(fire.shape[0]):
        if fire[i] != NO_FIRE and out[fire[i]]:
            fire[i] = NO_FIRE


@compiled
def nearest_fire(x, y, radius, rows, place, reach, out, extinguish_range):
    """Return the burning fire whose edge is nearest, if the body is within range of it, else NO_FIRE."""
    near, least = NO_FIRE, math.inf
    for f in range(rows.shape[0]):
        row = rows[f]
        gap = hypot(x - place[row, 0], y - place[row, 1]) - reach[row] - radius
        if not out[f] and gap <= extinguish_range and gap < least:
            near, least = f, gap
    return near


@compiled
def heat_robot(i, fire_temperature, area, constants, temperature, heat):
    """Change the temperature of robot i: H <- max(H + k3 T A - k4, 0) (B.5); T is 0 where no fire is near."""
    heat[i] = constants[2] * fire_temperature * area
    temperature[i] = max(temperature[i] + heat[i] - constants[3], 0.0)


@compiled
def is_hot(temperature, was_hot, constants):
    """Return whether a robot is too hot to fight: from `leave` on, until it has cooled to `join`."""
    return temperature >= constants[4] or (was_hot and temperature > constants[5])


@compiled
def next_temperature(temperature, area, robots, constants):
    """Return a fire's next temperature: T + k1 (T + 1) - (k2 / A) n, within [0, 1] (B.3, corrected)."""
    new_temperature = temperature + constants[0] * (temperature + 1.0) - constants[1] / area * robots
    return min(max(new_temperature, 0.0), 1.0)
