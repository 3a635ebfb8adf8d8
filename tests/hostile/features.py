"""Hostile features: rods, closures, bands, cords, stiffeners, creases, key frames, measures, edited frames."""

from collections.abc import Iterator

from tests.hostile.case import ANY, RUN, Case
from tests.hostile.oracle import run_of
from tests.hostile.stock import FREE, changed

EFFECTS = "[effects.inertia]\n[effects.membrane]\n[effects.bending]\n[effects.self_contact]\n"
ROD = f"""[[rod]]
points = [[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]
radius = 0.001
youngs_modulus = 1e7
{EFFECTS.replace("[effects.membrane]", "").replace("[effects.bending]", "")}[run]
duration = 0.02
"""
CLOTH = FREE.replace("[effects.inertia]\n", EFFECTS)


EDGES = """from = { through = [[-0.5, -0.5, 0], [-0.5, 0.5, 0]] }
to = { through = [[0.5, -0.5, 0], [0.5, 0.5, 0]] }
"""
ZIP, BUTTONS = "[[effects.closures.zip]]\n", "[[effects.closures.buttons]]\n"
BAND, CORD = "[[effects.elastic_bands.band]]\n", "[[effects.cords.cord]]\n"
STIFFENER, CREASE = "[[effects.stiffeners.stiffener]]\n", "[effects.plastic_bending]\nyield_curvature = 10\n"


def with_table(text: str) -> str:
    """The sheet in free fall with another table."""
    return CLOTH.replace("[solver]", f"{text}\n[solver]")


