"""Automation by the command line: one JSON document on stdout, events on stderr, exit codes, completion."""

import argparse
import json
import shutil
import subprocess

import pytest
from command_line import FREE

from clothsim.cli import COMMANDS, main, parser_of_all
from clothsim.cli.info_command import script


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "free.toml").write_text(FREE)
    return tmp_path


def answer(capsys, *words):
    """Exit code, document and events of a command."""
    code = main([*words, "--json"])
    out, err = capsys.readouterr()
    assert "\n" not in out.strip()
    return code, json.loads(out) if out else None, [json.loads(line) for line in err.splitlines()]


def test_every_command_that_answers_has_json():
    commands = next(action.choices for action in parser_of_all()._actions if action.dest == "command")
    own = {name: parsers_of(parser) for name, parser in commands.items()}
    without = [name for name, all_ in own.items() if not all("--json" in each._option_string_actions for each in all_)]
    assert without == ["completion"]


def parsers_of(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    """Parsers of the actions of a command that has some, else its own."""
    return next((list(action.choices.values()) for action in parser._actions if action.dest == "action"), [parser])


def test_a_run_is_a_document_and_events_of_progress(place, capsys):
    code, summary, events = answer(capsys, "run", "free.toml", "-o", "out", "--no-picture")
    assert code == 0
    assert summary["status"] == "completed"
    kinds = [event["event"] for event in events]
    assert set(kinds) == {"message", "progress"}
    steps = [event for event in events if event["event"] == "progress"]
    assert [step["step"] for step in steps] == list(range(1, summary["steps"] + 1))
    assert steps[-1]["time"] == pytest.approx(steps[-1]["duration"])
    assert steps[0]["minimum_gap"] is None  # no number: nothing is near
    for words, keys in (
        (["export", "out", "-o", "a.obj"], {"files", "frames", "rate", "interpolated", "up", "unit", "notes"}),
        (["bundle", "out"], {"file", "bytes"}),
        (["render", "out", "--size", "320x240"], {"file", "note"}),
        (["check", "out"], {"target", "code", "errors", "warnings", "notes", "findings"}),
    ):
        code, document, events = answer(capsys, *words)
        assert code == 0
        assert set(document) == keys
        assert not [event for event in events if event["event"] == "error"]


def test_a_fault_that_check_finds_is_in_its_document(place, capsys):
    (place / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\nf 1 2 3\n")
    code, document, _ = answer(capsys, "check", "bad.obj")
    assert code == document["code"] == 1
    assert document["errors"]
    assert any("4 vertices" in note for note in document["notes"])


@pytest.mark.parametrize("words", [["run", "nothing.toml"], ["fabrics", "steel"], ["export", "nothing", "-o", "a.obj"]])
def test_bad_input_is_one_event_and_code_2(place, capsys, words):
    code, document, events = answer(capsys, *words)
    assert code == 2
    assert document is None
    assert [event["event"] for event in events] == ["error"]
    assert events[0]["sentence"]
    assert events[0]["remedy"]


def test_lists_are_documents(capsys):
    _, fabrics, _ = answer(capsys, "fabrics", "denim")
    assert fabrics["denim"]["values"]["density"] == pytest.approx(0.4, abs=0.3)
    _, keys, _ = answer(capsys, "keys", "solver.dt")
    assert keys["solver"]["keys"]["dt"]["unit"] == "s"
    _, everything, _ = answer(capsys, "keys")
    assert {"cloth", "run", "effects.gravity"} <= set(everything)


def completed(text, *words):
    """The words that bash proposes for the last of `words`."""
    line = " ".join(f"'{word}'" for word in words)
    program = f'{text}\nCOMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; _shtab_clothsim; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True)
    return done.stdout.split()


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_options_choices_and_files(place):
    text = script("bash")
    assert completed(text, "clothsim", "ex") == ["explain", "export"]
    assert completed(text, "clothsim", "export", "--f") == ["--frame", "--fps"]
    assert completed(text, "clothsim", "export", "--up", "") == ["y", "z"]
    assert completed(text, "clothsim", "completion", "f") == ["fish"]
    assert completed(text, "clothsim", "farm", "wo") == ["work"]
    assert completed(text, "clothsim", "run", "fr") == ["free.toml"]
    assert completed(text, "clothsim", "run", "shou") == ["shoulders"]
    assert completed(text, "clothsim", "render", "--field", "energy") == ["energy_density"]
    assert completed(text, "clothsim", "view", "--field", "str") == ["stretch", "stress"]
    assert completed(text, "clothsim", "fabrics", "den") == ["denim"]
    assert completed(text, "clothsim", "keys", "effects.gra") == ["effects.gravity"]


@pytest.mark.parametrize("section", ["", "solver", "cloth", "effects.friction"])
def test_keys_stay_within_a_hundred_columns(capsys, section):
    assert main(["keys", *filter(None, [section])]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 10
    assert max(map(len, lines)) <= 100


def test_scripts_of_other_shells_name_every_command(capsys):
    for shell in ("zsh", "fish", "tcsh"):
        text = script(shell)
        assert all(command in text for command in COMMANDS)
    assert main(["completion", "fish"]) == 0
    assert capsys.readouterr().out == script("fish") + "\n"
    assert main(["completion", "elvish"]) == 2
