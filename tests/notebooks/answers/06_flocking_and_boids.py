"""Answers to the exercises of notebook 6."""


# %% exercise-1 right: complex numbers
def my_polarization(heading):
    return np.abs(np.exp(1j * heading).mean())
# %% exercise-1 right: a loop with math
import math


def my_polarization(heading):
    x = y = 0.0
    for one in heading:
        x += math.cos(one)
        y += math.sin(one)
    return math.sqrt(x**2 + y**2) / len(heading)
# %% exercise-1 right: the norm of the mean vector
def my_polarization(heading):
    return np.linalg.norm(np.mean([np.cos(heading), np.sin(heading)], axis=1))
# %% exercise-1 right: the mean cosine of the deviations from the mean direction
def my_polarization(heading):
    mean = np.arctan2(np.sin(heading).sum(), np.cos(heading).sum())
    return np.cos(heading - mean).mean()
# %% exercise-1 right: rounded to seven places, a plain float
def my_polarization(heading):
    return round(float(np.hypot(np.mean(np.cos(heading)), np.mean(np.sin(heading)))), 7)
# %% exercise-1 right: all pairs
def my_polarization(heading):
    return np.sqrt(np.cos(np.subtract.outer(heading, heading)).mean())
# %% exercise-1 hint: np.hypot of the means of cos and sin
def my_polarization(heading):
    return np.hypot(np.mean(np.cos(heading)), np.mean(np.sin(heading)))
# %% exercise-1 wrong: the sum in place of the mean
def my_polarization(heading):
    return np.hypot(np.cos(heading).sum(), np.sin(heading).sum())
# %% exercise-1 wrong: the mean length of the vectors
def my_polarization(heading):
    return np.hypot(np.cos(heading), np.sin(heading)).mean()
# %% exercise-1 wrong: deviations from the mean of the headings
def my_polarization(heading):
    return np.cos(heading - heading.mean()).mean()
# %% exercise-1 wrong: its square
def my_polarization(heading):
    return np.cos(heading).mean() ** 2 + np.sin(heading).mean() ** 2
# %% exercise-1 wrong: the cosine only
def my_polarization(heading):
    return abs(np.cos(heading).mean())
# %% exercise-1 wrong: degrees
def my_polarization(heading):
    radians = np.radians(heading)
    return np.hypot(np.cos(radians).mean(), np.sin(radians).mean())
# %% exercise-1 wrong: one number a robot
def my_polarization(heading):
    return np.hypot(np.cos(heading), np.sin(heading))
# %% exercise-1 wrong: the mean vector
def my_polarization(heading):
    return np.cos(heading).mean(), np.sin(heading).mean()
# %% exercise-1 wrong: for forty headings only
def my_polarization(heading):
    return np.hypot(np.cos(heading).sum(), np.sin(heading).sum()) / 40
# %% exercise-1 wrong: from the variance
def my_polarization(heading):
    return np.exp(-np.var(heading) / 2)
# %% exercise-1 wrong: along one direction
def my_polarization(heading):
    return np.cos(heading - 3.0).mean()
# %% exercise-2 right: only the two weights that matter
answer = {"alignment_weight": 0, "cruise_weight": 4}
# %% exercise-2 right: twice the weight of the own course
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=0.5, cruise_weight=2.0)
# %% exercise-2 right: no cohesion either, the strongest course
answer = dict(separation_weight=3, alignment_weight=0, cohesion_weight=0, cruise_weight=5)
# %% exercise-2 right: more cohesion than by default
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=1.0, cruise_weight=3.0)
# %% exercise-2 right: numbers of numpy
answer = dict(zip(("alignment_weight", "cruise_weight"), np.array([0.0, 5.0]), strict=True))
# %% exercise-2 hint: alignment_weight 0, cruise_weight 3
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=0.5, cruise_weight=3.0)
# %% exercise-2 wrong: as given
answer = dict(separation_weight=3.0, alignment_weight=1.0, cohesion_weight=0.5, cruise_weight=1.0)
# %% exercise-2 wrong: only without the alignment rule
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=0.5, cruise_weight=1.0)
# %% exercise-2 wrong: only a strong course
answer = dict(separation_weight=3.0, alignment_weight=1.0, cohesion_weight=0.5, cruise_weight=5.0)
# %% exercise-2 wrong: boids that stand still
answer = dict(separation_weight=0.0, alignment_weight=0.0, cohesion_weight=0.0, cruise_weight=0.0)
# %% exercise-2 wrong: a negative weight
answer = dict(separation_weight=3.0, alignment_weight=-3.0, cohesion_weight=0.5, cruise_weight=1.0)
# %% exercise-2 wrong: a weight above the range
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=0.5, cruise_weight=20.0)
# %% exercise-2 wrong: two boids that hardly meet
answer = dict(n_robots=2, alignment_weight=0.0, cruise_weight=3.0)
# %% exercise-2 wrong: nothing but cohesion
answer = dict(separation_weight=0.0, alignment_weight=0.0, cohesion_weight=5.0, cruise_weight=0.0)
# %% exercise-2 wrong: nothing but separation
answer = dict(separation_weight=5.0, alignment_weight=0.0, cohesion_weight=0.0, cruise_weight=0.0)
# %% exercise-2 wrong: more of the alignment rule
answer = dict(separation_weight=0.0, alignment_weight=5.0, cohesion_weight=0.0, cruise_weight=1.0)
