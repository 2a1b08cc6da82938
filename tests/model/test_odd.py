"""Descriptions of models by the ODD protocol: seven elements, in their order, made of the models themselves."""

import re

import pytest

from mesa_swarm import AGENT9, Field, SwarmModel, cli, model_info
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.gallery import gallery_names
from mesa_swarm.model.info import CONCEPTS as TEXTS
from mesa_swarm.model.odd import CONCEPTS, odd

ELEMENTS = [
    "1. Purpose and patterns",
    "2. Entities, state variables, and scales",
    "3. Process overview and scheduling",
    "4. Design concepts",
    "5. Initialization",
    "6. Input data",
    "7. Submodels",
]


def sections(text: str) -> dict[str, str]:
    """Return the elements of a description by their headings."""
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


class Meadow(SwarmModel):
    """Robots on a meadow."""

    def __init__(self, *, n_robots: int = 7, rng=None):
        super().__init__(map="sparse", rng=rng, model_reporters={"hits": "total_collisions"})
        self.add_field(Field("grass", cell=20.0))
        self.state["eaten"] = 0
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=11), Explore())


class Needy(SwarmModel):
    """A model that has no defaults."""

    def __init__(self, *, n_robots: int, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, n_robots)


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_every_model_of_the_gallery_has_the_seven_elements_its_patterns_and_texts_on_concepts(name):
    info = model_info(name)
    found = sections(odd(info))
    assert list(found) == ELEMENTS
    assert all(text.strip() for text in found.values())
    assert info.patterns in found[ELEMENTS[0]]
    assert {"principles", "emergence", "adaptation", "interaction", "collectives"} <= set(info.concepts)
    for key in (*info.concepts, "sensing", "stochasticity", "observation"):
        assert f"**{CONCEPTS[key]}.**" in found[ELEMENTS[3]]
    for parameter in info.parameters:
        assert parameter == "rng" or f"| `{parameter}` |" in found[ELEMENTS[4]]
    assert all(one.latex in found[ELEMENTS[6]] for one in info.equations)
    assert all(one.code in found[ELEMENTS[6]] for one in info.code)


def test_a_description_follows_the_model():
    found = sections(odd(model_info(Meadow)))
    assert "| robot `AGENT9`: radius 5, at most 1 units a step | 7 |" in found[ELEMENTS[1]]
    assert "| field `grass` | 30 x 40 cells |" in found[ELEMENTS[1]]
    assert "`eaten`" in found[ELEMENTS[1]]
    assert re.search(r"- `Avoid\(distance=11, .*\n- `Explore\(", found[ELEMENTS[2]])
    assert "`hits`" in found[ELEMENTS[3]]
    assert "`sparse`" in found[ELEMENTS[4]]
    assert "`sparse`" in found[ELEMENTS[5]]


def test_a_model_without_defaults_is_refused_in_one_line():
    with pytest.raises(InvalidValueError, match="cannot be built without parameters"):
        odd(model_info(Needy))


def test_every_concept_is_found_or_written():
    assert set(TEXTS) | {"sensing", "stochasticity", "observation"} == set(CONCEPTS)


def test_the_command_prints_it(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["info", "boids", "--odd"])
    assert end.value.code == 0
    assert list(sections(capsys.readouterr().out)) == ELEMENTS
