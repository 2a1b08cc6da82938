"""What the address bar holds: model, parameters, seed and step, so that a link shows the same again."""

from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, urlencode

from mesa_swarm.dashboard.session import LARGEST_SEED, Session
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError, check_choice, check_count, unknown_name
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.parameters import parameters_of
from mesa_swarm.world.map import builtin_maps

LONGEST = 4000
# A link that took longer than some seconds to open would be taken for a broken one.
MOST_STEPS = 20_000


@dataclass(frozen=True, kw_only=True)
class Address:
    """What a link asks for.

    Parameters
    ----------
    model : str
    wishes : dict
        Parameters that are not the model's defaults.
    seed, steps : int
    fault : str
        Why it does not ask for what the link says, empty if it does.
    """

    model: str
    wishes: dict[str, Any] = field(default_factory=dict)
    seed: int = 1
    steps: int = 0
    fault: str = ""


def address_from(query: str | None, first: str) -> Address:
    """Return what a link's query asks for; what is wrong with it is said, and the rest left at its default.

    Parameters
    ----------
    query : str or None
        What follows the question mark.
    first : str
        The model if it names none.

    Examples
    --------
    >>> address_from("model=fire_fighting&strategy=A&seed=7", "boids")
    Address(model='fire_fighting', wishes={'strategy': 'A'}, seed=7, steps=0, fault='')
    >>> address_from("model=fire_fihgting", "boids").fault[:59]
    "unknown model 'fire_fihgting'; did you mean 'fire_fighting'"
    """
    try:
        return _asked(dict(parse_qsl((query or "")[:LONGEST])), first)
    except SwarmError as error:
        return Address(model=first, fault=str(error))


def _asked(words: dict[str, str], first: str) -> Address:
    name = check_choice("model", words.pop("model", first), model_names())
    words.pop("token", None)
    seed = _count("seed", words.pop("seed", "1"), LARGEST_SEED)
    steps = _count("step", words.pop("step", "0"), MOST_STEPS)
    known = parameters_of(find_model(name))
    for word in words:
        if word not in known:
            raise UnknownNameError(unknown_name(f"parameter of {name}", word, known))
    # A link never names a file: whoever sends one would have this machine read it.
    wishes = {
        word: check_choice("map", text, builtin_maps()) if word == "map" else known[word].parse(text)
        for word, text in words.items()
    }
    return Address(model=name, wishes=wishes, seed=seed, steps=steps)


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
