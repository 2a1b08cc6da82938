"""Hostile map files: each is read or refused in one line, within limits, and what was read can be used."""

import codecs
import encodings.aliases
import itertools
import re

import numpy as np
import pytest

from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.base.errors import MapError, SwarmError
from mesa_swarm.maps.map import Map, builtin_maps
from support.hostile import attack

pytestmark = pytest.mark.slow

CPU = 2
USE = 6
MEMORY = 500
UPLOAD = 1_000_000
SIZE = 100.0
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100">'
TOML = 'name = "a"\nwidth = 100\nheight = 100\n'
EXTREMES = (
    *("0", "-0", "1e308", "-1e308", "1e309", "1e-320", "5e-324", "1e9", "1.0000001e9", "1e15", "-1", "1e12", "inf"),
    *("nan", "NaN", "9" * 400, "0." + "1" * 400, "1e", "--1", "1e+", ".", "1e-9", "99999999999999999999", "50%", "1mm"),
)


def drawn(content):
    return f"{HEAD}{content}</svg>".encode()


def pairs(points):
    return " ".join(f"{x:.5g},{y:.5g}" for x, y in points)


def lists(points):
    return "[" + ", ".join(f"[{x:.5g}, {y:.5g}]" for x, y in points) + "]"


def scattered(n, seed):
    return np.random.default_rng(seed).random((n, 2)) * SIZE


def comb(n):
    """Return the corners of slanted teeth: all boxes of edges overlap, no edges cross."""
    x = np.linspace(1, 40, n)
    low, high = np.column_stack([x, np.full(n, 1.0)]), np.column_stack([x + 50, np.full(n, 95.0)])
    teeth = np.stack([low, high], axis=1)
    teeth[1::2] = teeth[1::2, ::-1]
    return teeth.reshape(-1, 2)


def star(n):
    azimuth = np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = np.where(np.arange(n) % 2, 5.0, 45.0)
    return 50 + radius[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])


def spiral(n, turns):
    azimuth = np.linspace(0, turns * 2 * np.pi, n)
    radius = 2 + 40 * azimuth / azimuth[-1]
    return 50 + radius[:, None] * np.column_stack([np.cos(azimuth), np.sin(azimuth)])


def zigzag(n):
    return np.column_stack([np.linspace(0, SIZE, n), 50 + 5 * (-1.0) ** np.arange(n)])


def squares(n, nested):
    if nested:
        return [(i * 49 / n, SIZE - i * 49 / n) for i in range(n)]
    side = SIZE / np.ceil(np.sqrt(n))
    return [(i, i + side / 2) for i in np.linspace(0, SIZE - side, n)]


def lines():
    """Yield names and corners, from the issue and beyond."""
    for n in (500, 1000, 2000, 20_000, 60_000):
        yield f"scattered {n}", scattered(n, n)
    for n in (100, 1000, 5000, 20_000):
        yield f"comb {n}", comb(n)
        yield f"star {n}", star(n)
        yield f"zigzag {n}", zigzag(n)
        yield f"spiral {n}", spiral(n, n / 100)
    yield "back and forth", np.tile([(1.0, 1.0), (99.0, 99.0)], (10_000, 1))
    yield "collinear", np.column_stack([np.random.default_rng(1).random(20_000) * SIZE, np.full(20_000, 50.0)])


