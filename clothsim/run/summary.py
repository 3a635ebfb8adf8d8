"""Summary of a run: its content, and what it certifies in words."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from clothsim.base.process_memory import peak_memory
from clothsim.base.text import length_text, many, percent
from clothsim.geometry.held_inside import held_inside
from clothsim.physics.energies.protocols import report_of
from clothsim.run.intersections import NO_CLOTH, SURFACES_OF_KIND, IntersectionCheck, intersection_warnings
from clothsim.scene.assembly.checks import held_sentences

if TYPE_CHECKING:
    from clothsim.run.certificate import Certificate
    from clothsim.run.session import Session
    from clothsim.solve.stepping.failure import Failure
    from clothsim.solve.stepping.state import State


LARGEST_STRETCH = 2.0
"""Principal stretch from which a warning is given: knits break between that and three, woven cloth far below."""


def condition_warnings(certificate: "Certificate") -> list[str]:
    """One sentence each for cloth that was overstretched, or pinched by bodies, in any step."""
    sentences = []
    if certificate.stretch_max > LARGEST_STRETCH:
        sentences.append(
            f"A triangle was stretched to {certificate.stretch_max:.3g} times its rest length: no fabric bears that. "
            "Look for a rest shape of another size, or set effects.strain_limit."
        )
    pinched = certificate.pinched
    if pinched.first_time is not None:
        sentences.append(
            f"Bodies pinch the cloth in {pinched.frames:,} frame{'' if pinched.frames == 1 else 's'}, at most at "
            f"{pinched.most_vertices:,} of its vertices, first {pinched.first_vertex} at {pinched.first_time:g} s."
        )
    return sentences


def summary_of(
    session: "Session",
    state: "State",
    certificate: "Certificate",
    check: IntersectionCheck,
    failure: "Failure | None",
    record: Sequence[Mapping[str, Any]],
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    """The content of summary.json: the contract of the design, notes, warnings, the failure."""
    world, potential = session.built.world, session.integrator.potential
    energies = session.built.energies.items()
    unmet = certificate.estimate.unmet(certificate.asked)
    history = certificate.intersections
    inside = held_inside(world, state.positions)
    return {
        "status": "completed" if failure is None else "failed",
        "reason": _reason_of_end(session, state) if failure is None else failure.reason,
        "end": "stopped" if failure is not None else "at rest" if state.at_rest else "time is over",
        "failure": None if failure is None else failure.as_dict(),
        "stages": ["start", *("simulated" for _ in range(state.frame))],
        **seconds,
        "steps": state.step,
        "newton_iterations": sum(entry["newton_iterations"] for entry in record),
        "regional_iterations": sum(entry.get("regional_iterations", 0) for entry in record),
        "rejected_steps": sum(entry.get("rejected", 0) for entry in record),
        "restarted_steps": sum(entry.get("restarted", False) for entry in record),
        "linear_solves": potential.timers.linear_solves,
        "exact_check": asdict(certificate.checks),
        "peak_memory_bytes": peak_memory(),
        "vertices": world.n_cloth,
        "triangles": len(world.triangles),
        "solver": session.integrator.system.name,
        "notes": [*session.notes, *filter(None, [unmet])],
        "found": [
            f"{name}: {note}."
            for name, one in energies
            for note in report_of(one).final_notes(state.positions, state.time)
        ],
        "effects": potential.effect_counters(),
        "off": session.built.off,
        "phases": potential.timers.phases,
        "warnings": [
            *intersection_warnings(history.as_dict(), check.on),
            *held_sentences(inside, "is", "body_contact" in session.built.energies),
            *condition_warnings(certificate),
        ],
        "certificate": {
            **certificate.as_dict(check.coverage(history.complete), completed=failure is None),
            "held_inside": [asdict(each) for each in inside],
        },
    }


def _reason_of_end(session: "Session", state: "State") -> str:
    """The sentence on the end of a completed run."""
    if session.scene.run_settings.until == "time":
        return f"{state.time:g} s were simulated."
    if state.at_rest:
        return f"The cloth is at rest after {state.time:g} s."
    reached = f"The limit of {state.time:g} s of simulated time was reached"
    return f"{reached}, and the cloth is not at rest: {state.rest.value}."


def certificate_rows(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Names and texts of what a summary certifies, with its warnings."""
    certificate = summary["certificate"]
    speed = certificate["fastest_speed"]
    fastest = "" if speed is None else f", fastest vertex {length_text(speed)}/s"
    parts = ["no body"] if certificate["cloth_body"] == "no body" else []
    without_cloth = certificate["cloth_body"] == NO_CLOTH
    for kind, each in certificate["intersections"].items():
        if each["states"]:
            parts.append(f"{SURFACES_OF_KIND[kind]} INTERSECT in {many(each['states'], 'state')}")
        elif kind != "excluded" and not without_cloth and not (parts and kind == "cloth_body"):
            parts.append(f"{SURFACES_OF_KIND[kind]} never intersect")
    if "rods" in certificate and not certificate["intersections"]["cloth_cloth"]["states"]:
        _, between, off = certificate["rods"].partition("between steps: ")
        parts.append(
            f"in no state do rods overlap or go through cloth by their centre lines; they may pass between two {off}"
            if between
            else "rods never overlap, and no centre line goes through cloth"
        )
        parts += [] if without_cloth else ["cloth within the radius of a rod is not looked for"]
    if "rigid" in certificate and "rigid" not in certificate["intersections"]:
        parts.append(f"{SURFACES_OF_KIND['rigid']} never intersect")
    parts += [f"{each['cloth']} is INSIDE {each['body']}" for each in certificate.get("held_inside", ())]
    if certificate["intersection_free"] is None:
        parts.append("earlier steps were NOT CHECKED")
    gap = certificate["minimum_gap"]
    if "body_contact" in summary["effects"]:
        parts.append(f"smallest gap {length_text(gap)}" if gap is not None else "never closer than d_hat")
    drift = certificate["energy_drift"]
    energy = f"energy: {drift}" if isinstance(drift, str) else f"largest rise of energy in a step {percent(drift)}"
    changes = certificate.get("stiffness_changes", {"added": 0.0})  # a summary of an earlier version has none
    if changes["added"]:
        energy += (
            f", changes of the contact stiffness added {changes['added']:.2g} J, removed {changes['removed']:.2g} J"
        )
    material = certificate.get("material_changes", {"added": 0.0, "removed": 0.0})
    if material["added"] or material["removed"]:
        energy += f", changes of the material added {material['added']:.2g} J, removed {material['removed']:.2g} J"
    stretches = "none measured"
    if certificate["stretch_min"] is not None:
        stretches = f"{certificate['stretch_min']:.4f} to {certificate['stretch_max']:.4f}"
    forces = f"residual force {certificate['residual']:.1e} N"
    if "relative_residual" in certificate:  # a summary of an earlier version has none
        forces += f", at most {percent(certificate['relative_residual'])} of the largest force in any step"
    return [
        ("contact", "; ".join(parts)),
        *(("pinch", text) for text in _pinch(certificate)),
        ("stretch", f"principal stretches {stretches}"),
        ("balance", f"{forces}, {energy}"),
        *(("checked", text) for text in _effort(summary.get("exact_check"), certificate)),
        *(("WARNING", text) for text in summary.get("warnings", ())),
        ("rest", f"{'at rest' if certificate['at_rest'] else 'NOT at rest'}{fastest}"),
        *(("unstable", text) for text in _unstable(certificate)),
        ("error", _error(certificate)),
    ]


