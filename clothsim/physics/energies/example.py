"""Examples of an effect: keys with which it acts, is zero or idles, for the tests that go through the table of effects.

The module of an effect's builder holds them as `EXAMPLE`; without one the builder's defaults are the example.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Keys = Mapping[str, Any]


@dataclass(frozen=True)
class Idle:
    """An effect without anything to do: skipped in a step, or searching for pairs without finding any.

    Parameters
    ----------
    always : mapping
        Keys with which it idles in every step of a small scene (a sheet of 1 m, 4x4 cells, falling on a ball).
    sometimes : mapping
        Keys with which it idles in some of eight steps of .02 s and acts in others.
    scene : mapping
        Sections of the small scene that `always` needs, changed.
    searches : bool
        True for an energy that is never skipped but has neither value nor derivatives (contact without pairs).
    kernels : tuple of str
        Modules of which no kernel of a value or derivative may be called then.
    """

    always: Keys = field(default_factory=dict)
    sometimes: Keys = field(default_factory=dict)
    scene: Keys = field(default_factory=dict)
    searches: bool = False
    kernels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Example:
    """Keys and properties of one effect.

    Parameters
    ----------
    keys : mapping
        With them the effect acts on a small bent cloth over a triangle, all numbers of order one.
    in_scene : mapping or None
        With them it acts in the small scene (see `Idle`); None: `keys`.
    zero : mapping or None
        Keys with which the builder returns `Off`; None where it never does.
    zero_scene : mapping
        Sections of the small scene that `zero` needs, changed ({"body": ()} for contact).
    external : bool
        True where forces and torques need not balance: the energy depends on positions in space, velocities or the
        past.
    with_bodies : bool
        True where the energy depends on the vertices of bodies.
    linear : bool
        True where the Hessian is zero.
    idle : Idle or None
        Keys with which it idles; None where it acts in each step.
    """

    keys: Keys = field(default_factory=dict)
    in_scene: Keys | None = None
    zero: Keys | None = None
    zero_scene: Keys = field(default_factory=dict)
    external: bool = False
    with_bodies: bool = False
    linear: bool = False
    idle: Idle | None = None

    @property
    def scene_keys(self) -> Keys:
        """Keys with which the effect acts in the small scene."""
        return self.keys if self.in_scene is None else self.in_scene
