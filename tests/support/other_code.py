"""A model class whose code was another while a run was recorded: the steps differ from one on."""

from contextlib import contextmanager

from mesa_swarm.models.fire_fighting import FireFighting


@contextmanager
def other_code(after, change):
    """Within this, every FireFighting does something more in the step that comes after `after` others."""
    step = FireFighting.step

    def other(self):
        if self.completed == after:
            change(self)
        step(self)

    FireFighting.step = other
    try:
        yield
    finally:
        del FireFighting.step  # which it has inherited
