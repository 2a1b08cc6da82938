"""Policies as C99 source for microcontrollers: no memory allocation, no library but that of C."""

import math
import os
import re
from pathlib import Path
from string import Template

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    LearningError,
    UnknownNameError,
    check_choice,
    check_count,
    shortened,
)
from mesa_swarm.base.files import write_all
from mesa_swarm.learning.actions import ACTIONS
from mesa_swarm.learning.networks import NetworkPolicy
from mesa_swarm.learning.policy import Policy, SensorLayout, check_policy
from mesa_swarm.learning.policy_files import file_at
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.learning.reflex_policy import ReflexPolicy
from mesa_swarm.learning.wire_learning import STARTS, WirePolicy

# The kinds of floating-point numbers: the suffix of their functions, of their literals, and NumPy's type.
NUMBERS: dict[str, tuple[str, str, type]] = {"double": ("", "", np.float64), "float": ("f", "f", np.float32)}
NAME = re.compile(r"[a-z][a-z0-9_]{0,49}")
# Words of C99, which would be confusing names of files.
KEYWORD = re.compile(
    "auto|break|case|char|const|continue|default|do|double|else|enum|extern|float|for|goto|if|inline|int|long|register|"
    "restrict|return|short|signed|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile|while"
)
# Values in a line of an array.
IN_A_LINE = 6


def export_c(
    policy: Policy, path: str | os.PathLike[str], *, number: str = "double", copy: int | None = None
) -> tuple[Path, Path]:
    """Write a policy as C99 source, and return the paths of the source file and its header.

    The source needs no library but that of C (``tanh`` and ``exp``), allocates no memory and has no state of its
    own. Given the same readings, kinds and chance its function ``NAME_act`` gives the wheel commands of
    ``policy.act``, in double precision within 1e-6; the header describes its arguments.

    Parameters
    ----------
    policy : QPolicy, ReflexPolicy or WirePolicy
    path : str or Path
        Ends with .c; its name without the ending becomes NAME, and the header's name: small letters, digits and
        underscores, beginning with a letter.
    number : str
        "double", or "float": half the memory, and faster where a processor has no double precision.
    copy : int, optional
        Which of a policy's sets of weights is exported; all by default, and ``NAME_act`` has the robot's number as one
        more argument.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If the policy is of another family, or an option is not a valid one.
    LearningError
        If the policy has no sensors, or weights beyond the range of `number`.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [file.name for file in export_c(policy, f"{folder}/robot.c")]
    ['robot.c', 'robot.h']
    """
    name, folder = place_of(path)
    files = c_source(policy, name, number=number, copy=copy)
    source, header = write_all(folder, files)
    return source, header


def c_source(policy: Policy, name: str, *, number: str = "double", copy: int | None = None) -> dict[str, str | bytes]:
    """Return the texts of the source file and its header by their names; see `export_c`.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> "void robot_act(" in c_source(policy, "robot", number="float")["robot.h"]
    True
    """
    check_choice("number", number, NUMBERS)
    chosen = exportable(policy, copy)
    checked_name(name)
    writer = Writer(name, number, copies=chosen.copies, units=getattr(chosen, "memory", 0))
    body = _reflex(chosen, writer) if isinstance(chosen, ReflexPolicy) else _networks(chosen, writer)
    ranges = writer.array("ranges", np.array(chosen.sensors.ranges))
    title = f"Controller of the family {chosen.family!r}, trained in {chosen.steps:,} robot-steps."
    declared = writer.filled(ACT, **_described(chosen, writer))
    return writer.files(
        chosen.sensors,
        f"\n{ranges}\n{body}",
        title=title,
        unit="training",
        sizes=writer.filled(SIZES),
        declared=declared,
    )


def exportable(policy: Policy, copy: int | None) -> QPolicy | ReflexPolicy | WirePolicy:
    """Return the policy, or that of one robot, if it is of a family that can be exported."""
    check_policy(policy, "act", "arrays")
    if not isinstance(policy, QPolicy | ReflexPolicy | WirePolicy):
        families = ", ".join(family.__name__ for family in (QPolicy, ReflexPolicy, WirePolicy))
        raise InvalidValueError(f"policy is {shortened(policy)}; expected one of {families}, which can be exported")
    if not len(policy.sensors):
        raise LearningError("the policy has no proximity sensors to act on; export one that was trained with some")
    if copy is None:
        return policy
    return policy.of_robot(check_count("copy", copy, maximum=policy.copies - 1))


def place_of(path: str | os.PathLike[str]) -> tuple[str, Path]:
    """Return the name of a controller and the folder of its files, given the path of its source file."""
    file = file_at(path)
    if file.suffix != ".c":
        raise UnknownNameError(f"{shortened(file.name)} does not end with .c; give the source file such a name")
    return file.stem, file.parent


