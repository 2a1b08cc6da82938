"""What one user compares: a model under two values of one parameter, in two worlds and over many seeds."""

from typing import Any

from mesa_swarm.dashboard.many_runs import ManyRuns
from mesa_swarm.dashboard.pair import NAMES, Pair
from mesa_swarm.dashboard.readings import in_words
from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.wishes import LARGEST_SEED, checked_wish
from mesa_swarm.errors import InvalidValueError, check_choice, check_count
from mesa_swarm.experiments.plan import DEFAULT_STEPS, Plan, checked_plan
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.parameters import Choice, Parameter, Slider, parameters_of

FEWEST_SEEDS, MOST_SEEDS, USUAL_SEEDS = 2, 1000, 30
MOST_STEPS = 200_000


class Comparing:
    """A pair of worlds that differ in one parameter, and what comes of it over many seeds.

    All other parameters are those that are set for the same model on the page where one world is watched.

    Parameters
    ----------
    session : Session
        Of whoever compares; its model and seed are taken to begin with.

    Attributes
    ----------
    pair : Pair
    runs : ManyRuns
    name, parameter : str
        The model, and what is different in the two worlds.
    values : list of two
    seed, seeds, steps : int
        Seed of the two worlds; how many seeds are compared, for how many steps each.
    faults : dict of str
        What is wrong with what was asked for, by "A", "B", "seed", "seeds", "steps" or "runs".
    built : dict
        What the two worlds were built from.

    Examples
    --------
    >>> comparing = Comparing(Session("fire_fighting"))
    >>> comparing.parameter, comparing.values
    ('strategy', ['A', 'B'])
    >>> comparing.close()
    """

    def __init__(self, session: Session) -> None:
        self.session = session
        self.pair, self.runs = Pair(), ManyRuns()
        self.pair.set_speed(session.own_speed)
        self.seed, self.seeds = session.seed, USUAL_SEEDS
        self.faults: dict[str, str] = {}
        self.choose_model(session.name)

    @property
    def choices(self) -> dict[str, Parameter]:
        """The parameters that can be compared, by name."""
        known = self.parameters.values()
        return {one.name: one for one in known if one.name == "map" or isinstance(one.control, (Choice, Slider))}

    @property
    def settings(self) -> dict[str, Any]:
        """All parameters that are not the model's defaults, but for the one that is compared."""
        session = self.session
        if session.name != self.name:
            return {}
        wished = {name: value for name, value in session.wishes.items() if value != self.parameters[name].default}
        wished.pop(self.parameter, None)
        return {name: self._meant(name, value) for name, value in wished.items()}

    @property
    def waiting(self) -> frozenset[str]:
        """Of "A", "B" and "seed" those that will be as wished only after a reset."""
        return frozenset(name for name, value in self._wished().items() if self.built.get(name) != value)

    def choose_model(self, name: str) -> None:
        """Compare another model, in what it says of itself that is worth comparing."""
        self.name = check_choice("model", name, model_names())
        self.model_class = find_model(name)
        self.parameters = parameters_of(self.model_class)
        self.steps = min(getattr(self.model_class, "steps_to_compare", DEFAULT_STEPS), MOST_STEPS)
        self.choose_parameter(getattr(self.model_class, "compares", (None,))[0] or next(iter(self.choices)))

    def choose_parameter(self, name: str) -> None:
        """Compare another parameter, and build both worlds."""
        self.parameter = check_choice("parameter", name, self.choices)
        self.values = two_values(self.model_class, self.choices[name], self.session.map_names())
        self.faults = {}
        self.reset()

    def wish(self, side: str, value: Any) -> None:
        """Wish for a value in world A or B, from the next reset on."""
        try:
            self.values[NAMES.index(side)] = self._checked(value)
            self.faults.pop(side, None)
        except Exception as problem:  # what is wrong with a wish is said beside it
            self.faults[side] = in_words(problem)
        self.pair.changed.tell()

    def set_count(self, name: str, text: str | int) -> None:
        """Set the "seed" of the two worlds, how many "seeds" are compared, or the "steps" of each run."""
        low, high = {"seed": (0, LARGEST_SEED), "seeds": (FEWEST_SEEDS, MOST_SEEDS), "steps": (1, MOST_STEPS)}[name]
        try:
            setattr(self, name, check_count(name, _whole(name, text), minimum=low, maximum=high))
            self.faults.pop(name, None)
        except InvalidValueError as problem:
            self.faults[name] = str(problem)
        self.pair.changed.tell()

    def reset(self) -> None:
        """Stop, and build both worlds as wished."""
        self.built, models = self._wished(), (None, None)
        self.faults.pop("worlds", None)
        try:
            models = self._models()
        except Exception as problem:  # whatever a model raises is shown, or the page would be dead
            self.faults["worlds"] = in_words(problem)
        self.pair.place(*models)

    def plan(self) -> Plan:
        """Return what the comparison over many seeds will do.

        Raises
        ------
        SwarmError
            If it cannot be done.
        """
        values = [self._meant(self.parameter, value) for value in self.values]
        return checked_plan(
            self.model_class, self.parameter, values, self.seeds, steps=self.steps, settings=self.settings
        )

    def start(self) -> None:
        """Begin to compare over many seeds, in the background."""
        self.pair.pause()
        try:
            self.runs.start(self.plan())
            self.faults.pop("runs", None)
        except Exception as problem:  # as in `reset`
            self.faults["runs"] = in_words(problem)
        self.pair.changed.tell()

    def close(self) -> None:
        """Stop everything, and let go of it."""
        self.runs.close()
        self.pair.close()

    def _wished(self) -> dict[str, Any]:
        first, second = self.values
        return {"A": first, "B": second, "seed": self.seed}

    def _models(self) -> tuple:
        settings = self.settings
        return tuple(
            self.model_class(**settings, **{self.parameter: self._meant(self.parameter, value)}, rng=self.seed)
            for value in self.values
        )

    def _meant(self, name: str, value: Any) -> Any:
        """Return an uploaded map for its name."""
        return self.session.uploads.get(value, value) if name == "map" else value

    def _checked(self, value: Any) -> Any:
        parameter = self.choices[self.parameter]
        if parameter.name == "map":
            return check_choice("map", value, self.session.map_names())
        return checked_wish(parameter, value)


def two_values(model_class: type, parameter: Parameter, maps: list[str]) -> list:
    """Return two values of a parameter that are worth comparing.

    Those that the model names; else the first two of a list, or the default and the end of the slider farther away.

    Examples
    --------
    >>> two_values(object, Parameter("share", 0.75, float, Slider(0, 1, 0.1)), [])
    [0.75, 0.0]
    """
    named, values = getattr(model_class, "compares", (None, ()))
    if parameter.name == named and len(values) >= 2:
        return list(values[:2])
    control = parameter.control
    if isinstance(control, Slider):
        default, slider = parameter.default, control
        ends = sorted((slider.minimum, slider.maximum), key=lambda end: -abs(end - default))
        return [default, parameter.kind(ends[0])]
    options = list(control.options) if isinstance(control, Choice) and parameter.name != "map" else maps
    return (options * 2)[:2]


def _whole(name: str, text: str | int) -> int:
    try:
        return int(text)
    except ValueError:
        raise InvalidValueError(f"{name} is {text!r:.60}; expected a whole number") from None
