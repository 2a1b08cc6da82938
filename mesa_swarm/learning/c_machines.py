"""State machines as C99 source for microcontrollers: the layers of states and the conditions of transitions."""

import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, LearningError, check_choice, shortened, without_middle
from mesa_swarm.base.files import write_all
from mesa_swarm.control import conditions as kinds_of
from mesa_swarm.control.approach import HEAT, Approach, Halt, Retreat
from mesa_swarm.control.avoid import Avoid
from mesa_swarm.control.conditions import Condition
from mesa_swarm.control.explore import Explore
from mesa_swarm.control.follow import Follow
from mesa_swarm.control.state_machine import StateMachine
from mesa_swarm.kernels.elementary import angles_of, directions_of
from mesa_swarm.learning.c_source import NUMBERS, Writer, checked_name, place_of
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, DesignTable, RobotDesign
from mesa_swarm.world.statics import KINDS


def export_machine(
    machine: StateMachine, design: RobotDesign, path: str | os.PathLike[str], *, number: str = "double"
) -> tuple[Path, Path]:
    """Write a state machine as C99 source for robots of a design; return the paths of the source file and its header.

    Given the same readings and chances its function ``NAME_act`` changes the state and gives the wheel commands of
    the machine, as shares of max_speed, in double precision within 1e-6; the header describes its arguments.

    Parameters
    ----------
    machine : StateMachine
        Of the layers `Approach`, `Avoid`, `Explore`, `Follow`, `Halt` and `Retreat`, without what a robot can
        know in a model only: goals that it heard, its own heat. Conditions are those of the package.
    design : RobotDesign
        With proximity sensors, and a max_speed above 0.
    path, number
        As for `export_c`.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If the machine has another layer or condition, the design another drive, or an option is not a valid one.
    LearningError
        If the design has no proximity sensors or cannot move.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm import AGENT9
    >>> machine = StateMachine({"explore": (Avoid(), Explore(turn_interval=50))})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [file.name for file in export_machine(machine, AGENT9, f"{folder}/robot.c")]
    ['robot.c', 'robot.h']
    """
    name, folder = place_of(path)
    source, header = write_all(folder, machine_source(machine, design, name, number=number))
    return source, header


def machine_source(
    machine: StateMachine, design: RobotDesign, name: str, *, number: str = "double"
) -> dict[str, str | bytes]:
    """Return the texts of the source file and its header by their names; see `export_machine`.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> files = machine_source(StateMachine({"stay": Halt()}), AGENT9, "robot")
    >>> "ROBOT_STATE_STAY" in files["robot.h"]
    True
    """
    check_choice("number", number, NUMBERS)
    checked_name(name)
    if not isinstance(machine, StateMachine):
        raise InvalidValueError(f"machine is {shortened(machine)}; expected a StateMachine")
    sensors = SensorLayout.of(design)
    if not len(sensors) or not design.max_speed > 0:
        raise LearningError(f"design {design.name} has no proximity sensors, or cannot move; use another")
    if design.numbers != 2 or design.turns is False:
        raise InvalidValueError(
            f"robots of the design {design.name} do not take the speeds of two wheels; use one with DifferentialDrive()"
        )
    return Program(machine, design, Writer(name, number)).files()


