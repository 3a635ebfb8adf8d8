"""Settings of a scene with solver.error, found by one search, around which a study then varies its knobs."""

import json
from dataclasses import replace
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from clothsim import Scene, simulate
from clothsim.base.errors import InputError
from clothsim.engine import set_key
from clothsim.study.error_control.resolution import Resolution, resolvable
from clothsim.study.evaluation import FOLDER

SEARCHED_NAME = "searched.json"
LARGEST_FRACTION = 0.3
"""Fraction of a study's budget that the search may take."""


def searched_settings(scene: Scene, directory: Path, budget: float) -> tuple[Scene, dict[str, Any] | None]:
    """Scene with the settings that its solver.error takes.

    Parameters
    ----------
    scene : Scene
        One without solver.error stays as it is.
    directory : Path
        Directory of the study; what was found there before for the same scene is taken again.
    budget : float
        Budget of the study [s].

    Returns
    -------
    scene : Scene
        With dt, cells, d_hat and Newton's stop written out.
    found : dict or None
        The search's statement: asked, total [m], known, met, seconds; None without solver.error.

    Raises
    ------
    InputError
        Where the run with these settings does not come to its end.
    """
    if not scene.solver_settings.error:
        return scene, None
    key = sha256(scene.to_text().encode()).hexdigest()[:16]
    file = directory / FOLDER / SEARCHED_NAME
    stored = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    if stored.get("scene") != key:
        stored = {"scene": key, **_search(scene, budget)}
        file.write_text(json.dumps(stored), encoding="utf-8")
    steps, cells, d_hat = stored["resolution"]
    solver = {name: value for name, value in scene.solver.items() if name not in ("error", "budget")}
    ladder = resolvable(replace(scene, solver=solver))
    found = ladder.at(Resolution(steps, Fraction(cells), Fraction(d_hat)), stored["newton_error_fraction"])
    return found, stored["estimate"]


def _search(scene: Scene, budget: float) -> dict[str, Any]:
    limit = min(scene.solver_settings.budget, LARGEST_FRACTION * budget)
    with TemporaryDirectory() as folder:
        run = simulate(set_key(scene, "solver.budget", limit), folder)
    if run.status != "completed":
        raise InputError(
            f"The scene itself is no data point: {run.reason}",
            "Run it, and change what fails; a shorter dt often helps.",
        )
    estimate = run.summary["certificate"]["error_estimate"]
    names = ("asked", "total", "known", "met", "seconds")
    return {
        "resolution": estimate["chosen"]["resolution"],
        "newton_error_fraction": estimate["chosen"].get("newton_error_fraction", 1.0),
        "estimate": {name: estimate[name] for name in names},
    }
