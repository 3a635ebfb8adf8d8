"""Texts of the command line: help, version, progress lines, and --debug."""

import json
import subprocess
import sys

import pytest

from clothsim import InputError
from clothsim.cli import COMMANDS, GROUPS, _short, main, parser_of_all, without_group
from clothsim.cli.arguments import nearest_key
from clothsim.cli.info_command import script
from clothsim.cli.progress import Lines, clock
from clothsim.run.step_reports import Progress


def test_debug_shows_the_traceback():
    from clothsim.base.errors import InputError

    with pytest.raises(InputError):
        main(["run", "missing.toml", "--debug"])


@pytest.mark.parametrize(
    "command",
    [
        "run",
        "fit",
        "resume",
        "bundle",
        "render",
        "export",
        "view",
        "check",
        "explain",
        "study",
        "gradient",
        "recover",
        "scenes",
        "farm",
        "sweep",
        "learn",
        "preview",
    ],
)
def test_help_is_short_and_has_an_example(capsys, command):
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert f"\n  clothsim {command} " in out
    assert len(out.splitlines()) < 32


def test_version_and_no_command(capsys):
    from clothsim import __version__

    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"clothsim {__version__}\n"
    assert main([]) == 2
    assert "usage: clothsim" in capsys.readouterr().out


def test_python_m_clothsim_loads_nothing_heavy_to_show_its_version():
    code = (
        "import sys, runpy; sys.argv = ['clothsim', '--version']\n"
        "try: runpy.run_module('clothsim', run_name='__main__')\n"
        "except SystemExit as end: assert end.code == 0\n"
        "print([name for name in ('numpy', 'numba', 'h5py', 'ipctk') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[1] == "[]"


def test_lines_come_at_the_first_step_the_last_and_seldom_between(capsys):
    lines = Lines()
    for step in range(1, 101):
        lines(Progress(0.01 * step, 1.0, step, 4, 2e-3, 0.5, "moving", 0.1))
    err = capsys.readouterr().err.splitlines()
    assert err[0].startswith("0.010 of 1 s (0.1 s): 4 Newton, gap 2 mm, moving")
    assert err[-1].startswith("1.000 of 1 s")
    assert len(err) < 10


def test_what_is_left_follows_the_last_steps_and_each_round_begins_anew(capsys, monkeypatch):
    now = iter([0.0, 90.0, 100.0, 110.0, 111.0, 120.0])
    lines = Lines(lambda: next(now))
    for step in (1, 2, 3):
        lines(Progress(0.1 * step, 1.0, step, 4, 2e-3, 0.5, "moving", 0.1, "close, round 1 of at most 2", True))
    for step in (1, 2):
        lines(Progress(0.1 * step, 1.0, step, 4, 2e-3, 0.5, "moving", 0.1, "close, round 2 of at most 2"))
    err = capsys.readouterr().err.splitlines()
    assert err[1].startswith("close, round 1 of at most 2: 0.200 of 1 s (0.1 s, at most 12:00 min left)")
    assert err[3].startswith("close, round 2 of at most 2: 0.100 of 1 s (0.1 s):")


@pytest.mark.parametrize(
    ("estimate", "line"),
    [
        ({"temporal": 2e-3, "newton": 4e-6, "contact_gap": 0.53}, "2 mm, Newton 4 um, contact gap 0.53 d_hat"),
        (
            {"total": 9e-4, "known": True, "asked": 1e-3, "met": True},
            "900 um in total (1 mm requested); Newton",
        ),
        ({"total": 9e-3, "known": True, "asked": 1e-3, "met": False}, "(MISSED: 1 mm requested); Newton 0 um"),
        ({"total": 9e-3, "known": False}, "not known, about 9 mm"),
        ({"total": "not estimated (failed)", "known": False}, "error not estimated (failed) in total; Newton"),
        (
            {"total": 9e-3, "known": False, "fixed": {"cells": ""}, "of_refined": {"known": True}},
            "total not known, because that of cells is not; others about 9 mm; Newton",
        ),
        (
            {"total": 9e-3, "known": False, "fixed": {"dt": "too few steps"}, "of_refined": {"known": True}},
            "because that of dt (too few steps) is not",
        ),
        (
            {"total": 9e-4, "known": False, "met": False, "asked": 1e-3, "fixed": {"cells": ""}}
            | {"of_refined": {"known": True, "met": True}},
            "others about 900 um (met by these: 1 mm requested); Newton",
        ),
        ({"temporal": "not estimated (quasi-static)"}, "not estimated (quasi-static), Newton 0 um"),
    ],
)
def test_the_error_of_a_run_is_one_line_of_its_verdict(tmp_path, estimate, line):
    from small_scenes import small_scene

    from clothsim import simulate
    from clothsim.cli.run_command import verdict

    run = simulate(small_scene(run={"duration": 0.02}), tmp_path)
    nothing = {"newton": 0.0, "contact_gap": "not estimated (no contact)"}
    run.summary["certificate"]["error_estimate"] = nothing | estimate
    assert line in " ".join(verdict(run, []).split())


@pytest.mark.parametrize(("seconds", "text"), [(3.21, "3.2 s"), (245, "4:05 min"), (7390, "2:03:10 h")])
def test_clock(seconds, text):
    assert clock(seconds) == text


def test_a_fault_of_the_program_is_two_lines_too(capsys, monkeypatch, tmp_path):
    scene = tmp_path / "sheet.toml"
    scene.write_text('[cloth]\nmesh = "rectangle"\n[effects.gravity]\n')
    monkeypatch.chdir(tmp_path)

    def fails(*arguments, **keywords):
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr("clothsim.simulate", fails)
    assert main(["run", "sheet.toml"]) == 1
    assert capsys.readouterr().err.splitlines()[-2:] == [
        "ZeroDivisionError: a fault",
        "This is a fault of clothsim; --debug shows where.",
    ]


def test_scenes_are_listed_and_checked_by_name(capsys):
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split(maxsplit=1) == ["sphere", "A square metre of cotton falls on a ball"] for line in lines)
    assert main(["scenes", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["sphere"]) == {"file", "headline", "missing"}
    assert main(["check", "sphere"]) == 0
    assert "sphere.toml" in capsys.readouterr().out
    assert main(["run", "spher"]) == 2
    assert "'sphere'" in capsys.readouterr().err


# --- remedies of mistaken targets -----------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["check", "render", "bundle", "resume"])
def test_a_folder_without_a_run_is_answered_with_what_to_name(tmp_path, capsys, command):
    assert main([command, str(tmp_path)]) == 2
    sentence, remedy = capsys.readouterr().err.splitlines()
    assert str(tmp_path) in sentence
    assert "clothsim run SCENE -o DIR" in remedy


@pytest.mark.parametrize(
    ("sentence", "named"),
    [
        ("x holds no y, so it is not the output of a run.", ""),
        ("run.duration must be a number.", "run"),
        ("body[1].radius must be above 0.", "body"),
        ("cloth: 3 faults.", "cloth"),
        ("effects.air.drag is -1.", "effects.air"),
        ("There is no cloth.", ""),
    ],
)
def test_a_remedy_names_the_section_of_a_key_and_of_nothing_else(sentence, named):
    remedy = _short(InputError(sentence), ["explain"])[1]
    assert (f"clothsim keys {named}`" in remedy) is bool(named)
    assert remedy


# --- groups of commands -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (["garment", "fit", "a.obj"], ["fit", "a.obj"]),
        (["garment", "penetration", "a.obj", "--on", "b.obj"], ["check", "a.obj", "--on", "b.obj"]),
        (["design", "gradient", "sphere"], ["gradient", "sphere"]),
        (["design", "skirt.toml"], ["design", "skirt.toml"]),
        (["design", "design", "skirt.toml"], ["design", "skirt.toml"]),
        (["study", "study", "-o", "out"], ["study", "study", "-o", "out"]),
        (["farm", "sweep", "sphere"], ["sweep", "sphere"]),
        (["farm", "plan", "recipe.toml"], ["farm", "plan", "recipe.toml"]),
        (["farm", "check"], ["farm", "check"]),
        (["run", "sphere"], ["run", "sphere"]),
        ([], []),
    ],
)
def test_a_group_is_left_out_of_the_words(given, meant):
    assert without_group(given) == meant


