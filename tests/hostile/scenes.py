"""Hostile scenes: texts that are no TOML, keys, values of other types and sizes, starts; some that must complete."""

from collections.abc import Iterator

from tests.hostile.case import ANY, BAD, RUN, Case
from tests.hostile.oracle import run_of
from tests.hostile.stock import FREE, SHEET, changed, with_body

BALL = '[[body]]\nname = "ball"\nmesh = "sphere"\nradius = 0.3\nsubdivisions = 1\n'


def cases() -> Iterator[Case]:
    """All of them."""
    yield from _texts()
    yield from _values()
    yield from _starts()


def _texts() -> Iterator[Case]:
    for what, content in {
        "empty": "",
        "no TOML": "[cloth\n",
        "binary": bytes(range(256)),
        "UTF-16": SHEET.encode("utf-16"),
        "a key twice": SHEET + "[run]\n",
        "tables 5,000 deep": "a = " + "[" * 5000,
        "a text without an end": 'a = """',
        "a number of 5,000 digits": changed("duration = 0.04", "duration = " + "9" * 5000),
        "keys 2,000 deep": ".".join("a" * 2000) + " = 1\n",
        "no cloth": changed("[cloth]", "[clothes]"),
        "a cloth that is a number": "cloth = 3\n",
        "effects that are a list": "effects = [1]\n" + FREE.split("[effects")[0],
        "no effects": FREE.split("[effects")[0],
        "an unknown section": SHEET + "[clouds]\n",
        "20 MB of comments": "# x\n" * 5_000_000,
    }.items():
        yield Case(
            f"scene: {what}", RUN, "refused", {"a.toml": content}, small=what in ("empty", "no TOML", "a key twice")
        )


