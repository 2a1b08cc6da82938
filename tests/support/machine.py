"""How slow this machine is just now."""

import time

import numpy as np

# What `slowness` measures, in seconds, where the targets were met.
USUAL = 0.037


def slowness() -> float:
    """Return how many times slower than usual a processor is just now, at least 1: by small calls, as steps make them.

    A virtual machine's processors are not always equally fast, however little of them others in it take.
    """
    rows, kept = np.linspace(0, 1, 12).reshape(6, 2), {}
    used = time.process_time()
    for k in range(20_000):
        moved = rows.copy()
        moved += rows
        kept[k % 97] = moved[k % 6, 0]
        np.isfinite(moved).all()
    return max(1.0, (time.process_time() - used) / USUAL)


if __name__ == "__main__":
    print(f"{min(slowness() for _ in range(5)):.1f}")
