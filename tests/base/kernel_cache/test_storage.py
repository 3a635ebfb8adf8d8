import os
import sys
import time
import warnings
from pathlib import Path

import pytest

from clothsim.base.kernel_cache import storage
from clothsim.base.kernel_cache.storage import DAY, SUFFIX, UNUSED_DAYS, can_write, read, remove_unused, root, write

FOLDER = "0123456789abcdef"


def aged(path, days):
    then = time.time() - days * DAY
    os.utime(path, (then, then))
    return path


def age_of(path):
    return (time.time() - path.stat().st_mtime) / DAY


def test_the_users_choice_comes_first(tmp_path):
    assert root(str(tmp_path)) == tmp_path / "clothsim" / "kernels"


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches"),
        ("linux", {"XDG_CACHE_HOME": "relative", "HOME": "/home/me"}, "/home/me/.cache"),
        ("linux", {"HOME": "/home/me"}, "/home/me/.cache"),
        ("darwin", {"XDG_CACHE_HOME": "/caches", "HOME": "/Users/me"}, "/Users/me/Library/Caches"),
        ("win32", {"LOCALAPPDATA": "/local", "HOME": "/Users/me"}, "/local"),
        ("win32", {"HOME": "/Users/me"}, "/Users/me/AppData/Local"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="paths of POSIX")
def test_each_platform_has_its_folder(platform, variables, expected, monkeypatch):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(storage.sys, "platform", platform)
    assert root() == Path(expected) / "clothsim" / "kernels"


def test_no_home_no_folder(monkeypatch):
    def no_home():
        raise RuntimeError

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(storage.Path, "home", no_home)
    assert root() is None


def test_what_is_written_is_read_and_nothing_else_is_left(tmp_path):
    path = tmp_path / FOLDER / f"a{SUFFIX}"
    assert read(path) is None
    assert write(path, b"old")
    assert write(path, b"new")
    assert read(path) == b"new"
    assert list(path.parent.iterdir()) == [path]


def test_a_use_renews_a_file_once_a_day(tmp_path):
    yesterday, today = tmp_path / "yesterday", tmp_path / "today"
    for path, days in ((yesterday, 3.0), (today, 0.5)):
        assert write(path, b"x")
        aged(path, days)
        assert read(path) == b"x"
    assert age_of(yesterday) < 0.1
    assert age_of(today) == pytest.approx(0.5, abs=0.1)


def test_files_unused_for_thirty_days_are_removed_and_nothing_else(tmp_path):
    folder = tmp_path / "kernels"
    old = folder / FOLDER / f"old{SUFFIX}"
    new = folder / FOLDER / f"new{SUFFIX}"
    alone = folder / FOLDER[::-1] / f"alone{SUFFIX}"
    others = [folder / FOLDER / "notes.txt", folder / "mine" / f"old{SUFFIX}", tmp_path / f"old{SUFFIX}"]
    for path in (old, new, alone, *others):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
        aged(path, UNUSED_DAYS + 1)
    linked = tmp_path / "linked"
    linked.mkdir()
    behind = linked / f"old{SUFFIX}"
    behind.write_bytes(b"x")
    aged(behind, UNUSED_DAYS + 1)
    (folder / f"{FOLDER[:-1]}0").symlink_to(linked, target_is_directory=True)
    aged(new, UNUSED_DAYS - 1)
    assert set(remove_unused(folder)) == {old, alone}
    assert not old.exists()
    assert not alone.parent.exists()
    assert all(path.exists() for path in (new, behind, *others))


def test_old_files_are_looked_for_once_a_day(tmp_path):
    path = tmp_path / FOLDER / f"old{SUFFIX}"
    assert remove_unused(tmp_path / "missing") == []
    assert remove_unused(tmp_path) == []
    assert write(path, b"x")
    aged(path, UNUSED_DAYS + 1)
    assert remove_unused(tmp_path) == []
    assert remove_unused(tmp_path, time.time() + 2 * DAY) == [path]


def test_a_folder_that_cannot_be_written_gives_one_warning(tmp_path):
    (tmp_path / "file").write_text("no folder")
    path = tmp_path / "file" / FOLDER / f"a{SUFFIX}"
    with pytest.warns(RuntimeWarning, match="NUMBA_CACHE_DIR"):
        assert not write(path, b"x")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not write(path, b"x")
    assert read(path) is None
    assert not can_write(path.parent)
    assert remove_unused(tmp_path / "file") == []
    assert can_write(tmp_path / "new" / "folder")
    assert list((tmp_path / "new" / "folder").iterdir()) == []


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b[:20] + b"?" + b[21:], lambda b: b"", lambda b: b + b"x"]
)
def test_a_damaged_file_is_not_read(tmp_path, damage):
    path = tmp_path / f"of{SUFFIX}"
    assert write(path, b"machine code of a kernel")
    path.write_bytes(damage(path.read_bytes()))
    assert read(path) is None
    assert write(path, b"machine code of a kernel")
    assert read(path) == b"machine code of a kernel"
