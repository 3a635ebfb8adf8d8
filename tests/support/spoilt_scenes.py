"""Text of a small good scene, and the same text with one change."""

GOOD = """
[cloth]
mesh = "rectangle"
size = [1.0, 1.0]
cells = [2, 2]
position = [0.0, 0.0, 0.5]

[[body]]
name = "ball"
mesh = "sphere"
subdivisions = 0

[effects.inertia]
[effects.membrane]
[effects.gravity]
[effects.body_contact]

[solver]
dt = 0.02

[run]
duration = 0.04
"""


def on(line, new):
    """The good scene with `line` replaced."""
    assert line in GOOD
    return GOOD.replace(line, new)


def cloth(lines):
    """The good scene with more keys of its cloth."""
    return on("[[body]]", f"{lines}\n[[body]]")


def effect(lines):
    """The good scene with another effect."""
    return on("[solver]", f"{lines}\n[solver]")
