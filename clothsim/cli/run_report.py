"""Settings and result of a run as text."""

import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clothsim.cli.progress import clock, length

if TYPE_CHECKING:
    from clothsim.run.results import Run
    from clothsim.run.session import Session

WIDTH = 100


def existing_files_note(directory: Path) -> str:
    """A note on files that the output directory holds already; empty where there are none."""
    from clothsim.io.record import RECORD_NAME
    from clothsim.io.trajectory import TRAJECTORY_NAME

    if not directory.is_dir() or not any(directory.iterdir()):
        return ""
    if any((directory / name).is_file() for name in (RECORD_NAME, TRAJECTORY_NAME)):
        return f"{directory} holds an earlier run, which is replaced."
    return f"{directory} holds other files. They stay; one named as a file of the run is replaced."


def resumption_note(directory: Path) -> str:
    """A note on the time and frame of a run that is resumed."""
    from clothsim.io.checkpoint import CHECKPOINT_NAME, read_checkpoint

    saved = read_checkpoint(directory / CHECKPOINT_NAME)
    return f"Continues at {saved.time:g} s, after frame {saved.frame}."


def settings(session: "Session", directory: Path, before: str) -> str:
    """The settings of a run, one line each."""
    built, scene, integrator = session.built, session.scene, session.integrator
    solver, run = scene.solver_settings, scene.run_settings
    world = built.world
    on = [name for name in scene.effects if name not in built.off]
    sizes = f"{world.n_cloth:,} vertices and {len(world.triangles):,} triangles of cloth"
    if world.bodies:
        body_vertices = sum(len(body.positions) for body in world.bodies)
        names = ", ".join(body.name for body in world.bodies)
        sizes += f"; {body_vertices:,} vertices and {len(world.body_triangles):,} triangles of {names}"
    threads = _many(integrator.system.solver.threads, "thread")
    kind = {"backward_euler": "backward Euler", "bdf2": "BDF2"}[integrator.formula]
    if "inertia" not in built.energies:
        kind = "quasi-static, loads grow over the duration"
    steps = f"steps of {integrator.dt:g} s"
    if solver.error:
        steps = f"steps chosen for an error of {length(solver.error)}, of {integrator.dt:g} s at most"
    end = f"{'until rest, at most ' if run.until == 'rest' else ''}{run.duration:g} s"
    newton = f"to {integrator.settings.tolerance:g} m/s"
    if integrator.settings.error_fraction and "inertia" in built.energies:
        newton = f"to {integrator.settings.error_fraction:g} of the time error"
    rows = [
        ("output", f"{directory}{os.sep}"),
        ("mesh", sizes),
        ("effects", ", ".join(on)),
        *(("off", f"{name}: {reason}") for name, reason in built.off.items()),
        ("time", f"{end} in {steps}, {run.frames_per_second:g} frames a second"),
        ("solver", f"{kind}; Newton {newton}; {integrator.system.solver.name}, {threads}"),
        *(("note", note) for note in session.notes),
        *([("note", before)] if before else []),
    ]
    return "\n".join(_row(name, text) for name, text in rows)


def verdict(run: "Run", trouble: list[str]) -> str:
    """The result of a run: status, reason, certificate in three lines, error, final notes, effort, files."""
    summary = run.summary
    files = sorted(path.name for path in run.directory.iterdir() if path.suffix in _ENDINGS and path.is_file())
    rejections = summary["rejected_steps"]
    rejected = f" ({rejections:,} rejected for their error)" if rejections else ""
    restarts = summary.get("restarted_steps", 0)
    rejected += f" ({restarts:,} by backward Euler at impacts)" if restarts else ""
    parts = summary.get("regional_iterations", 0)
    patch_iterations = f" and {parts:,} on patches" if parts else ""
    newton = f"{_many(summary['newton_iterations'], 'Newton iteration')}{patch_iterations}"
    effort = (
        f"{clock(summary['wall_seconds'])} ({clock(summary['warmup_seconds'])} to start), "
        f"{_many(summary['steps'], 'step')}{rejected}, {newton}, "
        f"{summary['peak_memory_bytes'] / 1e6:.0f} MB of memory at most"
    )
    rows = [
        *_certificate(summary["certificate"], "body_contact" in summary["effects"]),
        *(("WARNING", text) for text in summary.get("warnings", ())),
        ("rest", _rest(summary["certificate"])),
        *(("unstable", text) for text in _unstable(summary["certificate"])),
        ("error", _error(summary["certificate"])),
        *(("found", text) for text in summary.get("found", [])),
        ("effort", effort),
        ("files", f"{run.directory}{os.sep}: {', '.join(files)}"),
    ]
    lines = [f"{summary['status']}: {summary['reason']}", *(_row(name, text) for name, text in rows), *trouble]
    if summary["status"] != "completed":
        lines += _after_failure(run)
    return "\n".join(lines)