def svg_attacks():
    for name, corners in lines():
        text = pairs(corners)
        yield f"polygon {name}", drawn(f'<polygon points="{text}"/>')
        yield f"filled polyline {name}", drawn(f'<polyline points="{text}"/>')
        for width in ("0.001", "3", "90", "1e9", "1e308"):
            yield f"band {name} {width}", drawn(f'<polyline fill="none" stroke-width="{width}" points="{text}"/>')
        yield f"path {name}", drawn(f'<path fill="none" stroke-width="1" d="M{text}"/>')
        transform = 'transform="rotate(33) scale(1e-3 1e3) skewX(60)"'
        yield f"moved {name}", drawn(f'<polyline {transform} fill="none" points="{text}"/>')
    for shape in (
        '<circle cx="5" cy="5" r="1"/>',
        '<rect x="5" y="5" width="9" height="9"/>',
        '<rect x="5" y="5" width="9" height="9" rx="2"/>',
        '<ellipse cx="5" cy="5" rx="1" ry="2"/>',
        '<line x1="1" y1="1" x2="9" y2="9"/>',
        '<polygon points="1,1 9,9 1,9"/>',
        '<polyline fill="none" points="1,1 9,9 1,9 5 5 7 1 3 3"/>',
        '<path d="M1 1h9v9z"/>',
        '<path d="M1 1a9 9 0 1 1 9 9z"/>',
        '<path d="M1 1c9 9 0 11 9 9q3 3 9 1z"/>',
        '<circle class="fire" cx="5" cy="5" r="1"/>',
        '<g transform="scale(1)"/>',
    ):
        few = min(UPLOAD // len(shape) - 5, 9_990)
        yield f"many {shape}", drawn(shape * few)
        yield f"one path of many {shape}", drawn("".join(re.findall("<path.*", shape * few)))
    for n in (100, 1000, 1999):
        for nested in (True, False):
            rings = "".join(f"M{a:g},{a:g} {b:g},{a:g} {b:g},{b:g} {a:g},{b:g}Z" for a, b in squares(n, nested))
            yield f"{n} squares, nested: {nested}", drawn(f'<path fill-rule="evenodd" d="{rings}"/>')
            yield f"{n} squares, non-zero, nested: {nested}", drawn(f'<path d="{rings}"/>')
    rings = "".join("M" + pairs(comb(2000) + np.array([i / 100, 0])) + " 99,99 0,99Z" for i in range(10))
    yield "combs across combs", drawn(f'<path fill-rule="evenodd" d="{rings}"/>')
    yield "words of a path", drawn(f'<path d="M0 0{"h1v1" * 9_900}z"/>')
    yield "arcs", drawn(f'<path d="M0 0{"a9 9 0 0 1 9 9" * 5_000}z"/>')
    yield "large curves", drawn(f'<path d="M0 0{"c9e6 9e6 0 9e6 1 1" * 5_000}z"/>')
    for n in EXTREMES:
        yield from svg_extremes(n)
    yield from xml_attacks()


def svg_extremes(n):
    for name in ("rotate", "skewX", "skewY", "scale", "translate"):
        yield f"{name}({n})", drawn(f'<rect width="9" height="9" transform="{name}({n})"/>')
        yield f"circle {name}({n})", drawn(f'<circle r="9" transform="{name}({n})"/>')
    yield f"matrix {n}", drawn(f'<rect width="9" height="9" transform="matrix({n} 1 2 {n} 0 {n})"/>')
    yield f"stroke {n}", drawn(f'<line x2="9" y2="5" stroke-width="{n}"/>')
    yield f"line {n}", drawn(f'<line x1="{n}" x2="9" y2="5"/>')
    yield f"band {n}", drawn(f'<polyline fill="none" points="{n} 0 1 1 {n} {n} 5 5"/>')
    yield f"polygon {n}", drawn(f'<polygon points="{n} 0 1 1 {n} {n} 5 5"/>')
    yield f"radius {n}", drawn(f'<circle r="{n}"/><ellipse rx="{n}" ry="3"/>')
    yield f"rect {n}", drawn(f'<rect x="{n}" width="{n}" height="{n}" rx="{n}"/>')
    yield f"curve {n}", drawn(f'<path d="M0 0C{n} 1 1 {n} 5 5Q{n} {n} 1 1A{n} 1 {n} 0 1 5 {n}z"/>')
    for box in (f"0 0 {n} {n}", f"{n} {n} 5 5", f"0 0 {n} 1"):
        yield f"view box {box}", f'<svg width="9" height="9" viewBox="{box}"><circle r="1"/></svg>'.encode()
    shape = '<ellipse rx="1" ry="2"/><rect width="1" height="1" rx=".1"/><path d="M0 0q1 1 2 0z"/><line x2="1"/>'
    yield f"size {n}", f'<svg width="{n}" height="{n}">{shape}</svg>'.encode()
    yield f"bounds {n}", f'<svg width="9" height="9" data-bounds="{n} {n} {n} {n}">{shape}</svg>'.encode()


def xml_attacks():
    entities = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 10))
    yield "laughs", f'<!DOCTYPE svg [<!ENTITY a0 "ha">{entities}]>{HEAD}&a9;</svg>'.encode()
    yield "blow-up", f'<!DOCTYPE svg [<!ENTITY a "{"a" * 400_000}">]>{HEAD}{"&a;" * 100_000}</svg>'.encode()
    yield "external", b'<!DOCTYPE svg SYSTEM "file:///etc/passwd"><svg/>'
    yield "parameter entity", b'<!DOCTYPE svg [<!ENTITY % a SYSTEM "file:///etc/passwd"> %a;]><svg/>'
    yield "deep", (HEAD + "<g>" * 300_000).encode()
    yield "deep and short", drawn("<g>" * 98 + "x<!---->" * 110_000 + "</g>" * 98)
    yield "use", drawn('<g id="a"><use href="#a"/></g>')
    yield "namespace", f'<svg xmlns:a="{"x" * 500_000}" width="9" height="9">{"<a:b/>" * 9_000}</svg>'.encode()
    yield "namespaces", drawn("".join(f'<g xmlns:a{i}="{i}"/>' for i in range(9_000)))
    yield "attributes", drawn("<g " + " ".join(f'a{i}=""' for i in range(90_000)) + "/>")
    yield "long tag", drawn(f"<{'a' * 900_000}/>")
    yield "long id", drawn(f'<rect id="{"a" * 900_000}"/>')
    yield "long title", drawn(f"<title>{'a ' * 400_000}</title>")
    yield "digits", drawn(f'<polygon points="0.{"1" * 900_000},1 1,2 3,4"/>')
    yield "tight numbers", drawn(f'<polygon points="{"-1" * 190_000}"/>')
    yield "style", drawn(f'<rect style="{"a:b;" * 200_000}"/>')
    yield "classes", drawn(f'<rect class="{"a " * 400_000}"/>')
    known = sorted({*encodings.aliases.aliases, *encodings.aliases.aliases.values()})
    for encoding in (*known, "idna", "punycode", "undefined", "raw_unicode_escape", "klingon", "utf-8\n", "x" * 500):
        yield f"encoding {encoding}", f'<?xml version="1.0" encoding="{encoding}"?>{HEAD}</svg>'.encode()
    whole = drawn('<rect width="9" height="9"/><title>\u00e9</title>')
    for encoding in ("utf-16", "utf-16-le", "utf-32", "latin-1", "utf-7", "utf-8-sig", "cp037"):
        yield f"written as {encoding}", whole.decode().encode(encoding)
    for mark in (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF32_BE, b"\0", b"\xff"):
        yield f"begins with {mark!r}", mark + whole
        yield f"holds {mark!r}", whole.replace(b"9", b"9" + mark)