def checked_name(name: str) -> str:
    """Return a name if names in C can begin with it."""
    if not NAME.fullmatch(name) or KEYWORD.fullmatch(name):
        raise InvalidValueError(
            f"the name is {shortened(name)}; expected at most 50 small letters, digits and underscores, beginning with "
            "a letter, and no word of C"
        )
    return name


class Writer:
    """Writes C: literals, arrays, and templates in which names begin with that of the exported controller.

    Parameters
    ----------
    name : str
        Prefix of all public names.
    number : str
        One of `NUMBERS`.
    copies : int
        Sets of weights; with several the function has one more argument.
    units : int
        Values that a robot remembers; with some the function has a state as an argument.
    """

    def __init__(self, name: str, number: str, *, copies: int = 1, units: int = 0) -> None:
        self.name, self.number = name, number
        self.f, self.suffix, self.kind = NUMBERS[number]
        first = "unsigned robot, " if copies > 1 else ""
        state = f"{name}_state *state, " if units else ""
        self.words = {
            "name": name,
            "NAME": name.upper(),
            "number": number,
            "f": self.f,
            "copies": str(copies),
            "units": str(units),
            "arguments": (
                f"{first}const {name}_real *readings, const int8_t *kinds, {name}_real chance, "
                f"{state}{name}_real *wheels"
            ),
            "copy": f"robot % {copies}u" if copies > 1 else "0",
        }

    def filled(self, template: str, **more: object) -> str:
        """Return a template with the words of this controller, and others."""
        return Template(template).substitute(self.words, **{key: str(value) for key, value in more.items()})

    def files(self, sensors: SensorLayout, body: str, **of_header: str) -> dict[str, str | bytes]:
        """Return the texts of the source file with this body and of its header, by their names."""
        rows = "\n".join(
            f" *   {k}: at {bearing:g} degrees, range {reach:g}, field of view {view:g} degrees"
            for k, (bearing, reach, view) in enumerate(sensors.rows)
        )
        count = len(sensors)
        return {
            f"{self.name}.c": self.filled(SOURCE, sensors=count, body=body),
            f"{self.name}.h": self.filled(HEADER, sensors=count, sensor_rows=rows, **of_header),
        }

    def literal(self, value: float) -> str:
        """Return a number as the shortest literal that the compiler reads as this number."""
        with np.errstate(over="ignore"):
            number = self.kind(value)
        if not math.isfinite(number):
            raise LearningError(f"the weight {value:g} is beyond the range of {self.number}; export it as double")
        return f"{number!s}{self.suffix}".replace("+", "")

    def array(self, name: str, values: np.ndarray) -> str:
        """Return the definition of a constant array of this shape."""
        sides = "".join(f"[{side}]" for side in values.shape)
        return f"static const IN_FLASH {self.name}_real {name}{sides} = {self._braced(values, 1)};\n"

    def _braced(self, values: np.ndarray, depth: int) -> str:
        indent = "    " * depth
        if values.ndim > 1:
            inner = ",\n".join(indent + self._braced(row, depth + 1) for row in values)
        else:
            texts = [self.literal(value) for value in values]
            rows = [", ".join(texts[k : k + IN_A_LINE]) for k in range(0, len(texts), IN_A_LINE)]
            inner = ",\n".join(indent + row for row in rows)
        return "{\n" + inner + "\n" + "    " * (depth - 1) + "}"