def _after_failure(run: "Run") -> list[str]:
    """The remedy, the last good state, and the commands that examine and pack the failure."""
    from clothsim.io.checkpoint import CHECKPOINT_NAME, read_checkpoint

    failure = run.summary["failure"]
    saved = read_checkpoint(run.directory / CHECKPOINT_NAME)
    directory = shlex.quote(str(run.directory))
    return [
        failure["remedy"],
        f"The last good state is step {saved.step} at {saved.time:g} s; the last frame is number {len(run.times) - 1}.",
        f"To examine it: {program()} resume {directory} --dump-iterates {failure['step']}",
        f"To report it: {program()} bundle {directory}",
    ]


def stopped(directory: Path) -> str:
    """The line that follows Ctrl-C."""
    from clothsim.io.checkpoint import CHECKPOINT_NAME

    if (directory / CHECKPOINT_NAME).is_file():
        return f"Stopped. Continue with: {program()} resume {shlex.quote(str(directory))}"
    return "Stopped before the first step: there is nothing to resume."


_ENDINGS = (".vtkhdf", ".jsonl", ".json", ".npz", ".png", ".mp4", ".gif")


_PAIRS = {
    "cloth_body": "cloth and body",
    "cloth_cloth": "cloth and cloth",
    "excluded": "excluded pairs",
    "carried": "carried vertices",
}


def _certificate(certificate: dict[str, Any], contact: bool) -> list[tuple[str, str]]:
    """Three lines: intersections and gap; stretches; residual and energy."""
    parts = ["no body"] if certificate["cloth_body"] == "no body" else []
    for kind, each in certificate["intersections"].items():
        if each["states"]:
            parts.append(f"{_PAIRS[kind]} INTERSECT in {_many(each['states'], 'state')}")
        elif kind != "excluded" and not (parts and kind == "cloth_body"):
            parts.append(f"{_PAIRS[kind]} never intersect")
    if certificate["intersection_free"] is None:
        parts.append("earlier steps were NOT CHECKED")
    gap = certificate["minimum_gap"]
    if contact:
        parts.append(f"smallest gap {length(gap)}" if gap is not None else "never closer than d_hat")
    drift = certificate["energy_drift"]
    energy = f"energy: {drift}" if isinstance(drift, str) else f"largest rise of energy in a step {100 * drift:.2g} %"
    changes = certificate.get("stiffness_changes", {"added": 0.0})  # a summary of an earlier version has none
    if changes["added"]:
        energy += (
            f", changes of the contact stiffness added {changes['added']:.2g} J, removed {changes['removed']:.2g} J"
        )
    stretches = "none measured"
    if certificate["stretch_min"] is not None:
        stretches = f"{certificate['stretch_min']:.4f} to {certificate['stretch_max']:.4f}"
    forces = f"residual force {certificate['residual']:.1e} N"
    if "relative_residual" in certificate:  # a summary of an earlier version has none
        forces += f", of all steps at most {100 * certificate['relative_residual']:.2g} % of the largest force"
    return [
        ("contact", "; ".join(parts)),
        *(("pinch", text) for text in _pinch(certificate)),
        ("stretch", f"principal stretches {stretches}"),
        ("balance", f"{forces}, {energy}"),
    ]


