"""clothsim with the settings that peers have (isotropic, hinges, backward Euler, a tolerance), or with its defaults."""

from dataclasses import replace

from tests.benchmarks.peers.peer_scene import PeerScene, Simulation

PACKAGE, PIP = "clothsim", "clothsim"
CANNOT = ""
TOLERANCE = 1e-3


def build(scene: PeerScene, as_peers: bool = True) -> Simulation:
    """The sheet and ball of the benchmark, as in its windows of a fall."""
    from clothsim.run.session import prepare
    from clothsim.scene.assembly.scene_world import build as built
    from clothsim.solve.stepping.state import first_state
    from clothsim.solve.stepping.stepping import advance
    from tests.benchmarks.bench.bench_cases import PEERS
    from tests.benchmarks.peers.shared_sheet import released

    given = released(scene.cells)
    own = {"dt": scene.dt, "threads": 1}
    if as_peers:
        solver = {**own, "integrator": "backward_euler", "tolerance": TOLERANCE}
        given = replace(given, effects={**given.effects, **PEERS}, solver=solver)
    else:
        given = replace(given, solver=own)
    session = prepare(given, built(given))
    states = [first_state(session.built.world, scene.dt)]

    def step() -> None:
        states[0] = advance(session.integrator, states[0], states[0].time + scene.dt).state

    settings = f"backward Euler, hinges, tolerance {TOLERANCE} m/s" if as_peers else "the defaults"
    return Simulation(
        step, lambda: states[0].positions[: len(scene.positions)], f"dt {scene.dt} s, {settings}, one thread"
    )
