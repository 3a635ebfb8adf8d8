"""A process that measures one case: a job (JSON) comes in, then a trial is taken for each line that follows.

It is run by its path, so that it can measure the package of another revision, which PYTHONPATH names: so it takes
nothing but what every revision has, and answers what an old one lacks with a reason.

All times are processor seconds, of all threads, unless they are called wall: other work on the machine then does not
count, though it slows the memory that it shares.
"""

import contextlib
import importlib
import inspect
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np

Job = dict[str, Any]
Trial = dict[str, Any]


EARLIER = {
    "clothsim.scene.assembly.scene_world": "clothsim.scene.build",
    "clothsim.run.session": "clothsim.session",
    "clothsim.solve.stepping.integrators": "clothsim.solve.stepping.motion",
    "clothsim.solve.linear.linear_solvers": "clothsim.solve.linear",
    "clothsim.base.process_memory": "clothsim.solve.memory",
}
"""Names that modules had in revisions before their move: those are measured beside this one too."""


def module(name: str) -> Any:
    """The module of the revision under measurement, by its present name."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        return importlib.import_module(EARLIER[name])


class RefusalError(Exception):
    """Case that cannot be measured, with the reason."""


def stepper(job: Job) -> Callable[[], Trial]:
    """Takes the same `steps` again and again from one state: `settle` steps after that in the file `state`."""
    build = module("clothsim.scene.assembly.scene_world").build
    prepare = module("clothsim.run.session").prepare
    from clothsim.scene.scene import Scene
    from clothsim.solve.stepping.state import first_state

    scene = Scene(**{**job["scene"], "directory": Path(job["directory"])})
    session = prepare(scene, build(scene))
    _book_processor_time()
    state = first_state(session.built.world, session.integrator.dt)
    if job["state"]:
        kept = np.load(job["state"])
        if kept["positions"].shape != state.positions.shape:
            raise RefusalError(f"Its mesh has {len(state.positions)} vertices, the state {len(kept['positions'])}.")
        fields = {"positions": kept["positions"], "velocities": kept["velocities"], "time": float(kept["time"])}
        state = replace(state, **fields)
    start = _stepped(session, state, job["settle"])[-1].state if job["settle"] else state
    return lambda: _steps(session, start, job["steps"])


def _steps(session: Any, start: Any, steps: int) -> Trial:
    integrator = session.integrator
    timers = _timers(integrator.potential)
    before, solves, regional = _booked(session), timers.linear_solves, _elimination_seconds(timers)
    cpu, wall = process_time(), perf_counter()
    reports = _stepped(session, start, steps)
    cpu, wall = process_time() - cpu, perf_counter() - wall
    after = _booked(session)
    effect_counters = _effect_counters(integrator.potential)
    return {
        "cpu": cpu,
        "wall": wall,
        "peak_memory": _peak(),
        "steps": steps,
        "simulated": reports[-1].state.time - start.time,
        "iterations": sum(report.result.iterations for report in reports),
        "regional": sum(_elimination_iterations(report.result) for report in reports),
        "regional_cpu": _elimination_seconds(timers) - regional,
        "linear_solves": timers.linear_solves - solves,
        "failed_tries": sum(len(report.failures) for report in reports),
        "vertices": session.built.world.n_cloth,
        "pairs": sum(int(account["pairs"]) for name, account in effect_counters.items() if "contact" in name),
        "parts": {name: after[name] - before.get(name, 0.0) for name in after},
        "own_solve": _own_solve(session, reports[-1]),
    }


def _timers(potential: Any) -> Any:
    return potential.timers if hasattr(potential, "timers") else potential.ledger  # its name in older revisions


def _effect_counters(potential: Any) -> dict[str, dict[str, Any]]:
    return (potential.effect_counters if hasattr(potential, "effect_counters") else potential.accounts)()


def _elimination_seconds(timers: Any) -> float:
    return getattr(timers, "elimination_seconds", getattr(timers, "regional", 0.0))


def _elimination_iterations(result: Any) -> int:
    return getattr(result, "elimination_iterations", getattr(result, "regional", 0))


def _stepped(session: Any, state: Any, steps: int) -> list[Any]:
    from clothsim.solve.stepping.stepping import advance

    reports = []
    for _ in range(steps):
        reports.append(advance(session.integrator, state, state.time + session.integrator.dt))
        if not reports[-1].converged:
            raise RefusalError(f"A step was given up: {reports[-1].result.outcome.sentence}")
        state = reports[-1].state
    return reports


def _book_processor_time() -> None:
    """The package's own receipts take wall time: let their clock be the processor's."""
    for name, module in list(sys.modules.items()):
        if name.startswith("clothsim.") and hasattr(module, "perf_counter"):
            module.perf_counter = process_time  # type: ignore[attr-defined]


def _booked(session: Any) -> dict[str, float]:
    """Seconds booked so far: effects (less the searches in them), the searches, the phases."""
    potential = session.integrator.potential
    booked = dict(_timers(potential).phases)
    for name, account in _effect_counters(potential).items():
        booked[name] = account["seconds"] - sum(account["parts"].values())
        for part, seconds in account["parts"].items():
            booked[part] = booked.get(part, 0.0) + seconds
    return booked


def _own_solve(session: Any, report: Any) -> float | None:
    """Seconds of one direct factorisation and solve of the last matrix; None where a revision cannot tell."""
    try:
        prescribed = module("clothsim.solve.stepping.integrators").prescribed
        make_solver = module("clothsim.solve.linear.linear_solvers").make_solver

        system, n = session.integrator.system, session.built.world.n_cloth
        hessians = report.potential.hessians(report.state.positions)
        try:
            data = system.assemble(hessians)
        except TypeError:  # revisions before 9610942 asked what may be coupled soon
            data = system.assemble(hessians, list)
        held = prescribed(session.built.world, session.integrator.constraints.values(), report.state.time).vertices
        fixed = np.zeros(n, bool)
        fixed[held[held < n]] = True
        system.pattern.fix(data, fixed)
        solver = make_solver("pardiso", system.pattern, 1)
        right = np.random.default_rng(0).standard_normal(3 * n)
        times = []
        for _ in range(3):
            start = process_time()
            solver.solve(data, right)
            times.append(process_time() - start)
    except (ImportError, AttributeError, TypeError):
        return None
    return median(times)


def fitter(job: Job) -> Callable[[], Trial]:
    """Fits a garment to another body, up to the end of the first stage that computes: the transfer."""
    from clothsim.garments.fitted import fit

    class EnoughError(Exception):
        pass

    def on_stage(stage: Any) -> None:
        if stage.name != "garment":
            found.append(len(stage.positions))
            raise EnoughError

    found: list[int] = []
    # an older revision, measured for comparison, names the argument otherwise
    name = "on_stage" if "on_stage" in inspect.signature(fit).parameters else "heard"
    callback: dict[str, Any] = {name: on_stage}

    def trial() -> Trial:
        cpu, wall = process_time(), perf_counter()
        with tempfile.TemporaryDirectory() as folder, contextlib.suppress(EnoughError):
            fit(job["garment"], job["to"], output=folder, **callback)
        seconds = {"cpu": process_time() - cpu, "wall": perf_counter() - wall}
        return {**seconds, "peak_memory": _peak(), "vertices": found[-1]}

    trial()  # compiles
    return trial


def importer(job: Job) -> Callable[[], Trial]:
    """Starts a Python that runs `code`."""

    def trial() -> Trial:
        import resource

        before, wall = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
        subprocess.run([sys.executable, "-c", job["code"]], check=True)
        wall = perf_counter() - wall
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return {"cpu": cpu, "wall": wall, "peak_memory": 1024 * after.ru_maxrss}

    trial()  # writes the byte code
    return trial


KINDS = {"steps": stepper, "fit": fitter, "import": importer}


def _package() -> str:
    """The folder of the package that is measured."""
    import clothsim

    return str(Path(clothsim.__file__).parent)


def _peak() -> int:
    """The largest resident memory of this process so far [bytes]; 0 where the system does not tell.

    Linux hands `ru_maxrss` of whoever started a process on to it; what it had itself stands in /proc.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        lines = status.read_text(encoding="utf-8").splitlines()
        return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0)
    peak_memory = module("clothsim.base.process_memory").peak_memory

    return peak_memory()


def main() -> None:
    """Answer the job with the folder of the package, then each line with a trial; {"skipped": reason} ends the talk."""
    answers, sys.stdout = sys.stdout, sys.stderr  # what libraries print is no answer

    def answer(what: Trial) -> None:
        print(json.dumps(what), file=answers, flush=True)

    try:
        job = json.loads(sys.stdin.readline())
        trial = KINDS[job["kind"]](job)
        answer({"package": _package()})
        for _ in sys.stdin:
            answer(trial())
    except RefusalError as error:
        answer({"skipped": str(error)})
    except Exception as error:  # of any revision: the bench goes on with its other cases
        answer({"skipped": f"{type(error).__name__}: {error}".splitlines()[0]})


if __name__ == "__main__":
    main()