class Program:
    """The parts of the source of one machine: each function of C once, and the calls of states and transitions."""

    def __init__(self, machine: StateMachine, design: RobotDesign, writer: Writer) -> None:
        self.machine, self.design, self.writer = machine, design, writer
        self.table = DesignTable.of([design])
        self.functions: dict[str, str] = {}
        # Chances in a step: of transitions first, then one for each layer that draws.
        sources = [transition.source for transition in machine.transitions]
        self.chances = max(sources.count(name) for name in machine.state_names)
        self.turners = 0

    def files(self) -> dict[str, str | bytes]:
        """Return both files."""
        changes = [self._changes(number) for number in range(len(self.machine.state_names))]
        states = [
            f"    case {number}: /* {name} */\n{''.join(map(self._layer, layers))}        break;\n"
            for number, (name, layers) in enumerate(self.machine.states.items())
        ]
        writer = self.writer
        words = {
            "lines": len(self.design.line),
            "radiations": len(self.design.radiation),
            "chances": max(self.chances, 1),
            "turners": max(self.turners, 1),
            "functions": "".join(writer.filled(text, **self._limits) for text in self.functions.values()),
            "changes": "".join(changes),
            "states": "".join(states),
            "constants": self._constants(),
            "names": ",\n".join(f"    {writer.name.upper()}_STATE_{name}" for name in _in_c(self.machine.state_names)),
            "a_turn": writer.literal(self.design.radius / self.design.max_speed),
        }
        title = "\n *   ".join(["State machine:\n *", *_in_comment(self.machine.text()).splitlines()])
        sizes, declared = writer.filled(SIZES, **words), writer.filled(DECLARED, **words)
        body, sensors = writer.filled(BODY, **words), SensorLayout.of(self.design)
        return writer.files(sensors, body, title=title, unit="model", sizes=sizes, declared=declared)

    @property
    def _limits(self) -> dict[str, str]:
        """The numbers in functions: half, a little less than a right angle, what is left of a turn, an exponent."""
        double = self.writer.number == "double"
        values = {
            "half": 0.5,
            "sideways": 0.5 * math.pi - 1e-9,
            "rest": 1e-12 if double else 1e-6,
            "most": 700.0 if double else 80.0,
        }
        return {name: self.writer.literal(value) for name, value in values.items()}

    def _constants(self) -> str:
        """Return the tables that the functions read."""
        tables, bearings = {}, self.table.bearing[0]
        if "follow" in self.functions:
            tables["bearings"] = bearings
        if "steer_things" in self.functions:
            tables |= dict(zip(("ahead", "to_left"), directions_of(bearings), strict=True))
        if "steer_heat" in self.functions:
            azimuth = angles_of(self.table.radiation[0][:, AXIS_Y], self.table.radiation[0][:, AXIS_X])
            tables |= dict(zip(("heat_ahead", "heat_to_left"), directions_of(azimuth), strict=True))
        return "".join(self.writer.array(name, values) for name, values in tables.items())

    def _call(self, function: str, *arguments: object) -> str:
        """Return the call of a function of C, and make it and what it calls part of the source."""
        for needed in (*NEEDS.get(function, ()), function):
            self.functions.setdefault(needed, FUNCTIONS[needed])
        return f"{function}({', '.join(map(str, arguments))})"

    def _drawn(self) -> str:
        """Return the chance of one more layer that draws."""
        self.chances += 1
        return f"chances[{self.chances - 1}]"

    def _changes(self, number: int) -> str:
        """Return the case of a state with the transitions out of it."""
        own = self.machine.state_names[number]
        lines, begin = "", "        if"
        for place, transition in enumerate(t for t in self.machine.transitions if t.source == own):
            target = self.machine.state_names.index(transition.target)
            lines += f"{begin} (chances[{place}] < {self._chance_of(transition.condition)})\n"
            lines += f"            state->now = {target}; /* {transition.target}: {transition.condition.label} */\n"
            begin = "        else if"
        return f"    case {number}: /* {own} */\n{lines}        break;\n"

    def _chance_of(self, condition: Condition) -> str:
        """Return the expression of the probability of a condition."""
        number = self.writer.literal
        code, probability, *numbers = condition.row
        if code == kinds_of.OWN:
            raise InvalidValueError(
                f"condition {shortened(condition)} cannot be exported; use those of the package, such as Seen"
            )
        if code == kinds_of.ROBOTS_SEEN:
            return self._call("robots_seen", "kinds", *map(number, (probability, numbers[0], numbers[1])))
        fulfilled = {
            kinds_of.CHANCE: lambda: "1",
            kinds_of.SEEN: lambda: self._near(numbers),
            kinds_of.UNSEEN: lambda: f"!{self._near(numbers)}",
            kinds_of.ON_MARK: self._marked,
            kinds_of.OFF_MARK: lambda: f"!{self._marked()}",
            kinds_of.HEAT_SENSED: lambda: (
                self._call("is_hot", "radiation", number(numbers[0])) if self.design.radiation else "0"
            ),
        }[int(code)]()
        return f"({fulfilled} ? {number(probability)} : 0)"

    def _near(self, numbers: list[float]) -> str:
        return self._call("is_near", "readings", "kinds", int(numbers[0]), self.writer.literal(numbers[1]))

    def _marked(self) -> str:
        return self._call("on_mark", "line") if self.design.line else "0"

    def _layer(self, layer: Any) -> str:
        """Return the statement of a layer: it returns if the layer drives."""
        makers: dict[type, Callable[[Any], str]] = {
            Approach: self._steer,
            Retreat: self._steer,
            Avoid: self._avoid,
            Explore: self._explore,
            Follow: self._follow,
            Halt: lambda halt: self._call("go", "0", "wheels"),
        }
        make = makers.get(type(layer))
        if make is None:
            usable = ", ".join(sorted(layer_type.__name__ for layer_type in makers))
            raise InvalidValueError(without_middle(f"layer {shortened(layer)} cannot be exported; use {usable}"))
        return f"        if ({make(layer)})\n            return;\n"

    def _steer(self, layer: Approach | Retreat) -> str:
        sign = "1" if isinstance(layer, Approach) else "-1"
        critical = self.writer.literal(math.radians(layer.critical_angle_degrees))
        if layer.target in KINDS:
            kind = KINDS.index(layer.target)
            return self._call("steer_things", "readings", "kinds", kind, sign, critical, "wheels")
        if layer.target != HEAT:
            raise InvalidValueError(f"{layer.name} of {layer.target!r} cannot be exported: goals are heard in a model")
        return self._call("steer_heat", "radiation", sign, critical, "wheels") if self.design.radiation else "0"

    def _avoid(self, layer: Avoid) -> str:
        if layer.fires == "when hot" or layer.front == "back up":
            raise InvalidValueError(
                "Avoid with fires='when hot' or front='back up' cannot be exported; use its other options"
            )
        forward = self.table.forward[0].tolist()
        tendency = (
            f"({self._drawn()} < {self.writer.literal(0.5)} ? 1 : -1)" if layer.front == "random" else "state->side"
        )
        near = self.writer.literal(float(layer.distance))
        tests = [
            self._call("is_activated", "readings", "kinds", s, near, int(layer.fires == "always"), loads)
            if s >= 0
            else "0"
            for loads in [int(layer.loads == "always")]
            for s in forward
        ]
        inner = "-1" if layer.turn == "stationary" else "0"
        return self._call("avoid", *tests, tendency, int(layer.sides == "ignore both"), inner, "wheels")

    def _explore(self, layer: Explore) -> str:
        speed = self.writer.literal(float(layer.speed))
        if not layer.turn_interval:
            return self._call("go", speed, "wheels")
        memory = f"&state->straight[{self.turners}], &state->turn[{self.turners}]"
        self.turners += 1
        largest = self.writer.literal(math.radians(layer.largest_turn_degrees))
        return self._call("explore", memory, f"{layer.turn_interval}", largest, self._drawn(), speed, "wheels")

    def _follow(self, layer: Follow) -> str:
        number = self.writer.literal
        gap = f"HUGE_VAL{self.writer.f.upper()}" if layer.gap is None else number(float(layer.gap))
        critical = number(math.radians(layer.critical_angle_degrees))
        speeds = number(float(layer.chase_speed)), number(float(layer.cruise_speed))
        return self._call("follow", "readings", "kinds", critical, gap, *speeds, "wheels")