HEADER = """\
/* ${title}
 *
 * Generated by mesa_swarm: C99, no memory allocation; link with the library of mathematics (-lm).
 *
 * Proximity sensors, in the order of the readings (lengths in units of the ${unit}, bearings counter-clockwise):
${sensor_rows}
 */
#ifndef ${NAME}_H
#define ${NAME}_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ${NAME}_SENSORS ${sensors}
${sizes}
typedef ${number} ${name}_real;

/* Kinds of things that a sensor sees. */
enum { ${NAME}_NOTHING = -1, ${NAME}_OBSTACLE = 0, ${NAME}_ROBOT = 1, ${NAME}_FIRE = 2, ${NAME}_LOAD = 3 };
${declared}
/* Return a number from 0 to below 1, and advance the seed, which must not be 0 (Marsaglia's xorshift, period 2^32 - 1).
 * Give each robot its own seed. */
${name}_real ${name}_chance(uint32_t *seed);

#ifdef __cplusplus
}
#endif

#endif
"""
# The beginning and the end of every source file.
SOURCE = """\
/* Generated by mesa_swarm; see ${name}.h. */
#include "${name}.h"

#include <math.h>
#include <stddef.h>

/* AVR would copy constants to RAM; GNU C (-std=gnu99) leaves them in flash. */
#ifdef __FLASH
#define IN_FLASH __flash
#else
#define IN_FLASH
#endif

#define SENSORS ${sensors}
${body}
${name}_real ${name}_chance(uint32_t *seed)
{
    uint32_t x = *seed;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    *seed = x;
    return (${name}_real)(x >> 8) / 16777216;
}
"""
SIZES = """\
#define ${NAME}_COPIES ${copies}
#define ${NAME}_MEMORY ${units}
"""
ACT = """${state}
/* Write the wheel commands, left and right, shares of the greatest speed from -1 to 1.
 *
${first} * readings: a distance from each sensor to what it sees, in the units of its range; -1 if nothing is in range.
 *     They must be finite.
 * kinds: what each sensor sees. ${of_kinds}
 * chance: a number from 0 to below 1, drawn anew in each step, such as from ${name}_chance.
 *     ${of_chance}
${of_state} */
void ${name}_act(${arguments});
"""
STATE = """
/* What a robot remembers from one step to the next. Reset it before the first step. */
typedef struct {
    ${name}_real memory[${units}];
} ${name}_state;

void ${name}_reset(${name}_state *state);
"""
# A share of the range: 1 where nothing is in range.
SHARES = """
static void write_inputs(const ${name}_real *readings, const int8_t *kinds, ${name}_real *inputs)
{
    size_t s;
    for (s = 0; s < SENSORS; s++) {
        ${name}_real share = 1;
        if (readings[s] >= 0 && ranges[s] > 0 && readings[s] < ranges[s])
            share = readings[s] / ranges[s];
        inputs[s] = share;${typed}
    }${unused}
}
"""
TYPED_SHARES = """
        inputs[SENSORS + s] = kinds[s] == ${NAME}_ROBOT;
        inputs[2 * SENSORS + s] = kinds[s] == ${NAME}_FIRE;
        inputs[3 * SENSORS + s] = kinds[s] == ${NAME}_LOAD;"""
FORWARD = """
#define INPUTS ${inputs}
#define HIDDEN ${hidden}
#define CHOICES ${choices}

${arrays}
static ${name}_real output_of(size_t m, const ${name}_real *inputs)
{
    ${name}_real output = outer_bias[m];
    size_t h, k;
    for (h = 0; h < HIDDEN; h++) {
        ${name}_real sum = inner_bias[m][h];
        for (k = 0; k < INPUTS; k++)
            sum += inner[m][k][h] * inputs[k];
        output += outer[m][h] * tanh${f}(sum);
    }
    return output;
}
"""
# The same order of additions and subtractions as in `learning.actions.chosen`.
CHOSEN = """
static size_t best_of(const ${name}_real *values)
{
    size_t a, best = 0;
    for (a = 1; a < CHOICES; a++)
        if (values[a] > values[best])
            best = a;
    return best;
}

static size_t chosen(const ${name}_real *values, ${name}_real chance)
{
    const size_t best = best_of(values);
    ${name}_real total = 0, left;
    size_t a;
    if (chance < 0)
        return best;
    for (a = 0; a < CHOICES; a++)
        total += exp${f}((values[a] - values[best]) / ${temperature});
    left = chance * total;
    for (a = 0; a < CHOICES; a++) {
        left -= exp${f}((values[a] - values[best]) / ${temperature});
        if (left < 0)
            return a;
    }
    return best;
}
"""
Q_ACT = """
${actions}
void ${name}_act(${arguments})
{
    const size_t first = CHOICES * (${copy});
    ${name}_real inputs[INPUTS], values[CHOICES];
    size_t a;
    write_inputs(readings, kinds, inputs);
    for (a = 0; a < CHOICES; a++)
        values[a] = output_of(first + a, inputs);
    a = chosen(values, chance);
    wheels[0] = actions[a][0];
    wheels[1] = actions[a][1];
}
"""
WIRE_ACT = """
/* The outputs at which a wire begins: artanh of its first wheel commands. */
${starts}
void ${name}_act(${arguments})
{
    const size_t first = 3 * CHOICES * (${copy});
    ${name}_real inputs[INPUTS], values[CHOICES];
    size_t w, side;
    write_inputs(readings, kinds, inputs);
    for (w = 0; w < CHOICES; w++)
        values[w] = output_of(first + 3 * w + 2, inputs);
    w = chosen(values, chance);
    for (side = 0; side < 2; side++)
        wheels[side] = tanh${f}(output_of(first + 3 * w + side, inputs) + starts[w][side]);
}
"""
# A proximity: 1 touching, 0 where nothing is in range.
REFLEX = """
#define UNITS ${units}
#define INPUTS ${inputs}
#define ROWS (INPUTS + UNITS + 2)

${arrays}
static ${name}_real limited(${name}_real sum)
{
    ${limit}
}
${reset}
void ${name}_act(${arguments})
{
    const size_t copy = ${copy};
    ${name}_real known[ROWS], sum;
    size_t s, k, side;
    for (s = 0; s < SENSORS; s++) {
        known[s] = 0;
        if (readings[s] >= 0 && ranges[s] > 0 && readings[s] < ranges[s])
            known[s] = 1 - readings[s] / ranges[s];${typed}
    }${unused}
    known[INPUTS + UNITS] = chance < 0 ? 0 : 2 * chance - 1;
    known[INPUTS + UNITS + 1] = 1;${remember}
    for (side = 0; side < 2; side++) {
        sum = 0;
        for (k = 0; k < ROWS; k++)
            sum += wheel[copy][k][side] * known[k];
        wheels[side] = limited(sum);
    }
}
"""
TYPED_PROXIMITIES = """
        known[SENSORS + s] = kinds[s] == ${NAME}_ROBOT ? known[s] : 0;"""
