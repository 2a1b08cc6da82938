"""Map files of the thesis: their contents, and that nothing in them is ever run."""

import warnings

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm.base.errors import MapError, MapWarning
from mesa_swarm.maps.map import FireSpot, Map, read_legacy
from mesa_swarm.world.shapes import disc, rectangle
from support.pace import work_within

ORIGINAL = """[
    Obstacle("rec", [[0, 0], [20, 600]]),
    Obstacle("rec", [[0, 0], [800, 20]]),
    Obstacle("rec", [[780, 0], [800, 600]]),
    Obstacle("rec", [[0, 580], [800, 600]]),
    Obstacle("rec", [[70, 70], [110, 530]]),
    Obstacle("rec", [[110, 280], [400, 320]]),
    Obstacle("rec", [[220, 0], [260, 150]]),
    Obstacle("rec", [[480, 0], [520, 500]]),
    Obstacle("cir", [[650, 160], 30]),
    Obstacle("cir", [[650, 360], 30]),
    Obstacle("cir", [[300, 450], 50]),
]
"""


def read(text):
    """Return the map that a legacy text describes."""
    return Map(**read_legacy(text, "hall.map", "hall"))


def test_the_thesis_map_reads_as_the_built_in_one(tmp_path):
    path = tmp_path / "original.map"
    path.write_text(ORIGINAL)
    assert Map.load(path) == Map.load("original")


PRINTED = {
    "assigned to a name": f"map = {ORIGINAL}",
    "without spaces": f"map={ORIGINAL}".replace(" ", ""),
    "without a last comma": f"map = {ORIGINAL}".replace("),\n]", ")\n]"),
    "lines alone, indented": ORIGINAL[1:-2],
    "lines alone, no commas": ORIGINAL[1:-2].replace("),\n", ")\n"),
    "quotation marks of print": f"map = {ORIGINAL}".replace('("', "(\u201c").replace('",', "\u201d,"),
    "single ones": f"map = {ORIGINAL}".replace('("', "(\u2018").replace('",', "\u2019,"),
    "spaces of print": f"map = {ORIGINAL}".replace(" ", "\xa0"),
    "lines of Windows": f"map = {ORIGINAL}".replace("\n", "\r\n"),
    "lines of old Macs": f"  map = {ORIGINAL}".replace("\n", "\r"),
    "a byte order mark": f"\ufeffmap = {ORIGINAL}",
}


@pytest.mark.parametrize("text", PRINTED.values(), ids=PRINTED)
def test_the_listing_loads_as_it_is_printed_and_copied(tmp_path, text):
    path = tmp_path / "original.map"
    path.write_bytes(text.encode())
    assert Map.load(path) == Map.load("original")


WITHOUT_END = {
    "as printed": f"map = {ORIGINAL}".removesuffix("]\n"),
    "without its last comma": f"map = {ORIGINAL}".removesuffix(",\n]\n"),
    "a bare list": ORIGINAL.removesuffix("]\n"),
    "with a remark after it": ORIGINAL.removesuffix("]\n") + "# [the end",
    "after a list that ends": ORIGINAL.removesuffix("]\n").replace("]),\n", "])]\nrest = [\n", 1),
}


@pytest.mark.parametrize("text", WITHOUT_END.values(), ids=WITHOUT_END)
def test_the_listing_loads_without_its_closing_bracket_too_with_one_warning(tmp_path, text):
    path = tmp_path / "original.map"
    path.write_text(text)
    with pytest.warns(MapWarning) as caught:
        assert Map.load(path) == Map.load("original")
    (warning,) = caught
    opened = 1 + text[: text.rindex("[\n")].count("\n")
    assert (warning.filename, warning.lineno) == (str(path), opened)
    message = str(warning.message)
    assert len(message) <= 300
    assert message.endswith(
        f"original.map: line {opened}: '[' is never closed; read as if ']' stood at the end of the file, which has 11 "
        "obstacles and 0 fires: add it there, and check that none is missing"
    )