def cases() -> Iterator[Case]:
    """All of them."""
    for what, old, new, wanted in (
        ("as it is", "radius = 0.001", "radius = 0.001", "completed"),
        ("of one point", "[[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]", "[[0, 0, 0]]", "refused"),
        ("of no point", "[[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]", "[]", "refused"),
        ("of rows of different lengths", "[0.1, 0, 0]", "[0.1, 0]", "refused"),
        ("of a number among rows", "[0.1, 0, 0]", "0.1", "refused"),
        ("of a word among rows", "[0.1, 0, 0]", '"a"', "refused"),
        ("of points in the plane", "[[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]]", "[[0, 0], [1, 0]]", "refused"),
        ("of a repeated point", "[0.1, 0, 0]", "[0, 0, 0]", "refused"),
        ("that doubles back", "[0.2, 0, 0]", "[0.0, 0, 0]", "refused"),
        ("of a kilometre", "[0.2, 0, 0]", "[1000, 0, 0]", ANY),
        ("in 10^9 edges", "radius = 0.001", "radius = 0.001\nedge = 1e-10", "refused"),
        ("thicker than long", "radius = 0.001", "radius = 10", ANY),
        ("of a radius of 1e-300", "radius = 0.001", "radius = 1e-300", ANY),
        ("of a stiffness of 1e30", "1e7", "1e30", "refused"),
        ("that is a loop of two", ", [0.2, 0, 0]]", "]\nloop = true", "refused"),
        ("through itself", "[0.2, 0, 0]", "[0.1, 0.1, 0], [0.05, 0.1, 0], [0.05, -0.1, 0]", "refused|found"),
        ("called like a cloth", "radius = 0.001", 'radius = 0.001\nname = "a/b"', ANY),
    ):  # fmt: skip
        yield Case(f"rod: {what}", RUN, wanted, {"a.toml": changed(old, new, ROD)})
    ball = '[[body]]\nname = "ball"\nmesh = "sphere"\nradius = 0.5\nsubdivisions = 2\n[effects.inertia]'
    inside = ROD.replace("[effects.inertia]", ball)
    yield Case("rod: inside a body, checked", "check a.toml", "warned", {"a.toml": inside}, "starts inside ball")
    for what, text, wanted in (
        ("a zip that opens", f"{ZIP}{EDGES}gap = 1.0\nclosed = [[0, 1], [0.04, 0]]", "completed"),
        ("a zip of one border", f"{ZIP}{EDGES}".replace("[[0.5", "[[-0.5").replace(", [0.5", ", [-0.5"), "refused"),
        ("a zip of one vertex", f"{ZIP}from = {{ vertices = [0] }}\nto = {{ vertices = [4] }}", "refused"),
        ("a zip closed by 2", f"{ZIP}{EDGES}closed = 2", "refused"),
        ("a zip closed backwards in time", f"{ZIP}{EDGES}closed = [[1, 0], [0, 1]]", "refused"),
        ("a zip of a gap of 1e9", f"{ZIP}{EDGES}gap = 1e9", ANY),
        ("a zip that is a number", "[effects.closures]\nzip = 3", "refused"),
        ("buttons of no places", f"{BUTTONS}from = {{ vertices = [] }}\nto = {{ vertices = [] }}", "refused"),
        ("buttons of numbers", f"{BUTTONS}from = {{ vertices = [1000000000] }}\nto = {{ vertices = [0] }}", "refused"),
        ("a band of a ratio of 0", f'{BAND}select = "top"\nstiffness = 10\nlength_ratio = 0', "refused"),
        ("a band of a ratio of 1e9", f'{BAND}select = "top"\nstiffness = 10\nlength_ratio = 1e9', ANY),
        ("a band of 1e30 N", f'{BAND}select = "top"\nstiffness = 1e30', "refused"),
        ("a cord of one vertex", f"{CORD}select = [3]\nstiffness = 10", "refused"),
        ("a cord through vertices that no edge joins", f"{CORD}select = [0, 24]\nstiffness = 10", "refused"),
        ("a stiffener of 1e30 N m2", f'{STIFFENER}select = "top"\nbending_stiffness = 1e30', "refused"),
        ("a stiffener of no border", f'{STIFFENER}select = "border"\nbending_stiffness = 1e-3', "refused"),
        ("a yield curvature and an angle", f"{CREASE}yield_angle_degrees = 5", ANY),
        ("a hardening of 1e300", f"{CREASE}hardening = 1e300", ANY),
        ("pressure at times that go back", "[effects.pressure]\nvalue = [[1, 0], [0, 5]]", "refused"),
        ("pressure at one time twice", "[effects.pressure]\nvalue = [[0, 0], [0, 5]]", "refused"),
        ("pressure at times of nan", "[effects.pressure]\nvalue = [[nan, 0], [1, 5]]", "refused"),
        ("pins of a border that is none", '[effects.pins]\nselect = "border"', "refused"),
        ("pins of a box inside out", "[effects.pins]\nselect = { box = [[1, 1, 1], [-1, -1, -1]] }", ANY),
        ("targets of no file", '[effects.targets]\ndisplacements = "a.npy"\nframes_per_second = 25', "refused"),
    ):  # fmt: skip
        yield run_of(with_table(text), f"feature: {what}", wanted)
    for what, words, wanted in (
        ("a chest in inches", "body --chest 38in -o me.obj", "completed"),
        ("a chest of words", "body --chest wide -o me.obj", "refused"),
        ("a chest in feet and inches", """body --chest 3'2" -o me.obj""", "refused"),
        ("a chest of nan", "body --chest nan -o me.obj", "refused"),
        ("a waist wider than the height", "body --height 1.5m --waist 3m -o me.obj", "refused|completed"),
        ("a body over a folder", "body -o folder", "refused"),
    ):
        yield Case(f"measure: {what}", words, wanted, {"folder": None})
    edited = ("run a.toml -o run --no-picture",)
    for what, words in (
        ("of a run that is none", "author nothing --keys 1=a.toml -o clip"),
        ("of a frame beyond the run", "author run --keys 99=a.toml -o clip"),
        ("of a key that is no mesh", "author run --keys 1=a.toml -o clip"),
        ("into its own run", "author run --keys 1=a.toml -o run"),
    ):
        yield Case(f"author: {what}", words, "refused", {"a.toml": CLOTH}, before=edited)