def _pinch(certificate: dict[str, Any]) -> list[str]:
    """A line on the vertices carried through a pinch, where the scene asks for it."""
    record = certificate.get("carried")
    if record is None:
        return []
    if not record["vertices"]:
        return ["nothing was carried"]
    at = ", ".join(f"{each:.3g}" for each in record["first_position"])
    times = f"from {record['first_time']:.4g} to {record['last_time']:.4g} s, first near ({at}) m"
    end = f"{record['now']:,} STILL CARRIED" if record["now"] else "all released"
    exempt = f"exempt from contact: at most {_many(record['exempt_pairs'], 'pair')} of their triangles intersect"
    return [f"{record['vertices']:,} vertices carried, at most {record['most']:,} at once, {times}; {end}; {exempt}"]


def _rest(certificate: dict[str, Any]) -> str:
    """At rest or not, and the largest speed at the end."""
    speed = certificate["fastest_speed"]
    fastest = "" if speed is None else f", fastest vertex {length(speed)}/s"
    return f"{'at rest' if certificate['at_rest'] else 'NOT at rest'}{fastest}"


def _unstable(certificate: dict[str, Any]) -> list[str]:
    """A line where unstable equilibria were found, else none."""
    found = certificate["unstable_equilibria"]
    if found["first_at"] is None:
        return []
    left = f"an unstable equilibrium was left {_many(found['left'], 'time')}"
    kept = f"{_many(found['kept'], 'step')} ended in one that was kept"
    parts = [text for count, text in ((found["left"], left), (found["kept"], kept)) if count]
    return [f"{', '.join(parts)}; first at {found['first_at']:g} s (grows by e in {1 / found['growth_rate']:.2g} s)"]


def _error(certificate: dict[str, Any]) -> str:
    """The error estimate in a line: of all in a run that estimates it, else of the steps alone.

    An equilibrium does not depend on the time steps by which it was reached, as long as they lead to the same one.
    """
    estimate = certificate["error_estimate"]
    newton, gap = estimate["newton"], estimate["contact_gap"]
    parts = f"Newton {newton if isinstance(newton, str) else length(newton)}"
    parts += "" if isinstance(gap, str) else f", contact gap {gap:.2g} d_hat"
    asked, total = estimate.get("asked"), estimate.get("total")
    request = f" ({'' if estimate['met'] else 'MISSED: '}{length(asked)} requested)" if asked else ""
    if total is not None:
        known = f"about {length(total)}" if isinstance(total, float) else total
        of_refined = estimate.get("of_refined", estimate)
        if isinstance(total, float) and not of_refined["known"]:
            known = f"not known, {known} by the last difference"
        if not estimate.get("fixed"):
            return f"{known} in all{request}; {parts}"
        if asked:
            request = f" ({'met by these' if of_refined['met'] else 'MISSED'}: {length(asked)} requested)"
        unknown = " and ".join(estimate["fixed"])
        return f"not known in all, as that of {unknown} is not; others {known}{request}; {parts}"
    temporal = estimate["temporal"]
    steps = temporal if isinstance(temporal, str) else length(temporal)
    if certificate["at_rest"] and not isinstance(temporal, str):
        steps += " on the way to equilibrium, which has none"
    return f"not known in all (--estimate); sum of the steps' own {steps}{request}, {parts}"


def _row(name: str, text: str) -> str:
    """A name and its text, broken at WIDTH."""
    import textwrap

    return textwrap.fill(
        text, WIDTH, initial_indent=f"  {name:<8} ", subsequent_indent=" " * 11, break_long_words=False
    )


def _many(count: int, what: str) -> str:
    return f"{count:,} {what}{'' if count == 1 else 's'}"


def program() -> str:
    """The name of the command line as it was called."""
    return "python -m clothsim" if Path(sys.argv[0]).name == "__main__.py" else "clothsim"