@pytest.mark.parametrize(
    "end", ["[", "(", "Obstacle(", "Obstacle('cir', [[5, 5], 2]", "Obstacle('cir', [[5, 5], 2", "9"]
)
def test_a_list_that_breaks_off_within_a_body_is_refused(end):
    with pytest.raises(MapError, match="line"):
        read(f"map = [\n  Obstacle('rec', [[0, 0], [9, 9]]),\n  {end}")


@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_no_other_bracket_may_be_missing(cut):
    """Brackets are left out one by one, from the outermost end of the last body inwards."""
    whole = "map = [\n  Obstacle('rec', [[0, 0], [9, 9]])\n]"
    ends = [place for place, letter in enumerate(whole) if letter in "])"][::-1]
    text = whole[: ends[cut]] + whole[ends[cut] + 1 :]
    with pytest.raises(MapError, match="line 2"):
        read(text)
    with pytest.raises(MapError, match="line"):
        read(text.removesuffix("\n]"))


def test_a_mistake_in_an_indented_listing_is_named_by_its_line():
    right, wrong = "Obstacle(\u201crec\u201d, [[0, 0], [20, 600]])", "Obstacle(\u201crec\u201d, [[0, 0], [9]])"
    with pytest.raises(MapError, match="line 3: rec has 3 numbers"):
        read(f"map = [\r\n    {right},\r\n    {wrong}]")


def test_fires_are_read_and_y_is_turned_up():
    text = '[Obstacle("rec", [[0, 0], [100, 50]]), Obstacle("fire", [[20, 10], 5]), Fire([[30, 40], 6])]'
    hall = read(text)
    assert hall.obstacles == (rectangle((0, 0), (100, 50)),)
    assert hall.fires == (FireSpot((20, 40), 5), FireSpot((30, 10), 6))