def _pinch(certificate: dict[str, Any]) -> list[str]:
    """A line on the vertices flypapered through a pinch, where the scene asks for it."""
    record = certificate.get("carried")
    if record is None:
        return []
    if not record["vertices"]:
        return ["nothing was carried"]
    at = ", ".join(f"{each:.3g}" for each in record["first_position"])
    times = f"from {record['first_time']:.4g} to {record['last_time']:.4g} s, first near ({at}) m"
    end = f"{record['now']:,} STILL CARRIED" if record["now"] else "all released"
    exempt = f"exempt from contact: at most {many(record['exempt_pairs'], 'pair')} of their triangles intersect"
    return [f"{record['vertices']:,} vertices carried, at most {record['most']:,} at once, {times}; {end}; {exempt}"]


def _effort(checks: dict[str, int] | None, certificate: Mapping[str, Any]) -> list[str]:
    """A line on what the exact check tested, and what it had proved before; none of a summary of an earlier version.

    Rods alone have no triangles, and their distances are those of double precision.
    """
    if not checks:
        return []
    if "rods" in certificate and certificate["cloth_body"] == NO_CLOTH and "rigid" not in certificate:
        return [f"{many(checks['states'], 'state')}: distances of the centre lines of rods, in double precision"]
    tested = f"{many(checks['states'], 'state')} exactly: {many(checks['pairs_tested'], 'pair')} of triangles tested"
    return [f"{tested}, {checks['pairs_proved']:,} known to be apart since an earlier state"]


