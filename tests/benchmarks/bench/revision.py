"""Git revision of the package in a temporary worktree."""

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from clothsim.base.errors import InputError


def name_of(root: Path) -> str:
    """The short name of the revision that a folder is at, with a + where files of it are changed; "" without git."""
    try:
        name = _git(root, "rev-parse", "--short", "HEAD")
        return name + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no", "--", "clothsim") else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


@contextmanager
def worktree(root: Path, revision: str) -> Iterator[Path]:
    """A temporary folder with the files of `revision`. InputError without git, its history, or that revision."""
    try:
        _git(root, "rev-parse", "--git-dir")
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(
            f"--compare {revision} needs git and the package's history, which are not here.",
            "Run it in a clone of the repository.",
        ) from error
    try:
        commit = _git(root, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}")
    except subprocess.CalledProcessError as error:
        raise InputError(f"--compare: git knows no revision {revision!r}.", "See `git log --oneline`.") from error
    with tempfile.TemporaryDirectory(prefix="clothsim-bench-") as folder:
        there = Path(folder) / "then"
        _git(root, "worktree", "add", "--detach", str(there), commit)
        try:
            yield there
        finally:
            _git(root, "worktree", "remove", "--force", str(there))


def _git(root: Path, *arguments: str) -> str:
    """Output of a git command; CalledProcessError where it fails, OSError where there is none."""
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
