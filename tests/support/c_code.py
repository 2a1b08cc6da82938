"""C that was exported: compiled with all warnings as errors, called from Python."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wno-float-conversion", "-Werror", "-pedantic")
REALS = {"double": np.float64, "float": np.float32}
needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
# Acts once for each of n robots, so that Python calls C once.
LOOP = """
void act_all(int n, const uint32_t *numbers, const robot_real *readings, const int8_t *kinds, const robot_real *chance,
             robot_real *memory, robot_real *wheels);
void act_all(int n, const uint32_t *numbers, const robot_real *readings, const int8_t *kinds, const robot_real *chance,
             robot_real *memory, robot_real *wheels)
{
    int i;
    (void)numbers;
    (void)memory;
    for (i = 0; i < n; i++)
        robot_act(FIRST readings + i * ROBOT_SENSORS, kinds + i * ROBOT_SENSORS, chance[i], STATE wheels + 2 * i);
}
"""


# The same for a state machine, whose states outlast the call.
MACHINE_LOOP = """
void reset_all(int n, const int8_t *sides);
void act_all(int n, const robot_real *readings, const int8_t *kinds, const uint8_t *line, const robot_real *radiation,
             const robot_real *chances, int8_t *now, robot_real *wheels);
static robot_state states[1000];
void reset_all(int n, const int8_t *sides)
{
    int i;
    for (i = 0; i < n; i++)
        robot_reset(&states[i], sides[i]);
}
void act_all(int n, const robot_real *readings, const int8_t *kinds, const uint8_t *line, const robot_real *radiation,
             const robot_real *chances, int8_t *now, robot_real *wheels)
{
    int i;
    for (i = 0; i < n; i++) {
        robot_act(readings + i * ROBOT_SENSORS, kinds + i * ROBOT_SENSORS, line + i * ROBOT_LINE_SENSORS,
                  radiation + i * ROBOT_RADIATION_SENSORS, chances + i * ROBOT_CHANCES, &states[i], wheels + 2 * i);
        now[i] = (int8_t)states[i].now;
    }
}
"""


def compiled_machine(source: Path) -> ctypes.CDLL:
    """Compile an exported machine robot.c as a shared library with a loop over robots, and load it."""
    return _library(source, MACHINE_LOOP)


def compiled_library(source: Path, policy) -> ctypes.CDLL:
    """Compile an exported robot.c as a shared library with a loop over robots, and load it."""
    first = "numbers[i]," if policy.copies > 1 else ""
    state = "(robot_state *)(memory + i * ROBOT_MEMORY)," if getattr(policy, "memory", 0) else ""
    return _library(source, LOOP.replace("FIRST", first).replace("STATE", state))


def _library(source: Path, loop: str) -> ctypes.CDLL:
    looped, library = source.with_name("looped.c"), source.with_suffix(".so")
    looped.write_text(f'#include "{source.name}"\n{loop}')
    command = ["cc", *STRICT, "-O1", "-shared", "-fPIC", str(looped), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(library))


def drawn_inputs(sensors, count, rng):
    """Return readings, kinds and chances at random, among them nothing in range, contact and the range's end."""
    ranges = np.array(sensors.ranges)
    readings = rng.uniform(0.0, 1.2, (count, len(ranges))) * ranges
    kinds = rng.integers(0, 4, readings.shape).astype(np.int8)
    special = rng.random(readings.shape)
    readings = np.select([special < 0.1, special < 0.15, special > 0.5], [0.0, ranges, -1.0], readings)
    kinds[special > 0.5] = -1
    readings[:2], kinds[0] = [[-1.0], [0.0]], -1
    chance = rng.random(count)
    chance[:3] = 0.0, 0.0, 1.0 - 2.0**-24  # the last is the largest of the exported generator
    return readings, kinds, chance


def place(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def acted_in_c(library, policy, readings, kinds, chance, *, number="double", numbers=None, memory=None):
    """Return the wheel commands (n, 2) of an exported policy, and the memory afterwards."""
    n, real = len(readings), REALS[number]
    state = np.zeros((n, getattr(policy, "memory", 0))) if memory is None else memory
    state, wheels = np.array(state, real), np.empty((n, 2), real)
    count = np.array(np.zeros(n) if numbers is None else numbers, np.uint32)
    inputs = [np.ascontiguousarray(readings, real), np.ascontiguousarray(kinds, np.int8), np.array(chance, real)]
    library.act_all(ctypes.c_int(n), *map(place, (count, *inputs, state, wheels)))
    return wheels, state