def _in_comment(text: str) -> str:
    """Return a text in which no comment ends or begins."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def _in_c(names: tuple[str, ...]) -> list[str]:
    """Return names of states as parts of names in C, with numbers where two would be equal."""
    plain = [re.sub(r"[^A-Z0-9]", "_", name.upper()) for name in names]
    unique: list[str] = []
    for k, plain_name in enumerate(plain):
        several = plain.count(plain_name) > 1
        name, number = f"{plain_name}_{k}" if several else plain_name, k
        while name in unique or (several and name in plain):
            number += len(names)
            name, several = f"{plain_name}_{number}", True
        unique.append(name)
    return unique


SIZES = """\
#define ${NAME}_LINE_SENSORS ${lines}
#define ${NAME}_RADIATION_SENSORS ${radiations}
#define ${NAME}_CHANCES ${chances}
"""
DECLARED = """
/* States, in the order of their numbers. */
enum {
${names}
};

/* What a robot remembers from one step to the next. Reset it before the first step. */
typedef struct {
    int now;                     /* the number of its state */
    ${name}_real side;           /* the side to which it turns from what is ahead: 1 left, -1 right */
    long straight[${turners}];   /* steps driven straight on, of layers that turn by chance, and the rest of a turn */
    ${name}_real turn[${turners}];
} ${name}_state;

