"""Answers to the exercises of notebook 10."""


# %% exercise-1 right: with math
import math


def reward_b(nearest, left, right, critical=0.08):
    if nearest >= critical:
        if left == 1 and right == 1:
            return 1
        return -1
    q = (math.e - 1) / critical
    return math.log(q * nearest + 1) - 1
# %% exercise-1 right: in one line
reward_b = lambda i, l, r, d=0.08: np.log1p((np.e - 1) / d * i) - 1 if i < d else 2 * (l + r == 2) - 1
# %% exercise-1 right: with np.where
def reward_b(nearest, left, right, critical=0.08):
    near = np.log((np.exp(1) - 1) / critical * nearest + 1) - 1
    far = np.where((left >= 1) & (right >= 1), 1.0, -1.0)
    return np.where(nearest < critical, near, far)
# %% exercise-1 wrong: without the critical distance as a parameter
def reward_b(nearest, left, right):
    q = 1.718281828 / 0.08
    if nearest < 0.08:
        return np.log(q * nearest + 1) - 1
    return 1.0 if (left, right) == (1, 1) else -1.0
# %% exercise-1 right: by the product of the wheels
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return float(np.log((np.e - 1) * nearest / critical + 1)) - 1.0
    return 2.0 * (min(left, right) > 0) - 1.0
# %% exercise-1 right: the package's own
def reward_b(nearest, left, right, critical=0.08):
    return reward("b", nearest, left, right, critical)
# %% exercise-1 hint: its two lines
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: both wheels alike, also backwards
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left == right else -1.0
# %% exercise-1 wrong: one wheel is enough
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left + right > 0 else -1.0
# %% exercise-1 wrong: the critical distance counts as near
def reward_b(nearest, left, right, critical=0.08):
    if nearest <= critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: the other logarithm
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log10((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: straight instead of the logarithm
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return nearest / critical - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: reward (a) beyond the critical distance
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return (left + right) / 2
# %% exercise-1 wrong: e to the power of d
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log(np.e - 1 / critical * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: 0 for other actions
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return float(left == right == 1.0)
# %% exercise-1 wrong: 0.08 written into it
def reward_b(nearest, left, right, critical=0.08):
    if nearest < 0.08:
        return np.log((np.e - 1) / 0.08 * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: q as a number
def reward_b(nearest, left, right, critical=0.08):
    if nearest < critical:
        return np.log(21.4785 * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-1 wrong: a table of the shown distances
def reward_b(nearest, left, right, critical=0.08):
    table = {0.0: -1.0, 0.03: -0.5025, 0.06: -0.1718, 0.079: -0.00794}
    if nearest in table:
        return np.log((np.e - 1) / 0.08 * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0
# %% exercise-2 right: as numbers with a point, in another order
leaps = {
    ("c", "turning"): 0.0,
    ("c", "ahead"): 0.0,
    ("b", "turning"): -1.0,
    ("b", "ahead"): 1.0,
    ("a", "turning"): 0.0,
    ("a", "ahead"): 1.0,
}
# %% exercise-2 right: from the package's function, near the point
leaps = {
    (kind, action): reward(kind, 0.0801, *wheels) - reward(kind, 0.0799, *wheels)
    for kind in "abc"
    for action, wheels in (("ahead", (1, 1)), ("turning", (1, -1)))
}
# %% exercise-2 right: from arrays
kinds = [(kind, action) for kind in "abc" for action in ("ahead", "turning")]
leaps = dict(zip(kinds, np.array([1, 0, 1, -1, 0, 0])))
# %% exercise-2 right: set one by one
leaps = dict.fromkeys([(kind, action) for kind in ("a", "b", "c") for action in ("ahead", "turning")], 0)
leaps["a", "ahead"] = leaps["b", "ahead"] = +1
leaps["b", "turning"] = -1
# %% exercise-2 right: by hand, as fractions
from fractions import Fraction

inside = Fraction(0)
leaps = {("a", "ahead"): 1 - inside, ("a", "turning"): (1 - 1) / 2 - inside}
leaps |= {("b", "ahead"): 1 - inside, ("b", "turning"): -1 - inside}
leaps |= {("c", "ahead"): Fraction(0, 8), ("c", "turning"): 0}
# %% exercise-2 hint: its six numbers
leaps = {
    ("a", "ahead"): 1,
    ("b", "ahead"): 1,
    ("c", "ahead"): 0,
    ("a", "turning"): 0,
    ("b", "turning"): -1,
    ("c", "turning"): 0,
}
# %% exercise-2 wrong: (c) taken for (b)
leaps = {
    ("a", "ahead"): 1,
    ("a", "turning"): 0,
    ("b", "ahead"): 1,
    ("b", "turning"): -1,
    ("c", "ahead"): 1,
    ("c", "turning"): -1,
}
# %% exercise-2 wrong: from -1 at contact instead of 0 at the critical distance
leaps = {
    ("a", "ahead"): 2,
    ("a", "turning"): 1,
    ("b", "ahead"): 2,
    ("b", "turning"): 0,
    ("c", "ahead"): 1,
    ("c", "turning"): 1,
}
# %% exercise-2 wrong: sizes without signs
leaps = {
    ("a", "ahead"): 1,
    ("a", "turning"): 0,
    ("b", "ahead"): 1,
    ("b", "turning"): 1,
    ("c", "ahead"): 0,
    ("c", "turning"): 0,
}
# %% exercise-2 wrong: inwards
leaps = {
    ("a", "ahead"): -1,
    ("a", "turning"): 0,
    ("b", "ahead"): -1,
    ("b", "turning"): 1,
    ("c", "ahead"): 0,
    ("c", "turning"): 0,
}
# %% exercise-2 wrong: one case is missing
leaps = {("a", "ahead"): 1, ("a", "turning"): 0, ("b", "ahead"): 1, ("b", "turning"): -1, ("c", "ahead"): 0}
# %% exercise-2 wrong: a list
leaps = [1, 0, 1, -1, 0, 0]
# %% exercise-2 wrong: words
leaps = dict.fromkeys([(kind, action) for kind in "abc" for action in ("ahead", "turning")], "up")
# %% exercise-2 wrong: no jump anywhere
leaps = {("a", "ahead"): 0, ("a", "turning"): 0, ("b", "ahead"): 0, ("b", "turning"): 0, ("c", "ahead"): 0, ("c", "turning"): 0}
# %% exercise-2 wrong: (a) for turning as for driving ahead
leaps = {
    ("a", "ahead"): 1,
    ("a", "turning"): 1,
    ("b", "ahead"): 1,
    ("b", "turning"): -1,
    ("c", "ahead"): 0,
    ("c", "turning"): 0,
}
# %% exercise-2 wrong: from -1 to 1
leaps = {
    ("a", "ahead"): 2,
    ("a", "turning"): 1,
    ("b", "ahead"): 2,
    ("b", "turning"): 0,
    ("c", "ahead"): 0,
    ("c", "turning"): 0,
}