def test_every_command_is_in_a_group_and_is_imported_alone(capsys):
    assert sorted(name for names in GROUPS.values() for name in names) == sorted(COMMANDS)
    assert main(["garment"]) == 2
    assert "unpose" in capsys.readouterr().out
    assert main(["info", "keis"]) == 2
    assert "'keys'" in capsys.readouterr().err
    code = (
        "import sys; from clothsim.cli import main\n"
        "try: main(['export', '--help'])\n"
        "except SystemExit: pass\n"
        "names = [name for name in sys.modules if name.endswith('_command')]\n"
        "print([*names, *(name for name in ('numpy', 'numba', 'scipy', 'vtk') if name in sys.modules)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "['clothsim.cli.export_command']"


def test_a_renamed_option_does_the_same_and_names_the_new_one(capsys):
    parser = parser_of_all()
    commands = next(action.choices for action in parser._actions if action.dest == "command")
    given = parser.parse_args(["farm", "verify", "drapes", "--share", ".5"])
    assert given.fraction == ".5"
    assert "--fraction" in capsys.readouterr().err
    assert parser.parse_args(["dress", "tunic", "--on", "shirt", "--hold"]).waistband is True
    assert "--waistband" in capsys.readouterr().err
    given = parser.parse_args(["dress", "tunic", "--on", "shirt", "--waistband"])
    assert given.waistband is True
    assert parser.parse_args(["dress", "tunic", "--on", "shirt"]).waistband is False
    assert capsys.readouterr().err == ""
    assert "--hold" not in commands["dress"].format_help()
    assert "--hold" not in script("bash")


def test_an_option_before_the_command_is_not_an_unknown_command(capsys):
    assert main(["--quiet", "explain"]) == 2
    assert "no command" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "value"),
    [(["--dt", "0.01", "good.toml"], "0.01"), (["good.toml", "--dt", "-.5"], "-.5"), (["good.toml", "--dt"], "...")],
)
def test_the_value_of_an_unknown_option_is_the_word_after_it(words, value, capsys):
    """One that the scene's place has taken, and a negative one, too."""
    assert main(["run", *words]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "good.toml" not in first
    assert second == f"Write it as --set solver.dt={value}."


@pytest.mark.parametrize("name", ["start", "group", "zip", "length_ratio"])
def test_no_option_is_answered_with_a_key_that_set_does_not_reach(name):
    """Keys of tables in a list, and such lists."""
    assert nearest_key(name) == ""
