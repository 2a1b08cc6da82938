"""Solutions of notebook 11; each part may be pasted into the cell of its exercise."""

# %% exercise-1
weights = [
    [0, -5],  # the sensor ahead: turn to a fixed side
    [0, -5],  # left: slow the right wheel
    [-5, 0],  # right: slow the left wheel
    [2, 2],  # the constant: straight ahead, and still at full speed when something is moderately near
]


# %% exercise-2
def fitness(left, right, nearest):
    """Return V (1 - sqrt(dv)) (1 - i)."""
    speed, difference = (abs(left) + abs(right)) / 2, abs(left - right) / 2
    return speed * (1 - difference**0.5) * (1 - nearest)
