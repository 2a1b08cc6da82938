"""A load, and robots that drive at it."""

from mesa_swarm import rectangle
from mesa_swarm.control import Subsumption
from mesa_swarm.physics import engine
from support.scenes import ahead, blind, empty

ENGINES = ("compiled", "shapely")
BOX = rectangle((200, 100), (240, 200))


def world(shape=BOX, resistance=0.5, poses=(), design=None, speed=1.0, **options):
    """Return a model with a load and robots that drive straight on, and the load."""
    model = empty(**options)
    load = model.add_load(shape, resistance=resistance)
    if len(poses):
        model.add_robots(design or blind(), poses=poses)
    model.control = Subsumption(ahead(speed=speed))
    return model, load


def note_returns(patch):
    """Let Python move robots and loads, with the bits of the kernels; return a list with an entry for each return.

    The kernels take loads back that robots cannot give way to, without a call that can be counted.
    """
    taken, real = [], engine.return_loads
    patch.setattr(engine.CompiledEngine, "_move_kernel_for", lambda *arguments: None)
    patch.setattr(engine, "return_loads", lambda *arguments: (taken.append(1), real(*arguments)))
    return taken


def abreast(n, x=195.0, y=150.0, heading=0.0):
    """Return poses of robots side by side, in touch with the left face of the box, centred on y."""
    return [(x, y + 12.0 * (k - (n - 1) / 2), heading) for k in range(n)]