REMEMBER = """
    for (s = 0; s < UNITS; s++)
        known[INPUTS + s] = state->memory[s];
    for (s = 0; s < UNITS; s++) {
        sum = 0;
        for (k = 0; k < ROWS; k++)
            sum += hidden[copy][k][s] * known[k];
        state->memory[s] = tanh${f}(sum);
    }
    for (s = 0; s < UNITS; s++)
        known[INPUTS + s] = state->memory[s];"""
RESET = """
void ${name}_reset(${name}_state *state)
{
    size_t u;
    for (u = 0; u < UNITS; u++)
        state->memory[u] = 0;
}
"""
UNUSED = """
    (void)kinds;"""
LIMITS = {
    "linear": "return sum < -1 ? -1 : sum > 1 ? 1 : sum;",
    "threshold": "return sum > 0 ? 1 : -1;",
    "tanh": "return tanh${f}(sum);",
}


def _networks(policy: QPolicy | WirePolicy, writer: Writer) -> str:
    """Return the functions of a policy that chooses by network outputs."""
    inner, inner_bias, outer, outer_bias = policy.networks.weights
    weights = {"inner": inner, "inner_bias": inner_bias, "outer": outer, "outer_bias": outer_bias}
    choices = policy.actions if isinstance(policy, QPolicy) else policy.wires
    sizes = {"inputs": inner.shape[1], "hidden": inner.shape[2], "choices": choices}
    arrays = "\n".join(writer.array(name, values) for name, values in weights.items())
    parts = [writer.filled(FORWARD, arrays=arrays, **sizes)]
    parts += [_inputs(policy, writer), writer.filled(CHOSEN, temperature=writer.literal(policy.temperature))]
    if isinstance(policy, QPolicy):
        parts.append(writer.filled(Q_ACT, actions=writer.array("actions", ACTIONS[:choices])))
    else:
        parts.append(writer.filled(WIRE_ACT, starts=writer.array("starts", np.arctanh(STARTS[:choices]))))
    return "".join(parts)


def _inputs(policy: NetworkPolicy, writer: Writer) -> str:
    typed = policy.encoding == "typed"
    return writer.filled(
        SHARES, typed=writer.filled(TYPED_SHARES) if typed else "", unused="" if typed else writer.filled(UNUSED)
    )


def _reflex(policy: ReflexPolicy, writer: Writer) -> str:
    """Return the functions of a reflex, or of a network with recurrent units."""
    typed, units = policy.encoding == "typed", policy.memory
    arrays = [writer.array("wheel", policy.wheel), *([writer.array("hidden", policy.hidden)] if units else [])]
    return writer.filled(
        REFLEX,
        inputs=policy.wheel.shape[1] - units - 2,
        arrays="\n".join(arrays),
        limit=writer.filled(LIMITS[policy.squash]),
        reset=writer.filled(RESET) if units else "",
        typed=writer.filled(TYPED_PROXIMITIES) if typed else "",
        unused="" if typed else UNUSED,
        remember=writer.filled(REMEMBER) if units else "",
    )


def _described(policy: QPolicy | ReflexPolicy | WirePolicy, writer: Writer) -> dict[str, str]:
    """Return what the header states about a policy."""
    without = "there is no whim" if isinstance(policy, ReflexPolicy) else "the best action is taken"
    of_kinds = "Not used; may be NULL." if policy.encoding == "distance" else "Needed: the policy distinguishes kinds."
    return {
        "state": writer.filled(STATE) if getattr(policy, "memory", 0) else "",
        "first": " * robot: the number of the robot, which acts by this one of the sets of weights.\n"
        if policy.copies > 1
        else "",
        "of_kinds": of_kinds,
        "of_chance": f"With a negative one {without}.",
        "of_state": " * state: of this robot, which is changed.\n" if getattr(policy, "memory", 0) else "",
    }
