"""Answers to the exercises of notebook 13."""


# %% exercise-1 right: a loop
def mean_difference(first, second):
    total, count = 0.0, 0
    for before, after in zip(first, second):
        if before is None or after is None:
            continue
        total += after - before
        count += 1
    return total / count
# %% exercise-1 right: arrays, where None is NaN
def mean_difference(first, second):
    return np.nanmean(np.array(second, dtype=float) - np.array(first, dtype=float))
# %% exercise-1 right: by index, and statistics.mean
from statistics import mean


def mean_difference(first, second):
    kept = [i for i in range(len(first)) if None not in (first[i], second[i])]
    return mean(second[i] - first[i] for i in kept)
# %% exercise-1 right: the package's own function
def mean_difference(first, second):
    return paired_difference(first, second)[0].estimate
# %% exercise-1 right: difference of the means over the same pairs
def mean_difference(first, second):
    pairs = [pair for pair in zip(first, second) if all(number is not None for number in pair)]
    ours, theirs = zip(*pairs)
    return sum(theirs) / len(theirs) - sum(ours) / len(ours)
# %% exercise-1 right: a table
import pandas as pd


def mean_difference(first, second):
    table = pd.DataFrame({"first": first, "second": second}).astype(float).dropna()
    return (table["second"] - table["first"]).mean()
# %% exercise-1 hint: np.mean over pairs in which neither is None
def mean_difference(first, second):
    return np.mean([b - a for a, b in zip(first, second) if a is not None and b is not None])
# %% exercise-1 wrong: first minus second
def mean_difference(first, second):
    return np.mean([a - b for a, b in zip(first, second) if a is not None and b is not None])
# %% exercise-1 wrong: each side without its own None
def mean_difference(first, second):
    return np.mean([b for b in second if b is not None]) - np.mean([a for a in first if a is not None])
# %% exercise-1 wrong: None counts as 0
def mean_difference(first, second):
    return np.mean([(b or 0) - (a or 0) for a, b in zip(first, second)])
# %% exercise-1 wrong: None is not left out
def mean_difference(first, second):
    return np.mean([b - a for a, b in zip(first, second)])
# %% exercise-1 wrong: the median
def mean_difference(first, second):
    return np.median([b - a for a, b in zip(first, second) if a is not None and b is not None])
# %% exercise-1 wrong: divided by all pairs
def mean_difference(first, second):
    return sum(b - a for a, b in zip(first, second) if a is not None and b is not None) / len(first)
# %% exercise-1 wrong: the difference is printed
def mean_difference(first, second):
    print(paired_difference(first, second)[0].estimate)
# %% exercise-1 wrong: 0 taken for None
def mean_difference(first, second):
    return np.mean([b - a for a, b in zip(first, second) if a and b])
# %% exercise-1 wrong: 0 of one side taken for None
def mean_difference(first, second):
    return np.mean([b - a for a, b in zip(first, second) if a is not None and b])
# %% exercise-1 wrong: ten pairs, however many there are
def mean_difference(first, second):
    return sum(b - a for a, b in zip(first, second) if a is not None and b is not None) / 10
# %% exercise-2 right: forty
pairs = 40
# %% exercise-2 right: thirty-six
pairs = 36
# %% exercise-2 right: a float that is whole
pairs = 50.0
# %% exercise-2 right: computed from the width with ten pairs
pairs = int(2 * np.ceil(10 * (0.33 / 0.25) ** 2))
# %% exercise-2 right: a number of numpy
pairs = np.int64(45)
# %% exercise-2 hint: about fifty
pairs = 50
# %% exercise-2 wrong: two
pairs = 2
# %% exercise-2 wrong: five
pairs = 5
# %% exercise-2 wrong: ten
pairs = 10
# %% exercise-2 wrong: twelve
pairs = 12
# %% exercise-2 wrong: not whole
pairs = 50.5
# %% exercise-2 wrong: more than are accepted
pairs = 201
# %% exercise-2 wrong: a list
pairs = [50]
# %% exercise-2 wrong: twenty
pairs = 20
# %% exercise-2 wrong: sixteen
pairs = 16
# %% exercise-2 wrong: one
pairs = 1