def _values() -> Iterator[Case]:
    for what, old, new, wanted in (
        ("as it is", "radius = 0.3", "radius = 0.3", "completed"),
        ("cells of 0", "[4, 4]", "[0, 4]", "refused"),
        ("cells of 10^9", "[4, 4]", "[1000000000, 4]", "refused"),
        ("4,096 x 4,096 cells", "[4, 4]", "[4096, 4096]", "refused"),
        ("cells of 1e400", "[4, 4]", "[1e400, 4]", "refused"),
        ("cells of words", "[4, 4]", '["a", "b"]', "refused"),
        ("one cell", "[4, 4]", "[1, 1]", "completed|found"),
        ("a size of 0", "cells = [4, 4]", "cells = [4, 4]\nsize = [0, 1]", "refused"),
        ("a size of 1e-12", "cells = [4, 4]", "cells = [4, 4]\nsize = [1e-12, 1e-12]", ANY),
        ("a size of 1e12", "cells = [4, 4]", "cells = [4, 4]\nsize = [1e12, 1e12]", ANY),
        ("a density of 0", "cells = [4, 4]", "cells = [4, 4]\ndensity = 0", "refused"),
        ("a density of 1e300", "cells = [4, 4]", "cells = [4, 4]\ndensity = 1e300", ANY),
        ("a density of nan", "cells = [4, 4]", "cells = [4, 4]\ndensity = nan", "refused"),
        ("a density of true", "cells = [4, 4]", "cells = [4, 4]\ndensity = true", "refused"),
        ("a stiffness of 1e300", "cells = [4, 4]", "cells = [4, 4]\nyoungs_modulus = 1e300", ANY),
        ("a stiffness of 1e-300", "cells = [4, 4]", "cells = [4, 4]\nyoungs_modulus = 1e-300", ANY),
        ("a position of 1e300", "[0.0, 0.0, 0.31]", "[0.0, 0.0, 1e300]", ANY),
        ("a position of 1e9", "[0.0, 0.0, 0.31]", "[0.0, 0.0, 1e9]", ANY),
        ("a position of nan", "[0.0, 0.0, 0.31]", "[0.0, 0.0, nan]", "refused"),
        ("a velocity of 1e6", "cells = [4, 4]", "cells = [4, 4]\nvelocity = [0, 0, -1e6]", BAD),
        ("a name with a control character", "cells = [4, 4]", 'cells = [4, 4]\nname = "a\\u001b[2J"', "refused"),
        ("a name of the body", "cells = [4, 4]", 'cells = [4, 4]\nname = "ball"', "refused"),
        ("a fabric that is none", "cells = [4, 4]", 'cells = [4, 4]\nfabric = "paper"', "refused"),
        ("a key that is misspelt", "cells = [4, 4]", "cells = [4, 4]\ndensty = 1", "refused"),
        ("a radius of -1", "radius = 0.3", "radius = -1", "refused"),
        ("a radius of 1e-30", "radius = 0.3", "radius = 1e-30", ANY),
        ("a sphere of 30 subdivisions", "subdivisions = 1", "subdivisions = 30", "refused"),
        ("gravity of 1e300", "[effects.gravity]", "[effects.gravity]\nacceleration = [0, 0, -1e300]", ANY),
        ("gravity of 10^5 g", "[effects.gravity]", "[effects.gravity]\nacceleration = [0, 0, -1e6]", ANY),
        ("gravity of 1e-300", "[effects.gravity]", "[effects.gravity]\nacceleration = [0, 0, -1e-300]", "completed"),
        ("a d_hat of 1e-30", "[effects.body_contact]", "[effects.body_contact]\nd_hat = 1e-30", ANY),
        ("a d_hat of 10 m", "[effects.body_contact]", "[effects.body_contact]\nd_hat = 10", ANY),
        ("dt of 0", "threads = 1", "threads = 1\ndt = 0", "refused"),
        ("dt of 1e-300", "threads = 1", "threads = 1\ndt = 1e-300", "refused"),
        ("dt of 1e300", "threads = 1", "threads = 1\ndt = 1e300", ANY),
        ("a tolerance of 1e-300", "threads = 1", "threads = 1\ntolerance = 1e-300", ANY),
        ("one iteration", "threads = 1", "threads = 1\nmax_iterations = 1", ANY),
        ("10^9 threads", "threads = 1", "threads = 1000000000", ANY),
        ("a duration of 0", "duration = 0.04", "duration = 0", "refused"),
        ("a duration of 1e300", "duration = 0.04", "duration = 1e300", "refused"),
        ("a duration of 1e-300", "duration = 0.04", "duration = 1e-300", ANY),
        ("10^9 frames a second", "duration = 0.04", "duration = 0.04\nframes_per_second = 1000000000", "refused"),
        ("1e-300 frames a second", "duration = 0.04", "duration = 0.04\nframes_per_second = 1e-300", ANY),
        ("until nothing", "duration = 0.04", 'duration = 0.04\nuntil = "never"', "refused"),
        ("an error of 1e-300 m", "threads = 1", "threads = 1\nerror = 1e-300", "warned"),
        ("an unknown solver", '"superlu"', '"magic"', "refused"),
        ("pins of vertex 10^9", "[solver]", "[effects.pins]\nselect = [1000000000]\n[solver]", "refused"),
        ("pins of vertex -1", "[solver]", "[effects.pins]\nselect = [-1]\n[solver]", "refused"),
        ("pins of no vertex", "[solver]", "[effects.pins]\nselect = []\n[solver]", ANY),
        ("pins of all", "[solver]", "[effects.pins]\nselect = { box = [[-9, -9, -9], [9, 9, 9]] }\n[solver]", ANY),
        ("pressure of 1e300", "[solver]", "[effects.pressure]\nvalue = 1e300\n[solver]", ANY),
        ("wind of 1e200", "[solver]", "[effects.air]\nwind = [1e200, 0, 0]\n[solver]", ANY),
        ("friction of 1e9", "[solver]", "[effects.friction]\n[solver]", ANY),
        (
            "springs between one vertex",
            "[solver]",
            "[[effects.springs.spring]]\nvertices = [0, 0]\nstiffness = 1\n[solver]",
            "refused",
        ),
        ("seams of one vertex", "[solver]", "[[effects.seams.seam]]\nfrom = 0\nto = 0\n[solver]", "refused"),
        ("a motion of words", "subdivisions = 1", 'subdivisions = 1\nmotion = "fast"', "refused"),
        (
            "a motion of 1e300",
            "subdivisions = 1",
            "subdivisions = 1\nmotion = { velocity = [0, 0, 1e300] }",
            BAD,
        ),
        (
            "a motion of 10 km/s",
            "subdivisions = 1",
            "subdivisions = 1\nmotion = { velocity = [0, 0, 1e4] }",
            BAD,
        ),
    ):
        small = what in ("cells of 0", "a density of nan", "a radius of -1", "dt of 0", "as it is")
        says = "MISSED" if wanted == "warned" else ""
        yield run_of(changed(old, new), f"value: {what}", wanted, says, small=small)


