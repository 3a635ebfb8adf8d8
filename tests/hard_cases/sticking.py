"""Contacts that stick until they slip: a strip pressed down on its end, a card on a table that tilts, cards shuffled.

The strip: Sano, Yamaguchi & Wada 2017, "Slip morphology of elastic strips on frictional rigid substrates", Phys. Rev.
Lett. 118, in the framework of Romero et al. 2021, "Physical validation of simulators in computer graphics", ACM Trans.
Graph. 40(4). The shuffle: C-IPC (Li, Kaufman & Jiang 2021).
"""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

from clothsim.base.arrays import Floats
from clothsim.run.results import Run
from clothsim.scene.scene import Scene
from tests.hard_cases.case import Case
from tests.hard_cases.rubbing import CARD, ELASTIC, LONG, MU, WIDE, on_slope
from tests.hard_cases.stack import order_kept
from tests.hard_cases.where import frames

LENGTH, WIDTH, STIFF = 0.1, 0.01, 1e-3
"""Of the strip [m], [N m]."""
STRIP_MU, DOWN, NEAR = 0.15, 0.02, 1e-4
"""Its friction; how fast its clamp comes down [m/s]; d_hat [m]."""
CLOSE, SLID, LANDED = 0.05, 2e-5, 0.03
"""Fraction by which the slip may be sooner or later than the elastica's; displacement of the foot that is a slip [m];
how far the strip is pressed down, of its length, when it has landed and buckled."""


def pressed_down(small: bool) -> Scene:
    """A strip without weight, clamped upright above, whose clamp comes down: it buckles, then its foot slips."""
    cells = [24, 2] if small else [60, 6]
    return Scene(
        cloth={"mesh": "rectangle", "size": [LENGTH, WIDTH], "cells": cells, "rotation_degrees": [0, -90, 0]}
        | {"position": [0, 0, LENGTH / 2 + NEAR / 2], "density": 0.2, "thickness": 1e-3, "youngs_modulus": 1e7}
        | {"poisson_ratio": 0.0, "bending_stiffness": STIFF},
        body={"name": "floor", "mesh": "rectangle", "size": [1, 1], "cells": [1, 1], "position": [0.2, 0.1, 0]},
        effects=ELASTIC
        | {"gravity": {"acceleration": [0, 0, 0]}, "damping": {"rate": 10.0}}
        | {"body_contact": {"d_hat": NEAR}, "friction": {"coefficient": STRIP_MU}}
        | {
            "pins": {
                "select": {"box": [[-1, -1, LENGTH], [1, 1, 1]]},
                "clamp": True,
                "motion": {"velocity": [0, 0, -DOWN]},
            }
        },
        solver={"dt": 0.005, "tolerance": 1e-5},
        run={"duration": 0.11 * LENGTH / DOWN, "frames_per_second": 200},
    )


