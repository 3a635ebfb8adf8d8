"""A wheel with compiled kernels: built from a copy of the clone, which stays without them."""

import subprocess
from pathlib import Path

import pytest

from clothsim.base.errors import ClothsimError
from clothsim.base.kernel_cache import shipped, storage
from clothsim.cli import ship_kernels


@pytest.fixture
def commands(monkeypatch):
    """Commands that were run: one leaves a kernel as the compilation does, the other a wheel as pip does."""
    seen = []

    def run(command, env=None, check=False):
        assert check
        seen.append(command)
        if "--compile" in command:
            kernels = Path(env["NUMBA_CACHE_DIR"], "clothsim", "kernels", "identity")
            kernels.mkdir(parents=True)
            (kernels / f"membrane{storage.SUFFIX}").write_bytes(b"code")
            (kernels.parent / "last-removal").touch()
        else:
            folder, clone = (Path(each) for each in command[-2:])
            found = sorted(str(file.relative_to(clone)) for file in clone.rglob(f"*{storage.SUFFIX}"))
            folder.mkdir()
            (folder / "clothsim-py3-none-any.whl").write_text("\n".join(found))
            assert all((clone / name).exists() for name in ship_kernels.SOURCES)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(ship_kernels.subprocess, "run", run)
    monkeypatch.setattr(shipped, "can_run", lambda: True)
    return seen


def test_a_wheel_holds_kernels_and_the_clone_does_not(commands, tmp_path, capsys):
    before = shipped.FOLDER.exists()
    assert ship_kernels.main(["sphere", "--duration", "0.1", "--wheel", str(tmp_path / "dist")]) == 0
    (wheel,) = (tmp_path / "dist").iterdir()
    assert wheel.read_text() == str(
        Path("clothsim/base/kernel_cache/shipped_kernels/identity") / f"membrane{storage.SUFFIX}"
    )
    assert shipped.FOLDER.exists() is before
    compilation, build = commands
    assert compilation[-4:] == ["--duration", "0.1", "--compile", "sphere"]
    assert {"pip", "wheel", "--no-deps"} <= set(build)
    assert "1 kernels" in capsys.readouterr().out


def test_without_a_clone_there_is_no_wheel(commands, tmp_path, monkeypatch):
    monkeypatch.setattr(ship_kernels, "__file__", str(tmp_path / "clothsim" / "cli" / "ship_kernels.py"))
    with pytest.raises(ClothsimError, match="not a clone"):
        ship_kernels.build_wheel(["sphere"], 0.1, tmp_path)
    assert not commands


@pytest.mark.parametrize("words", [["nosuch"], ["sphere", "--duration", "nan"], ["sphere", "--duration", "-1"]])
def test_what_cannot_be_compiled_is_named_before_anything_is(commands, words, capsys):
    assert ship_kernels.main(words) == 2
    assert words[-1] in capsys.readouterr().err
    assert not commands


def test_a_command_that_fails_builds_nothing(monkeypatch, tmp_path, capsys):
    def fails(command, **_):
        raise subprocess.CalledProcessError(1, command)

    monkeypatch.setattr(ship_kernels.subprocess, "run", fails)
    monkeypatch.setattr(shipped, "can_run", lambda: True)
    before = shipped.FOLDER.exists()
    assert ship_kernels.main(["sphere", "--wheel", str(tmp_path / "dist")]) == 1
    assert "nothing was built" in capsys.readouterr().err
    assert shipped.FOLDER.exists() is before
    assert not (tmp_path / "dist").exists()
