"""clothsim with the settings that peers have (isotropic, hinges, backward Euler, a tolerance), or with its defaults."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "clothsim", "clothsim"
CANNOT = ""
TOLERANCE = 1e-3


def build(scene: PeerScene, as_peers: bool = True, solver: Mapping[str, Any] | None = None) -> Simulation:
    """The sheet and ball of the benchmark, as in its windows of a fall.

    as_peers: an isotropic sheet with hinges; solver: its keys, in place of backward Euler and a tolerance.
    """
    from clothsim.run.session import prepare
    from clothsim.scene.assembly.scene_world import build as built
    from clothsim.solve.stepping.state import first_state
    from clothsim.solve.stepping.stepping import advance
    from tests.benchmarks.bench.bench_cases import PEERS
    from tests.benchmarks.peers.shared_sheet import released

    if solver is None:
        solver = {"integrator": "backward_euler", "tolerance": TOLERANCE} if as_peers else {}
    given = released(scene.cells, scene.friction)
    effects = {**given.effects, **PEERS} if as_peers else given.effects
    given = replace(given, effects=effects, solver={"dt": scene.dt, "threads": 1, **solver})
    session = prepare(given, built(given))
    world, rows = session.built.world, slice(len(scene.positions))
    states, taken, iterations = [first_state(world, scene.dt)], [0], [0]

    def step() -> None:
        end = states[0].time + scene.dt
        while states[0].time < end - 1e-9 * scene.dt:
            report = advance(session.integrator, states[0], end)
            if report.failure is not None:
                raise RuntimeError(str(report.failure))
            states[0] = report.state
            taken[0], iterations[0] = taken[0] + 1, iterations[0] + report.result.iterations

    keys = ", ".join(f"{key} {value}" for key, value in solver.items()) or "the default solver"
    sheet = "isotropic with hinges" if as_peers else "the default sheet"
    return Simulation(
        step,
        lambda: states[0].positions[rows],
        f"dt {scene.dt} s, {sheet}, {keys}, one thread",
        lambda: states[0].velocities[rows],
        world.inertial_masses[rows],
        lambda: f"{iterations[0]} iterations in {taken[0]} steps",
    )