def _unstable(certificate: dict[str, Any]) -> list[str]:
    """A line where unstable equilibria were found, else none."""
    found = certificate["unstable_equilibria"]
    if found["first_at"] is None:
        return []
    left = f"an unstable equilibrium was left {many(found['left'], 'time')}"
    kept = f"{many(found['kept'], 'step')} ended in one that was kept"
    parts = [text for count, text in ((found["left"], left), (found["kept"], kept)) if count]
    return [f"{', '.join(parts)}; first at {found['first_at']:g} s (grows by e in {1 / found['growth_rate']:.2g} s)"]


def _error(certificate: dict[str, Any]) -> str:
    """The error estimate in a line: of all in a run that estimates it, else of the steps alone.

    An equilibrium does not depend on the time steps by which it was reached, as long as they lead to the same one.
    """
    estimate = certificate["error_estimate"]
    newton, gap = estimate["newton"], estimate["contact_gap"]
    parts = f"Newton {newton if isinstance(newton, str) else length_text(newton)}"
    parts += "" if isinstance(gap, str) else f", contact gap {gap:.2g} d_hat"
    asked, total = estimate.get("asked"), estimate.get("total")
    request = f" ({'' if estimate['met'] else 'MISSED: '}{length_text(asked)} requested)" if asked else ""
    if total is not None:
        known = f"about {length_text(total)}" if isinstance(total, float) else total
        of_refined = estimate.get("of_refined", estimate)
        if isinstance(total, float) and not of_refined["known"]:
            known = f"not known, {known} by the last difference"
        fixed = dict(estimate.get("fixed", {}))
        if why := fixed.pop("coarser runs", ""):
            alone = f"; the last difference alone says about {length_text(total)}" if isinstance(total, float) else ""
            return f"total not known: {why}{alone} (--error 1mm, or `clothsim study`, refines); {parts}"
        if not fixed:
            return f"{known} in total{request}; {parts}"
        if asked:
            request = f" ({'met by these' if of_refined['met'] else 'MISSED'}: {length_text(asked)} requested)"
        unknown = " and ".join(f"{name} ({why})" if why else name for name, why in fixed.items())
        return f"total not known, because that of {unknown} is not; others {known}{request}; {parts}"
    temporal = estimate["temporal"]
    steps = temporal if isinstance(temporal, str) else length_text(temporal)
    if certificate["at_rest"] and not isinstance(temporal, str):
        steps += " (the equilibrium does not depend on them)"
    return f"total not known (--estimate); sum of the local errors of the steps {steps}{request}, {parts}"
