"""What the address bar holds: model, parameters, seed and step, so that a link shows the same again."""

from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, urlencode

from mesa_swarm.dashboard.session import Session
from mesa_swarm.dashboard.wishes import LARGEST_SEED, checked_wish
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError, check_choice, check_count, unknown_name
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.parameters import Parameter, parameters_of
from mesa_swarm.world.map import builtin_maps

LONGEST = 4000
# A link that took longer than some seconds to open would be taken for a broken one.
MOST_STEPS = 20_000
COUNTS = {"seed": LARGEST_SEED, "step": MOST_STEPS}
MOST_FAULTS = 5


@dataclass(frozen=True, kw_only=True)
class Address:
    """What a link asks for.

    Parameters
    ----------
    model : str
    wishes : dict
        Parameters that are not the model's defaults.
    seed, steps : int
    faults : tuple of str
        Why it does not ask for all that the link says, empty if it does.
    """

    model: str
    wishes: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    steps: int = 0
    faults: tuple[str, ...] = ()


def address_from(query: str | None, first: str) -> Address:
    """Return what a link's query asks for; each word that is wrong is told of, and left out.

    Parameters
    ----------
    query : str or None
        What follows the question mark.
    first : str
        The model if it names none.

    Examples
    --------
    >>> address_from("model=fire_fighting&strategy=A&seed=7", "boids")
    Address(model='fire_fighting', wishes={'strategy': 'A'}, seed=7, steps=0, faults=())
    >>> address_from("model=fire_fighting&strategie=A&seed=7", "boids").faults[0][:67]
    "unknown parameter of fire_fighting 'strategie'; did you mean 'strat"
    """
    words = dict(parse_qsl((query or "")[:LONGEST]))
    words.pop("token", None)
    try:
        name = check_choice("model", words.pop("model", first), model_names())
    except SwarmError as error:  # of a model that nobody knows the other words mean nothing
        return Address(model=first, faults=(str(error),))
    known, values, faults = parameters_of(find_model(name)), {}, []
    for word, text in words.items():
        try:
            values[word] = _value(name, known, word, text)
        except SwarmError as error:
            faults.append(str(error))
    seed, steps = values.pop("seed", 1), values.pop("step", 0)
    return Address(model=name, wishes=values, seed=seed, steps=steps, faults=_first_few(faults))


def _value(model: str, known: dict[str, Parameter], word: str, text: str) -> Any:
    """Return what one word of a link asks for."""
    if word in COUNTS:
        return _count(word, text, COUNTS[word])
    if word not in known:
        raise UnknownNameError(unknown_name(f"parameter of {model}", word, known))
    # A link never names a file: whoever sends one would have this machine read it.
    return check_choice("map", text, builtin_maps()) if word == "map" else checked_wish(known[word], text)


def _first_few(faults: list[str]) -> tuple[str, ...]:
    more = len(faults) - MOST_FAULTS
    return (*faults[:MOST_FAULTS], f"and {more} more") if more > 0 else tuple(faults)


def _count(name: str, text: str, most: int) -> int:
    try:
        return check_count(name, int(text), maximum=most)
    except ValueError as error:
        known = isinstance(error, InvalidValueError)
        raise InvalidValueError(str(error) if known else f"{name} is {text!r:.60}; expected a whole number") from None


def query_of(session: Session) -> str:
    """Return the query of a link that shows what a session shows, but for uploaded maps.

    What was changed during the run is in it as if it had been so from the start.

    Examples
    --------
    >>> query_of(Session("fire_fighting", {"strategy": "A"}, seed=7))
    'model=fire_fighting&strategy=A&seed=7'
    """
    words = {"model": session.name}
    for name, parameter in session.parameters.items():
        value = session.wishes[name]
        if value != parameter.default and value not in session.uploads:
            words[name] = repr(value) if isinstance(value, float) else str(value)
    words["seed"] = str(session.seed)
    shown = session.past.shown
    if shown and session.straight and not session.playing and not session.waiting and 0 < shown.step <= MOST_STEPS:
        words["step"] = str(shown.step)
    return urlencode(words)