/* Begin in the first state; side is 1 for left or -1 for right, drawn once for each robot. */
void ${name}_reset(${name}_state *state, int side);

/* Change the state, and write the wheel commands, left and right, shares of the greatest speed from -1 to 1.
 *
 * readings: a distance from each proximity sensor to what it sees; -1 if nothing is in range. They must be finite.
 * kinds: what each of them sees.
 * line: for each line sensor, 1 over a mark, else 0; may be NULL without such sensors.
 * radiation: what each radiation sensor reads, 0 to 1; may be NULL without such sensors.
 * chances: ${NAME}_CHANCES numbers from 0 to below 1, drawn anew in each step, such as from ${name}_chance.
 * state: of this robot, which is changed. */
void ${name}_act(const ${name}_real *readings, const int8_t *kinds, const uint8_t *line, const ${name}_real *radiation,
                 const ${name}_real *chances, ${name}_state *state, ${name}_real *wheels);
"""
BODY = """\
#define LINES ${lines}
#define RADIATIONS ${radiations}
/* The wheel speed that turns the robot by one radian in a step, as a share of the greatest. */
#define A_TURN ${a_turn}

${constants}${functions}
/* Take the first transition out of the state whose condition is fulfilled. */
static void change_state(const ${name}_real *readings, const int8_t *kinds, const uint8_t *line,
                         const ${name}_real *radiation, const ${name}_real *chances, ${name}_state *state)
{
    (void)readings;
    (void)kinds;
    (void)line;
    (void)radiation;
    (void)chances;
    switch (state->now) {
${changes}    }
}

/* Let the layers of the state decide; the first active one drives. */
static void decide(const ${name}_real *readings, const int8_t *kinds, const ${name}_real *radiation,
                   const ${name}_real *chances, ${name}_state *state, ${name}_real *wheels)
{
    (void)readings;
    (void)kinds;
    (void)radiation;
    (void)chances;
    switch (state->now) {
${states}    }
}

void ${name}_reset(${name}_state *state, int side)
{
    int k;
    state->now = 0;
    state->side = (${name}_real)side;
    for (k = 0; k < ${turners}; k++) {
        state->straight[k] = 0;
        state->turn[k] = 0;
    }
}

void ${name}_act(const ${name}_real *readings, const int8_t *kinds, const uint8_t *line, const ${name}_real *radiation,
                 const ${name}_real *chances, ${name}_state *state, ${name}_real *wheels)
{
    wheels[0] = wheels[1] = 0;
    change_state(readings, kinds, line, radiation, chances, state);
    decide(readings, kinds, radiation, chances, state, wheels);
}
"""
# The functions that a function of C calls.
NEEDS = {
    "steer_things": ("go", "turn_to", "drive_to"),
    "steer_heat": ("go", "turn_to", "drive_to"),
    "explore": ("go",),
    "follow": ("go", "turn_to"),
}
# Those that return an int return whether something is fulfilled, or whether a layer drives.
FUNCTIONS = {
    "go": """
static int go(${name}_real speed, ${name}_real *wheels)
{
    wheels[0] = wheels[1] = speed;
    return 1;
}
""",
    "turn_to": """
static int turn_to(${name}_real bearing, ${name}_real *wheels)
{
    ${name}_real rim = fabs${f}(bearing) * A_TURN;
    if (rim > 1)
        rim = 1;
    wheels[0] = bearing > 0 ? -rim : rim;
    wheels[1] = -wheels[0];
    return 1;
}
""",
    "drive_to": """
static int drive_to(${name}_real bearing, ${name}_real critical, ${name}_real *wheels)
{
    return fabs${f}(bearing) <= critical ? go(1, wheels) : turn_to(bearing, wheels);
}
""",
    "steer_things": """
static int steer_things(const ${name}_real *readings, const int8_t *kinds, int kind, int sign, ${name}_real critical,
                        ${name}_real *wheels)
{
    ${name}_real x = 0, y = 0;
    size_t s;
    for (s = 0; s < SENSORS; s++)
        if (kinds[s] == kind) {
            ${name}_real weight = 1 / (1 + readings[s]);
            x += weight * ahead[s];
            y += weight * to_left[s];
        }
    if (x == 0 && y == 0)
        return 0;
    return drive_to(atan2${f}((${name}_real)sign * y, (${name}_real)sign * x), critical, wheels);
}
""",
    "steer_heat": """
