"""Solutions of notebook 14; each part may be pasted into the cell of its exercise."""

from mesa_swarm.control import PASS, behaviour


# %% exercise-1
def ants_on_the_left(draws, k):
    """Return how many ants choose the left branch: the more trail it has, the more probable it is."""
    left = right = 0
    for draw in draws:
        if draw < (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
        else:
            right += 1
    return left


# %% exercise-2
@behaviour
def clean(me):
    """Turn away from the side on which there is more trail."""
    me.act.trail = 1.0
    left, right = me.trail[0], me.trail[1]
    if left + right < 0.001:
        return PASS
    turn = (right - left) / (left + right)
    return me.max_speed * min(1.0, 1.0 - turn), me.max_speed * min(1.0, 1.0 + turn)
