"""Functions that are compiled apart from those that call them; as a script, what one of these returns."""

import sys

import numpy as np

from mesa_swarm.kernels.compiled import compiled


@compiled(apart=True)
def halves(values):
    """Return half of each, in a new array."""
    if len(values) == 0:
        raise ValueError("nothing to halve")
    return values / 2


@compiled
def quarters(values):
    """Call a function that is apart twice."""
    return halves(halves(values))


@compiled(apart=True)
def sum_of_quarters(values):
    """Call one that has taken in a call of a function that is apart."""
    return quarters(values).sum()


@compiled
def twice_the_sum(values, more):
    """Call this; returns a tuple, for another type as well."""
    return 2 * sum_of_quarters(values), halves(more)[0]


if __name__ == "__main__":
    from_disk = sum(twice_the_sum.stats.cache_hits.values())
    print(*twice_the_sum(np.arange(9.0), np.array([3])), sum(twice_the_sum.stats.cache_hits.values()) - from_disk)
    print(sum(sum(one.stats.cache_misses.values()) for one in (halves, quarters, sum_of_quarters, twice_the_sum)))
    sys.exit()
