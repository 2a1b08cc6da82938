"""Answers to the exercises of notebook 11."""


# %% exercise-1 right: to the other side
weights = [[-5, 0], [0, -5], [-5, 0], [2, 2]]
# %% exercise-1 right: as an array of floats
weights = np.array([[0.0, -4.0], [0.0, -4.0], [-4.0, 0.0], [2.0, 2.0]])
# %% exercise-1 right: weaker, as tuples
weights = (0, -3), (0, -3), (-3, 0), (1.5, 1.5)
# %% exercise-1 right: stronger
weights = [[0, -6], [0, -6], [-6, 0], [3, 3]]
# %% exercise-1 right: on the spot
weights = [[-5, 5], [5, -5], [-5, 5], [2, 2]]
# %% exercise-1 right: gently
weights = [[0, -2], [0, -2], [-2, 0], [1.2, 1.2]]
# %% exercise-1 right: from names
ahead, left, right = (0, -5), (0, -5), (-5, 0)
weights = [ahead, left, right, (1.5, 1.5)]
# %% exercise-1 hint: -5, and a constant of 2
weights = [
    [0, -5],  # the sensor ahead
    [0, -5],  # left
    [-5, 0],  # right
    [2, 2],  # the constant
]
# %% exercise-1 wrong: towards what is near
weights = [[0, -5], [-5, 0], [0, -5], [2, 2]]
# %% exercise-1 wrong: both wheels slow for what is ahead
weights = [[-5, -5], [0, -5], [-5, 0], [2, 2]]
# %% exercise-1 wrong: positive weights
weights = [[0, 5], [0, 5], [5, 0], [2, 2]]
# %% exercise-1 wrong: too slow
weights = [[0, -5], [0, -5], [-5, 0], [0.5, 0.5]]
# %% exercise-1 wrong: in circles
weights = [[0, -5], [0, -5], [-5, 0], [1, 0.5]]
# %% exercise-1 wrong: only the sensor ahead
weights = [[0, -5], [0, 0], [0, 0], [2, 2]]
# %% exercise-1 wrong: it stands
weights = [[0, 0], [0, 0], [0, 0], [0, 0]]
# %% exercise-1 wrong: backwards
weights = [[0, -5], [0, -5], [-5, 0], [-2, -2]]
# %% exercise-1 wrong: the constant is missing
weights = [[0, -5], [0, -5], [-5, 0]]
# %% exercise-1 wrong: not a number
weights = [[0, -5], [0, -5], [-5, 0], [float("nan"), 2]]
# %% exercise-1 wrong: words
weights = [["slow", "fast"]] * 4
# %% exercise-1 wrong: blind, at full speed
weights = [[0, 0], [0, 0], [0, 0], [2, 2]]
# %% exercise-1 wrong: one side only
weights = [[0, 0], [0, -5], [0, 0], [2, 2]]
# %% exercise-1 wrong: hardly any weight
weights = [[0, -0.2], [0, -0.2], [-0.2, 0], [2, 2]]
# %% exercise-2 right: step by step
import math


def fitness(left, right, nearest):
    speed = (math.fabs(left) + math.fabs(right)) / 2
    difference = math.fabs(left - right) / 2
    return speed * (1 - math.sqrt(difference)) * (1 - nearest)
# %% exercise-2 right: in one line, with np
fitness = lambda l, r, i: np.mean(np.abs([l, r])) * (1 - np.sqrt(np.abs(l - r) / 2)) * (1 - i)
# %% exercise-2 right: the package's own
fitness = floreano
# %% exercise-2 right: multiplied out
def fitness(left, right, nearest):
    v = 0.5 * abs(left) + 0.5 * abs(right)
    root = (0.5 * max(left - right, right - left)) ** 0.5
    return v - v * root - v * nearest + v * root * nearest
# %% exercise-2 right: from standard deviations
def fitness(left, right, nearest):
    return np.float64(abs(left) + abs(right)) / 2 * (1 - np.std([left, right]) ** 0.5) * (1 - nearest)
# %% exercise-2 hint: its line
def fitness(left, right, nearest):
    dv = abs(left - right) / 2
    return (abs(left) + abs(right)) / 2 * (1 - dv ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: the signed mean speed
def fitness(left, right, nearest):
    return (left + right) / 2 * (1 - (abs(left - right) / 2) ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: without the root
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - abs(left - right) / 2) * (1 - nearest)
# %% exercise-2 wrong: the difference is not halved
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - abs(left - right) ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: the difference of absolute speeds
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - (abs(abs(left) - abs(right)) / 2) ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: times the nearness
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - (abs(left - right) / 2) ** 0.5) * nearest
# %% exercise-2 wrong: the sum of the wheels
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) * (1 - (abs(left - right) / 2) ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: the absolute value of the mean
def fitness(left, right, nearest):
    return abs(left + right) / 2 * (1 - (abs(left - right) / 2) ** 0.5) * (1 - nearest)
# %% exercise-2 wrong: dv squared
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - (abs(left - right) / 2) ** 2) * (1 - nearest)
# %% exercise-2 wrong: nearness squared
def fitness(left, right, nearest):
    return (abs(left) + abs(right)) / 2 * (1 - (abs(left - right) / 2) ** 0.5) * (1 - nearest**2)
# %% exercise-2 wrong: the larger of the two speeds
def fitness(left, right, nearest):
    return max(abs(left), abs(right)) * (1 - (abs(left - right) / 2) ** 0.5) * (1 - nearest)