def foot_force(angle: float, aside: float, guess: Floats) -> tuple[Floats, float]:
    """Force (across, along) on the foot over D/L^2, and the height of the clamp over L, for an angle at the foot.

    D theta'' = Fx cos theta - Fz sin theta along the strip, theta from the upright: free to turn at the foot, upright
    at the clamp, which is `aside` of the foot, over L, towards the side to which the strip bulges.
    """

    def top(force: Floats) -> Floats:
        along = solve_ivp(
            lambda s, y: [y[1], force[0] * np.cos(y[0]) - force[1] * np.sin(y[0]), np.sin(y[0]), np.cos(y[0])],
            (0, 1), [angle, 0, 0, 0], rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        return np.asarray(along.y[:, -1], np.float64)

    force = fsolve(lambda f: top(f)[[0, 2]] - (0, aside), guess)
    return force, float(top(force)[3])


def slips_at(aside: float) -> float:
    """By how much of its length the strip is pressed down when its foot slips, |Fx| = mu Fz; aside: as above."""
    guess = np.array([0.1, 20.19])  # of the Euler load of a column that is clamped above

    def excess(angle: float) -> float:
        force, _ = foot_force(angle, aside, guess)
        return float(force[0] / force[1] - STRIP_MU)

    _, height = foot_force(brentq(excess, 0.4, 1.1, xtol=1e-4), aside, guess)
    return 1 - height


def slips_as_elastica(run: Run) -> str:
    """The foot holds where it has landed until the elastica's force leaves the cone of friction, and slips there."""
    foot = run.positions(0)[:, 2] < NEAR
    landed = int(np.searchsorted(run.times, LANDED * LENGTH / DOWN))
    x = run.positions(landed)[:, 0]
    there = float(x[foot].mean())
    side = np.sign(x[np.abs(x).argmax()])
    moved = [abs(float(x[foot, 0].mean() - there)) * (k > landed) for k, x in enumerate(frames(run))]
    if max(moved) < SLID:
        return f"the foot does not slip: {max(moved):.2g} m"
    pressed = DOWN * run.times[int(np.argmax(np.array(moved) > SLID))] / LENGTH
    expected = slips_at(-side * there / LENGTH)
    wrong = abs(pressed / expected - 1) > CLOSE
    return f"the foot slips when pressed down by {pressed:.4g}, the elastica by {expected:.4g}" if wrong else ""


START, RATE = 12.0, 5.0
"""Slope of the table at the start [degrees] and how fast it grows [degrees/s]."""
LAID = 0.3
"""Time at which the card, thrown 1 mm by its own jitter, lies still [s]."""
LEFT_BEHIND = 1e-4
"""Displacement of the card on the table that is a slip [m]."""


def tilting(small: bool) -> Scene:
    """A card lies on a table that tilts until it slips."""
    motion = {"rotate_degrees_per_second": [0, RATE, 0], "centre": [0, 0, 0]}
    scene = on_slope(small, float(np.tan(np.radians(START))), motion)
    return replace(
        scene,
        solver={"dt": 0.01 if small else 0.005},
        run={"duration": 1.3, "frames_per_second": 100},
    )


def slips_at_mu(run: Run) -> str:
    """The card slips where the slope is mu: not sooner, and later by what it takes to slide so far.

    Past that slope it is driven by g (sin - mu cos) = g sqrt(1 + mu^2) w t, so that it slides g sqrt(1 + mu^2) w t^3/6.
    """
    slopes = np.radians(RATE) * np.asarray(run.times)
    along = [
        float((x @ [np.cos(a), 0, -np.sin(a)]).mean())
        for a, x in zip(slopes + np.radians(START), frames(run), strict=True)
    ]
    slid = np.array(along) - along[int(np.searchsorted(run.times, LAID))]
    slid[: int(np.searchsorted(run.times, LAID))] = 0.0
    if slid.max() < LEFT_BEHIND:
        return "it does not slip"
    angle = START + float(np.degrees(slopes[int(np.argmax(slid > LEFT_BEHIND))]))
    first = float(np.degrees(np.arctan(MU)))
    late = (6 * LEFT_BEHIND / (9.81 * np.sqrt(1 + MU**2) * np.radians(RATE))) ** (1 / 3)
    last = first + RATE * (late + 0.03)
    return "" if first < angle < last else f"it slips at {angle:.4g} degrees, not {first:.4g} ... {last:.4g} degrees"


APART, SHIFT = 3e-3, 0.05
"""Height between cards, and way of the two packs into one another [m]."""


def shuffled(small: bool) -> Scene:
    """Two packs of cards held at their outer edges are pushed into one another, each card between two of the others."""
    count, cells = (3, [6, 4]) if small else (10, [18, 12])
    duration = 0.5
    cards, groups = [], []
    rows, across = cells[0] + 1, cells[1] + 1
    for k in range(2 * count):
        side = -1 if k % 2 else 1
        place = [side * (LONG / 2 + 0.003), 0, APART * k]
        cards.append(
            CARD | {"name": f"card {k}", "mesh": "rectangle", "size": [LONG, WIDE], "cells": cells, "position": place}
        )
        edge = k * rows * across + (rows - 1) * across * (side > 0)
        motion = {"velocity": [-side * SHIFT / 2 / duration, 0, 0]}
        groups.append({"select": list(range(edge, edge + across)), "clamp": True, "motion": motion})
    return Scene(
        cloth=cards,
        effects=ELASTIC
        | {"self_contact": {"d_hat": 1e-3}, "friction": {"coefficient": 0.2}, "pins": {"group": groups}},
        solver={"dt": 0.01, "integrator": "backward_euler"},
        run={"duration": duration, "frames_per_second": 50},
    )


CASES = (
    Case("B27a", "strip pressed down slips as the elastica predicts", pressed_down, slips_as_elastica, slow=True),
    Case("B27b", "card on a tilting table slips at its friction angle", tilting, slips_at_mu, slow=True),
    Case("B27c", "cards shuffled into each other", shuffled, order_kept),
)
