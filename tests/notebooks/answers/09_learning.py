"""Answers to the exercises of notebook 9."""


# %% exercise-1 right: in a loop, with math
import math


def probabilities(values, temperature):
    weights = []
    for value in values:
        weights.append(math.exp(value / temperature))
    total = sum(weights)
    return [weight / total for weight in weights]
# %% exercise-1 right: the largest value taken off first
def probabilities(values, temperature):
    scaled = np.asarray(values) / temperature
    weights = np.exp(scaled - scaled.max())
    return weights / np.sum(weights)
# %% exercise-1 right: from SciPy
from scipy.special import softmax


def probabilities(values, temperature):
    return softmax(np.array(values) / temperature)
# %% exercise-1 right: the package's own
probabilities = boltzmann
# %% exercise-1 right: each against all, as a tuple
def probabilities(values, temperature):
    return tuple(1 / sum(np.exp((other - value) / temperature) for other in values) for value in values)
# %% exercise-1 right: powers of e
probabilities = lambda q, t: np.e ** (q / t) / (np.e ** (q / t)).sum()
# %% exercise-1 hint: its line
def probabilities(values, temperature):
    w = np.exp(values / temperature); return w / w.sum()
# %% exercise-1 wrong: without temperature
def probabilities(values, temperature):
    return np.exp(values) / np.exp(values).sum()
# %% exercise-1 wrong: times the temperature
def probabilities(values, temperature):
    weights = np.exp(values * temperature)
    return weights / weights.sum()
# %% exercise-1 wrong: the sum is missing
def probabilities(values, temperature):
    return np.exp(values / temperature)
# %% exercise-1 wrong: the temperature is applied after the exponential
def probabilities(values, temperature):
    weights = np.exp(values) / temperature
    return weights / weights.sum()
# %% exercise-1 wrong: always the best
def probabilities(values, temperature):
    return (values == values.max()).astype(float)
# %% exercise-1 wrong: the worst is most probable
def probabilities(values, temperature):
    weights = np.exp(-values / temperature)
    return weights / weights.sum()
# %% exercise-1 wrong: all alike
def probabilities(values, temperature):
    return np.ones(len(values)) / len(values)
# %% exercise-1 wrong: one number
def probabilities(values, temperature):
    return np.exp(values / temperature).sum()
# %% exercise-1 wrong: nothing is returned
def probabilities(values, temperature):
    weights = np.exp(values / temperature)
    weights / weights.sum()
# %% exercise-1 wrong: for four actions only
def probabilities(values, temperature):
    w = [np.exp(values[i] / temperature) for i in range(4)]
    return np.array(w) / sum(w)
# %% exercise-1 wrong: powers of two
def probabilities(values, temperature):
    weights = 2.0 ** (values / temperature)
    return weights / weights.sum()
# %% exercise-1 wrong: divided by the largest
def probabilities(values, temperature):
    weights = np.exp(values / temperature)
    return weights / weights.max()
# %% exercise-2 right: beta alone
answer = dict(beta=0.005)
# %% exercise-2 right: a slow one
answer = {"beta": 0.003}
# %% exercise-2 right: a quick one
answer = dict(beta=1 / 100)
# %% exercise-2 right: begin cooler
answer = dict(beta=0.004, first_temperature=0.6, last_temperature=0.2)
# %% exercise-2 right: end cooler
answer = dict(beta=np.float64(0.005), first_temperature=1, last_temperature=0.15)
# %% exercise-2 hint: the middle of its range
answer = dict(beta=0.006, first_temperature=1.0, last_temperature=0.2)
# %% exercise-2 wrong: too slow
answer = dict(beta=0.00005)
# %% exercise-2 wrong: hot for ever
answer = dict(beta=0, first_temperature=1.0, last_temperature=0.2)
# %% exercise-2 wrong: it heats up
answer = dict(beta=0.005, first_temperature=0.2, last_temperature=1.0)
# %% exercise-2 wrong: it ends warm
answer = dict(beta=0.005, first_temperature=1.0, last_temperature=0.9)
# %% exercise-2 wrong: one robot, which has the map for itself
answer = dict(beta=0.005, n_robots=1)
# %% exercise-2 wrong: another reward
answer = dict(beta=0.005, reward="a")
# %% exercise-2 wrong: out of range
answer = dict(beta=2.0)
# %% exercise-2 wrong: a number without its name
answer = 0.005
# %% exercise-2 wrong: never cooler
answer = dict(beta=0.0, first_temperature=1.0, last_temperature=0.2)
# %% exercise-2 wrong: cold from the start
answer = dict(beta=0.0001, first_temperature=0.01, last_temperature=0.01)
# %% exercise-2 wrong: far too hot
answer = dict(beta=0.005, first_temperature=5.0, last_temperature=1.0)
