"""Worlds of tasks whose robots stand at given poses."""

from dataclasses import replace

import numpy as np

from mesa_swarm.environments.task_world import TaskWorld


def world_of(task, poses, **more) -> TaskWorld:
    """Return a world whose robots stand at these poses."""
    world = TaskWorld(task=replace(task, n_robots=len(poses)), rng=1, **{"commanded": len(poses), **more})
    for robot, (x, y, heading) in zip(world.robots, poses, strict=True):
        robot.position, robot.heading = (x, y), heading
    return world


def rewarded(world: TaskWorld, wheels) -> list[float]:
    """Return the rewards of a step with these actions."""
    out = np.full(world.commanded, np.nan)
    world.advance(np.array(wheels, float), out)
    return out.tolist()
