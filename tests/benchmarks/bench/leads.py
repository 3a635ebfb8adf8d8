"""Initial states of cases: made once by a few steps with a loose tolerance, cached in a folder."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from clothsim.base.errors import ClothsimError
from clothsim.base.file_writing import write_atomically
from clothsim.run.session import prepare
from clothsim.scene.assembly.scene_world import build
from clothsim.scene.scene import Scene
from clothsim.solve.stepping.state import State, first_state
from clothsim.solve.stepping.stepping import advance
from tests.benchmarks.bench.bench_cases import STARTS, Case

LOOSER = 10.0
"""Stop of a lead over the scene's, a tolerance or a fraction of the time error of at most 1: it only brings the cloth
to a place worth measuring at.
"""


def lead(case: Case, folder: Path) -> Path | None:
    """The file with the state that a case starts from, made where it is not there; None for the scene's own start."""
    if case.scene is None or not (case.lead or case.start):
        return None
    identity = f"{case.scene.to_text()} {case.lead} {case.start}"
    name = re.sub(r"[^A-Za-z0-9.]+", "_", case.name)
    file = folder / f"{name}-{hashlib.sha256(identity.encode()).hexdigest()[:12]}.npz"
    if not file.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        _write(file, _led(case, case.scene))
    return file


def _led(case: Case, scene: Scene) -> State:
    loose = replace(scene, solver={**scene.solver, **_looser(scene)})
    session = prepare(loose, build(loose))
    integrator = session.integrator
    state = first_state(session.built.world, integrator.dt)
    if case.start:
        state = _placed(state, session.built.world.n_cloth, case.start)
    for _ in range(case.lead):
        report = advance(integrator, state, state.time + integrator.dt)
        if not report.converged:
            raise ClothsimError(f"{case.name} cannot be led into contact: {report.result.outcome.sentence}")
        state = report.state
    return state


def _looser(scene: Scene) -> dict[str, float]:
    solver = scene.solver_settings
    if solver.balanced:
        return {"newton_error_fraction": min(1.0, LOOSER * solver.stop_fraction)}
    return {"tolerance": LOOSER * solver.tolerance}


def _placed(state: State, n: int, start: str) -> State:
    """The cloth as `start` bends it, at the time of that."""
    bend, time = STARTS[start]
    positions = state.positions.copy()
    positions[:n] = bend(positions[:n])
    return replace(state, positions=positions, time=time)


def _write(file: Path, state: State) -> None:
    from io import BytesIO

    content = BytesIO()
    np.savez(content, positions=state.positions, velocities=state.velocities, time=state.time)
    write_atomically(file, content.getvalue())
