"""Command-line helpers: two small scenes, and the two lines of bad input."""

from clothsim.cli import main

SHEET = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
position = [0.0, 0.0, 0.31]
[[body]]
name = "ball"
mesh = "sphere"
radius = 0.3
[effects.inertia]
[effects.membrane]
[effects.gravity]
[effects.damping]
rate = 0.0
[effects.body_contact]
[solver]
linear = "superlu"
threads = 1
[run]
duration = 0.04
"""
FREE = """
[cloth]
mesh = "rectangle"
cells = [4, 4]
[effects.inertia]
[effects.gravity]
acceleration = [0.0, -9.81, 0.0]
[solver]
linear = "superlu"
dt = 0.005
[run]
duration = 0.04
frames_per_second = 100
"""


def refused(capsys, *words):
    """The two lines of bad input."""
    assert main(list(words)) == 2
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    lines = err.splitlines()
    assert len(lines) == 2
    assert all(lines)
    return lines


def with_keywords(function, settings):
    return lambda *arguments, **keywords: function(*arguments, **{**keywords, **settings})