def test_flat_lists_signs_floats_and_bare_calls_are_tolerated():
    hall = read('Obstacle("rec", [0, 0, 1e2, 50.0])\nObstacle("cir", ((-4, 10), 5))')
    assert hall.obstacles == (rectangle((0, 0), (100, 50)), disc((-4, 40), 5))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no obstacles"),
        ("[]", "no obstacles"),
        ("[\n\nObstacle('rec', [[0, 0], [9, 9]]", "line 3"),
        (
            "[\n\n  Obstacle('rex', [[0, 0], [9, 9]])]",
            "line 3: unknown kind of obstacle 'rex'; did you mean 'rec'",
        ),
        ("[\n  Obstacle('rec', [[0, 0], [9]])]", "line 2: rec has 3 numbers"),
        ("[\n  Obstacle('cir', [[0, 0], -9])]", "line 2: radius is -9"),
        ("[Obstacle('rec', [[0, 0], [9, 9]]), Obstacle('cir', [[5, 5], 0])]", "line 1: radius is 0"),
        ("[Obstacle('rec', [[0, 0], [0, 9]]), Obstacle('cir', [[5, 5], 1])]", "no area"),
        ("[Obstacle('rec', [[0, 0], [9, 1e999]])]", "inf"),
        ("[Obstacle('rec', [[0, 0], [9, 2e9]])]", "coordinate is 2e+09"),
        ("[Obstacle('rec', [[0, 0], [9, nan]])]", "plain numbers"),
        ("[Obstacle('rec', [[0, 0], [9, True]])]", "coordinate is True"),
        ("[Obstacle('rec', [[0, 0], [9, '9']])]", "coordinate is '9'"),
        ("[Obstacle('rec', [[0, 0], [9, 3 + 4j]])]", "plain numbers"),
        ("[Obstacle('rec', [[0, 0], [9, 9 * 9]])]", "plain numbers"),
        ("[Obstacle('rec', *[[[0, 0], [9, 9]]])]", "plain numbers"),
        ("[Obstacle('rec', corners=[[0, 0], [9, 9]])]", "expected Obstacle"),
        ("[Obstacle('rec', [[0, 0], [9, 9]]), Obstacle('cir', [[-50, 5], 3])]", "lies outside"),
        ("[Wall('rec', [[0, 0], [9, 9]])]", "expected Obstacle"),
        ("[5]", "expected Obstacle"),
        ("import os", "expected a list"),
        ("x = y = [Obstacle('rec', [[0, 0], [9, 9]])]", "expected a list"),
        ("x.y = [Obstacle('rec', [[0, 0], [9, 9]])]", "expected a list"),
        ("x = Obstacle('rec', [[0, 0], [9, 9]])", "expected a list"),
        ("map = (\n  Obstacle('rec', [[0, 0], [9, 9]]),", "line 1: '(' was never closed"),
        ("map = [[\n  Obstacle('rec', [[0, 0], [9, 9]])]", "line 1: expected Obstacle"),
        ("map = walls[\n  Obstacle('rec', [[0, 0], [9, 9]])", "line 1: '[' was never closed"),
        ("map = [", "no obstacles"),
        ("\0", "hall.map"),
        ("[" * 100_000, "hall.map"),
        ("[Obstacle('rec', " + "[" * 150 + "]" * 150 + ")]", "plain numbers"),
        ("-" * 100_000 + "1", "too deeply"),
        ("a" + ".a" * 100_000, "too deeply"),
        ("1" + "+1" * 70_000, "too deeply"),
        ("[" + "1," * 100_000 + "]", "words, brackets and lines; expected at most 150,000"),
        ("9" * 5000, "hall.map"),
        ("f'" + "".join(f"{{a{i}}}xxxxxxxxxxxx" for i in range(36_000)) + "'", "begins with f"),
        ("\n\n  t'x'", "line 3: has a string that begins with t"),
        ("\n['', F'x']", "line 2: has a string that begins with F"),
        ('# it\'s\n[Rf"""' + "{a}x\n" * 20_000 + '"""]', "line 2: has a string that begins with Rf"),
        ("#" * 1_000_001, "more than"),
    ],
    ids=lambda value: value[:40],
)
def test_a_wrong_legacy_map_is_refused_within_a_second_on_one_line(text, reason):
    with work_within(1), pytest.raises(MapError) as error:
        read(text)
    assert str(error.value).startswith("hall.map: ")
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_the_map_spans_to_the_far_corner_of_all_bodies_whichever_corner_is_given_first():
    boxes = "[Obstacle('rec', [[70, 9], [3, 40]]), Obstacle('cir', [[20, 30], 15]), Fire([[60, 20], 12])]"
    assert read(boxes).bounds == (0, 0, 72, 45)
    assert read(boxes).obstacles[0] == rectangle((3, 5), (70, 36))
    assert read("[Fire([[10, 20], 5])]").bounds == (0, 0, 15, 25)


def test_letters_before_quotes_in_remarks_and_strings_are_no_prefixes():
    text = """# the shelf 'f"' of"
    [Obstacle(u'rec', [[0, 0], [9, 9]]), Obstacle(r\"\"\"cir\"\"\", [[5, 5], 2])]  # f'{x}'"""
    assert len(read(text.replace("\n    ", "\n")).obstacles) == 2


@pytest.mark.parametrize(
    "attack",
    [
        "__import__('os').system('touch {}')",
        "[__import__('os').system('touch {}')]",
        "[Obstacle('rec', [[0, 0], [9, __import__('os').system('touch {}')]])]",
        "[Obstacle(__import__('os').system('touch {}'), [[0, 0], [9, 9]])]",
        "[(lambda: open('{}', 'w'))()]",
        "[Obstacle('rec', [[0, 0], [9, 9]]) for _ in [open('{}', 'w')]]",
    ],
)
def test_code_in_a_legacy_map_is_refused_and_never_run(tmp_path, attack):
    victim, path = tmp_path / "victim", tmp_path / "hall.map"
    path.write_text(attack.format(victim))
    with pytest.raises(MapError, match="line 1"):
        Map.load(path)
    assert not victim.exists()


@settings(deadline=None)
@given(st.text(max_size=60) | st.text("[](),Obstacle\"'rec0123 .-", max_size=60))
def test_any_text_is_a_map_or_a_map_error(text):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MapWarning)  # of a list that is not closed
            read(text)
    except MapError as error:
        assert "\n" not in str(error)