def two_sheets(turned: str) -> str:
    """The sheet, and another one in the same place."""
    second = f'[[cloth]]\nname = "b"\nmesh = "rectangle"\ncells = [4, 4]\nposition = [0, 0, 0.31]\n{turned}[[body]]'
    both = SHEET.replace("[cloth]", "[[cloth]]").replace("[[body]]", second)
    return both.replace("[solver]", "[effects.self_contact]\n[solver]")


def _starts() -> Iterator[Case]:
    inside = changed("[0.0, 0.0, 0.31]", "[0.0, 0.0, 0.0]")
    within = changed("cells = [4, 4]", "cells = [4, 4]\nsize = [0.05, 0.05]", inside)
    touching = changed("[0.0, 0.0, 0.31]", "[0.0, 0.0, 0.3]")
    for what, text, wanted in (
        ("through the ball", inside, "refused"),
        ("wholly inside the ball", within, "refused"),
        ("wholly inside, allowed", changed("[run]", "[run]\nallow_inside = true", within), ANY),
        ("touching at one vertex", touching, ANY),
        ("1e-12 m above", changed("0.31]", "0.300000000001]"), ANY),
        ("two sheets in one place", two_sheets(""), BAD),
        ("two sheets that cross", two_sheets("rotation_degrees = [90, 0, 0]\n"), BAD),
        (
            "two bodies in one place",
            SHEET.replace(
                "[effects.inertia]",
                '[[body]]\nname = "b"\nmesh = "sphere"\nradius = 0.3\nsubdivisions = 1\n[effects.inertia]',
            ),
            "completed",
        ),
        ("a body of no volume", with_body('name = "ball"\nmesh = "slab"\nsize = [1, 1, 1e-9]'), ANY),
        (
            "no body at all",
            changed(BALL, ""),
            ANY,
        ),
        ("quasi-static and held by nothing", changed("[effects.inertia]\n", ""), ANY),
        ("a model of the mannequin", with_body('name = "ball"\nmodel = "mannequin"'), ANY),
    ):
        yield run_of(text, f"start: {what}", wanted)
    alone = changed(BALL, "").replace("[effects.body_contact]", "[effects.body_contact]\nexclude = [5.9, 0.2]")
    yield run_of(alone, "value: exclusions of numbers, no body", "refused", small=True)
    yield run_of(PRESS, "start: a pressed sheet", "found|completed")
    yield Case("start: through the ball, checked", "check a.toml", "found", {"a.toml": inside})
    crossing = changed("[effects.body_contact]\n", "", changed("[0.0, 0.0, 0.31]", "[0.0, 0.0, 0.1]"))
    yield run_of(crossing, "start: through the ball without contact", "warned", "intersect")


BODIES = """name = "press"
mesh = "slab"
size = [1, 1, 0.1]
position = [0, 0, 0.06]
motion = { velocity = [0, 0, -0.2] }
[[body]]
name = "table"
mesh = "slab"
size = [1, 1, 0.1]
position = [0, 0, -0.05]"""
PRESS = changed("[0.0, 0.0, 0.31]", "[0, 0, 0.008]", with_body(BODIES)).replace("duration = 0.04", "duration = 0.1")
"""A sheet between two plates that meet."""