def toml_attacks():
    for name, corners in lines():
        yield f"polygon {name}", f'{TOML}[[obstacle]]\nshape = "polygon"\noutline = {lists(corners)}\n'
    hole = "[[{0}, {1}], [{0}.3, {1}], [{0}, {1}.3]]"
    for n in (100, 1000, 9000):
        holes = ", ".join(hole.format(i % 95 + 1, i // 95 + 1) for i in range(n))
        for corners in (4, 10_000):
            azimuth = np.linspace(0, 2 * np.pi, corners, endpoint=False)
            outline = lists(50 + 90 * np.column_stack([np.cos(azimuth), np.sin(azimuth)]))
            text = f'shape = "polygon"\noutline = {outline}\nholes = [{holes}]'
            yield f"{n} holes in {corners} corners", f"{TOML}[[obstacle]]\n{text}\n"
    rings = ", ".join(f"[[{a}, {a}], [{b}, {a}], [{b}, {b}], [{a}, {b}]]" for a, b in squares(2000, nested=True))
    yield "holes in holes", f'{TOML}[[obstacle]]\nshape = "polygon"\noutline = {lists(star(9))}\nholes = [{rings}]\n'
    for part in (
        '{shape="disc",centre=[1,1],radius=1}',
        '{shape="rectangle",corners=[[1,1],[2,2]]}',
        '{shape="polygon",outline=[[1,1],[2,2],[1,2]]}',
        *("1", "[]", "{}", "[[[[]]]]", '"a"', "1979-05-27", "1e999", "{a={a={a=1}}}"),
    ):
        yield f"many {part}", f"{TOML}obstacle=[{f'{part},' * ((UPLOAD - 60) // (len(part) + 1))}]"
    yield "many fires", f"{TOML}fire=[{'{centre=[1,1],radius=1},' * 38_000}]"
    yield "dotted", f"{'.'.join('a' * 400_000)} = 1"
    yield "dotted headers", "".join(f"[{'.'.join('a' * 150)}.b{i}]\n" for i in range(3_000))
    yield "dotted digits", f"{'1.' * 100_000}1 = 1"
    yield "dotted quotes", ".".join(['"a"'] * 100_000) + " = 1"
    yield "dotted in a table", f"{TOML}obstacle = [{{{'.'.join('a' * 100_000)} = 1}}]"
    yield "deep lists", f"a = {'[' * 400_000}"
    yield "deep tables", f"a = {'{a=' * 300_000}"
    yield "keys", "".join(f"a{i}=1\n" for i in range(90_000))
    yield "tables", "".join(f"[a{i}]\n" for i in range(90_000))
    yield "escapes", f'name = "{chr(92)}u0041' + f'{chr(92)}n"' * 100_000
    yield "long name", f'name = "{"a" * 900_000}"'
    for n in EXTREMES:
        for part in (f"centre = [{n}, 1]\nradius = 1", f"centre = [1, 1]\nradius = {n}"):
            yield f"fire {part}", f"{TOML}[[fire]]\n{part}\n"
            yield f"disc {part}", f'{TOML}[[obstacle]]\nshape = "disc"\n{part}\n'
        yield f"rectangle {n}", f'{TOML}[[obstacle]]\nshape = "rectangle"\ncorners = [[{n}, 1], [5, {n}]]\n'
        yield f"polygon {n}", f'{TOML}[[obstacle]]\nshape = "polygon"\noutline = [[{n}, 1], [5, {n}], [0, 0]]\n'
        yield f"size {n}", f'name = "a"\nwidth = {n}\nheight = {n}\norigin = [{n}, {n}]\n'
        yield f"bounds {n}", f'name = "a"\nbounds = [{n}, 0, {n}, {n}]\n'


def legacy_attacks():
    for part in (
        *('Obstacle("cir",[[1,1],1])', 'Obstacle("rec",[1,1,2,2])', "Fire([1,1,2])", "1", "a", "[]", "a()", "()", "{}"),
        *("*a", "-1", "1+1", "'a'", "lambda:0", "f'{a}'", "a.b", "a[0]", "...", "(yield)", "[a for a in b]"),
    ):
        yield f"many {part}", f"[{f'{part},' * ((UPLOAD - 9) // (len(part) + 1))}]"
        yield f"some {part}", f"[{f'{part},' * (150_000 // (2 * len(part) + 4))}]"
        yield f"lines {part}", f"{part}\n" * (UPLOAD // (len(part) + 1))
        yield f"some lines {part}", f"{part}\n" * (150_000 // (2 * len(part) + 4))
    for sign in (
        "[",
        "(",
        "-",
        "not ",
        "{",
        "a.",
        "a(",
        "1+",
        "a[",
        "lambda:",
        "if 1:\n ",
        "'" * 3,
        "\\\n",
        "\t",
        "\f",
    ):
        for n in (50, 1000, 70_000, 300_000):
            yield f"{n} of {sign!r}", sign * min(n, UPLOAD // len(sign))
    for n in EXTREMES:
        yield f"rec {n}", f'Obstacle("rec", [[0, 0], [{n}, {n}]])'
        yield f"cir {n}", f'Obstacle("cir", [[{n}, 9], {n}])'
        yield f"fire {n}", f'Obstacle("rec", [[0, 0], [9, 9]])\nFire([{n}, 9, {n}])'
    yield "digits", f'Obstacle("cir", [[1, 9], 0.{"1" * 900_000}])'
    yield "whole digits", f'Obstacle("cir", [[1, 9], {"1" * 900_000}])'


def seeds(suffix):
    """Return good files to mutate."""
    drawings = [Map.load(name) for name in builtin_maps()]
    if suffix == ".svg":
        shapes = (
            '<g transform="rotate(7 5 5) scale(2)" class="mark"><path d="M1 1h9v9z m20 20 c1 1 2 2 3 9 z"/></g>'
            '<ellipse cx="50" cy="50" rx="9" ry="5" style="fill:red"/><rect x="9" y="9" width="9" height="9" rx="2"/>'
            '<polyline fill="none" stroke-width="3" points="1,1 20,30 40,5 60,60"/><line x2="9" y2="50"/>'
            '<path fill-rule="evenodd" d="M10,10 90,10 90,90 10,90Z M20,20 30,20 30,30Z"/><text>hello</text>'
        )
        return [drawn(shapes), *(one.to_svg().encode() for one in drawings)]
    if suffix == ".toml":
        return [one.to_toml().encode() for one in drawings]
    return [b'[Obstacle("rec", [[0, 0], [20, 600]]),\n Obstacle("cir", [[650, 160], 30])]\nFire([300, 300, 40])\n'] * 2


WORDS = re.compile(rb"[A-Za-z]+|[-+.\deE]+")


def mutated(content, rng):
    """Return a file after one to four mutations."""
    for _ in range(rng.integers(1, 5)):
        content = MUTATIONS[rng.integers(len(MUTATIONS))](content, rng)
    return content[:UPLOAD]


def flipped(content, rng):
    changed = bytearray(content)
    for at in rng.integers(0, max(1, len(content)), rng.integers(1, 6)) if content else ():
        changed[at] ^= 1 << rng.integers(8)
    return bytes(changed)


def cut(content, rng):
    first, last = sorted(rng.integers(0, len(content) + 1, 2))
    return content[:first] + content[min(last, first + 200) :]


def truncated(content, rng):
    return content[: rng.integers(0, len(content) + 1)]


def doubled(content, rng):
    first, last = sorted(rng.integers(0, len(content) + 1, 2))
    return content[:last] + content[first:last] * int(2 ** rng.integers(0, 10)) + content[last:]


def renumbered(content, rng):
    numbers = list(re.finditer(rb"[-+]?\d+\.?\d*", content))
    if not numbers:
        return content
    found = numbers[rng.integers(len(numbers))]
    return content[: found.start()] + EXTREMES[rng.integers(len(EXTREMES))].encode() + content[found.end() :]


def swapped(content, rng):
    words = list(WORDS.finditer(content))
    if len(words) < 2:
        return content
    one, other = sorted(rng.choice(len(words), 2, replace=False))
    a, b = words[one], words[other]
    return content[: a.start()] + b[0] + content[a.end() : b.start()] + a[0] + content[b.end() :]


MUTATIONS = (flipped, cut, truncated, doubled, renumbered, renumbered, swapped)


def mutants(suffix, number):
    rng = np.random.default_rng(13)
    for i, seed in zip(range(number), itertools.cycle(seeds(suffix)), strict=False):
        yield f"mutant {i}", mutated(seed, rng)


def fullest(suffix):
    """Yield the files of a megabyte that take the longest to read and to use, which are tried every time."""
    if suffix == ".svg":
        yield "most rectangles", drawn('<rect x="5" y="5" width="9" height="9"/>' * 9_990)
        yield "most circles", drawn('<circle cx="5" cy="5" r="1"/>' * 9_990)
    if suffix == ".toml":
        yield "same discs", TOML + "obstacle=[" + '{shape="disc",centre=[1,1],radius=1},' * 20_000 + "]"
        discs = (f'{{shape="disc",centre=[{x:.3f},{y:.3f}],radius=1}}' for x, y in scattered(16_000, 1))
        yield "scattered discs", f"{TOML}obstacle=[{','.join(discs)}]"
        corners = scattered(27_000, 2).reshape(-1, 3, 2)
        slivers = (f'{{shape="polygon",outline={lists(sliver)}}}' for sliver in corners)
        yield "slivers", f"{TOML}obstacle=[{','.join(slivers)}]"
        wide = (f'{{shape="polygon",outline={lists(sliver * 1000)}}}' for sliver in corners)
        yield "wide slivers", f'name = "a"\nwidth = 1e5\nheight = 1e5\nobstacle=[{",".join(wide)}]'


@pytest.fixture(scope="module")
def warm():
    """Compile and import what later is measured."""
    use(Map.load("openspace_fire"))
    Map.from_svg(drawn('<polyline fill="none" points="1,1 9,9 9,1"/><path d="M1 1c9 9 0 9 9 3z"/>'))


@pytest.fixture
def files(tmp_path):
    """Return what writes attacks into files, of which only the names stay in memory."""
    numbers = itertools.count()

    def written(suffix, attacks):
        for name, content in attacks:
            path = tmp_path / f"{next(numbers)}{suffix}"
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
            yield name, path

    return written


def use(world):
    """Load a map, build a model on it, look for room for robots, and take a step."""
    model = SwarmModel(map=world, rng=1)
    model.add_robots(AGENT3, 2)
    model.step()


ATTACKS = {".svg": svg_attacks, ".toml": toml_attacks, ".map": legacy_attacks}


@pytest.mark.parametrize("suffix", ATTACKS)
def test_no_attack_by_hand_is_more_than_refused(suffix, warm, files, tally, amount):
    chosen = itertools.islice(ATTACKS[suffix](), 0, None, amount(12, 1))
    results = attack(Map.load, files(suffix, chosen), refusals=MapError, cpu=CPU, memory=MEMORY)
    tally(f"maps: {suffix[1:]}, by hand").add(results)


@pytest.mark.parametrize("suffix", ATTACKS)
def test_no_mutated_map_is_more_than_refused(suffix, warm, files, tally, amount):
    number = amount(200, {".svg": 10_000, ".toml": 7_000, ".map": 3_000}[suffix])
    inputs = files(suffix, mutants(suffix, number))
    tally(f"maps: {suffix[1:]}, mutated").add(attack(Map.load, inputs, refusals=MapError, cpu=CPU, memory=MEMORY))


@pytest.mark.parametrize("suffix", ATTACKS)
def test_a_map_that_was_read_can_be_used(suffix, warm, files, tally, amount):
    attacks = itertools.islice(ATTACKS[suffix](), 0, None, amount(20, 1))
    inputs = files(suffix, itertools.chain(fullest(suffix), attacks, mutants(suffix, amount(30, 1000))))
    tally("maps: used").add(attack(use, inputs, refusals=SwarmError, cpu=USE, memory=MEMORY))