static int steer_heat(const ${name}_real *radiation, int sign, ${name}_real critical, ${name}_real *wheels)
{
    ${name}_real x = 0, y = 0;
    size_t q;
    for (q = 0; q < RADIATIONS; q++) {
        x += radiation[q] * heat_ahead[q];
        y += radiation[q] * heat_to_left[q];
    }
    if (x == 0 && y == 0)
        return 0;
    return drive_to(atan2${f}((${name}_real)sign * y, (${name}_real)sign * x), critical, wheels);
}
""",
    "follow": """
static int follow(const ${name}_real *readings, const int8_t *kinds, ${name}_real critical, ${name}_real gap,
                  ${name}_real chase, ${name}_real cruise, ${name}_real *wheels)
{
    size_t s, best = SENSORS;
    for (s = 0; s < SENSORS; s++) {
        if (kinds[s] != ${NAME}_ROBOT || fabs${f}(bearings[s]) >= ${sideways})
            continue;
        if (best == SENSORS || readings[s] < readings[best] ||
            (readings[s] == readings[best] && fabs${f}(bearings[s]) < fabs${f}(bearings[best])))
            best = s;
    }
    if (best == SENSORS)
        return 0;
    if (fabs${f}(bearings[best]) > critical)
        return turn_to(bearings[best], wheels);
    return go(readings[best] > gap ? chase : cruise, wheels);
}
""",
    "explore": """
static int explore(long *straight, ${name}_real *turn, long interval, ${name}_real largest, ${name}_real chance,
                   ${name}_real speed, ${name}_real *wheels)
{
    ${name}_real rim, left;
    if (*turn == 0 && ++*straight > interval) {
        *straight = 0;
        *turn = largest * (2 * chance - 1);
    }
    if (*turn == 0)
        return go(speed, wheels);
    rim = fabs${f}(*turn) * A_TURN;
    if (rim > 1)
        rim = 1;
    left = fabs${f}(*turn) - rim / A_TURN;
    wheels[0] = *turn > 0 ? -rim : rim;
    wheels[1] = -wheels[0];
    *turn = left <= ${rest} ? 0 : *turn > 0 ? left : -left;
    return 1;
}
""",
    "is_activated": """
static int is_activated(const ${name}_real *readings, const int8_t *kinds, size_t s, ${name}_real near, int fires,
                        int loads)
{
    return readings[s] >= 0 && readings[s] < near && (fires || kinds[s] != ${NAME}_FIRE) &&
           (loads || kinds[s] != ${NAME}_LOAD);
}
""",
    "avoid": """
static int avoid(int front, int left, int right, ${name}_real side, int ignores_both, ${name}_real inner,
                 ${name}_real *wheels)
{
    ${name}_real turn = front ? side : 0;
    if (left)
        turn = -1;
    if (right)
        turn = !(ignores_both && left) ? 1 : front ? side : 0;
    if (turn == 0)
        return 0;
    wheels[0] = turn > 0 ? inner : 1;
    wheels[1] = turn > 0 ? 1 : inner;
    return 1;
}
""",
    "robots_seen": """
static ${name}_real robots_seen(const int8_t *kinds, ${name}_real probability, ${name}_real number,
                                ${name}_real steepness)
{
    ${name}_real exponent;
    int count = 0;
    size_t s;
    for (s = 0; s < SENSORS; s++)
        count += kinds[s] == ${NAME}_ROBOT;
    exponent = steepness * (number - (${name}_real)count);
    return probability / (1 + exp${f}(exponent < ${most} ? exponent : ${most}));
}
""",
    "is_near": """
static int is_near(const ${name}_real *readings, const int8_t *kinds, int kind, ${name}_real within)
{
    size_t s;
    for (s = 0; s < SENSORS; s++)
        if (kinds[s] >= 0 && (kind < 0 || kinds[s] == kind) && readings[s] <= within)
            return 1;
    return 0;
}
""",
    "on_mark": """
static int on_mark(const uint8_t *line)
{
    size_t k;
    for (k = 0; k < LINES; k++)
        if (line[k])
            return 1;
    return 0;
}
""",
    "is_hot": """
static int is_hot(const ${name}_real *radiation, ${name}_real limit)
{
    size_t q;
    for (q = 0; q < RADIATIONS; q++)
        if (radiation[q] > limit)
            return 1;
    return 0;
}
""",
}
