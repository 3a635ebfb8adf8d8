"""`clothsim check SCENE --motion`: times at which parts of a body model meet, or a joint turns too far in a step."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from clothsim import Scene, files
from clothsim.cli import on_demand

MOST_TIMES = 600
"""Most times looked at."""


def report_motion(scene: Scene, energies: Mapping[str, Any]) -> tuple[int, int]:
    """Print what the check finds; returns the numbers of errors and warnings. InputError without a body model."""
    made, name = on_demand.character_of_scene(scene)
    if made.timeline is None:
        print(f"  {name} has no motion")
        return 0, 0
    dt, contact = scene.solver_settings.dt, energies.get("body_contact")
    end = min(scene.run_settings.duration, made.timeline.duration)
    steps = np.arange(0.0, end + dt / 2, dt)
    times = steps[:: -(-len(steps) // MOST_TIMES)]
    unit = float(np.cbrt(abs(np.linalg.det(made.linear))))
    gap = 0.0 if contact is None else contact.offset + 2 * contact.d_hat
    errors = warnings = 0
    carried = scene.contact_settings.pinch == "carry"
    for met in files.meetings(made.character, made.pose, times.tolist(), gap / unit):
        place = ", ".join(f"{c:.3g}" for c in made.linear @ met.place + made.shift)
        when = f"from {met.start:.3g} to {met.end:.3g} s, at {met.times} of {len(times)} times"
        inside = met.nearest < 0
        what = "intersect" if inside else f"are nearer than {1e3 * gap:.3g} mm"
        size = f"{'depth' if inside else 'distance'} {1e3 * unit * abs(met.nearest):.3g} mm"
        severity = "error" if inside and not carried else "warning"
        parts = " and ".join(met.parts)
        print(f"  {severity}: {name}: {parts} {what} {when}; {size} at {met.at:.3g} s, ({place}) m")
        errors, warnings = errors + (severity == "error"), warnings + (severity == "warning")
    if errors or warnings:
        print('    contact.pinch = "carry" carries cloth through; motion.keep_apart = true turns the limbs outwards')
    else:
        print(f"  no parts of {name} come nearer than {1e3 * gap:.3g} mm, at {len(times)} times to {end:.3g} s")
    turn = files.fastest_turn(made.character, made.pose, steps.tolist())
    line = f"{turn.joint} turns by up to {turn.degrees:.3g} degrees in a step of {dt:g} s, at {turn.at:.3g} s"
    if turn.steps:
        shorter = dt * files.MOST_DEGREES / turn.degrees
        print(f"  warning: {name}: {line}; by more than {files.MOST_DEGREES:g} in {turn.steps} steps")
        print(f"    Contact follows a body along straight paths in a step: set solver.dt below {shorter:.2g}")
        return errors, warnings + 1
    print(f"  {line}")
    return errors, warnings
