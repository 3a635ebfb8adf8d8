"""Claims: at most one living process makes a drape.

A claim is a file that is created exclusively; its time of change is the heartbeat. Whoever finds one without a
heartbeat renames it away, which succeeds for one process only, and claims the drape again. A process that was suspended
finds another token in its claim when it wakes up (`owns_claim`): then it publishes and removes nothing.
"""

import json
import os
import platform
import threading
import uuid
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import time
from typing import Any

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_regular_file


@dataclass(frozen=True)
class Worker:
    """A process that makes drapes: its own name in claims, and the times that tell whether one is alive.

    Attributes
    ----------
    beat : float
        Time between two heartbeats [s].
    stale_after : float
        A claim whose last heartbeat is older is taken over [s].
    longest : float
        After that time a claim has no heartbeats any more, so that a drape that hangs is given up [s].
    """

    beat: float = 5.0
    stale_after: float = 60.0
    longest: float = 3600.0
    token: str = field(default_factory=lambda: f"{os.getpid()}-{uuid.uuid4().hex[:12]}")


def worker_of(stale_after: float) -> Worker:
    """A worker with several heartbeats in the time after which a claim is stale [s]."""
    return Worker(beat=min(Worker.beat, stale_after / 6), stale_after=stale_after)


@contextmanager
def claimed(folder: Path, name: str, worker: Worker) -> Iterator[bool]:
    """Claim the drape with the id `name` in the folder of the claims for the block; False where another has it."""
    path = folder / name
    taken = _create(path, worker)
    if not taken:
        stale = _content(path).get("token")
        taken = is_stale(path, worker) and _removed(path, stale, worker) and _create(path, worker)
    if not taken:
        yield False
        return
    ended = threading.Event()

    def beat() -> None:
        for _ in range(max(1, int(worker.longest / worker.beat))):
            if ended.wait(worker.beat) or _content(path).get("token") != worker.token:
                return
            with suppress(OSError):
                os.utime(path)

    heart = threading.Thread(target=beat, daemon=True)
    heart.start()
    try:
        yield True
    finally:
        ended.set()
        heart.join()
        if owns_claim(folder, name, worker):
            _removed(path, worker.token, worker)


def owns_claim(folder: Path, name: str, worker: Worker) -> bool:
    """True where the claim of a drape is the worker's own: no other has taken it over while it was suspended."""
    return bool(_content(folder / name).get("token") == worker.token)


def claims_of(folder: Path, processes: Collection[int]) -> list[Path]:
    """The claims of processes of this machine, given by their numbers."""
    claims = [path for path in folder.iterdir() if not path.name.startswith(".")]
    contents = [(path, _content(path)) for path in claims]
    return [path for path, own in contents if own.get("host") == platform.node() and own.get("pid") in processes]


def is_stale(path: Path, worker: Worker) -> bool:
    """True where the process that claimed has ended, or its heartbeat is too old; False where there is no claim."""
    try:
        seen = path.stat().st_mtime
    except FileNotFoundError:
        return False
    clock = path.parent / f".clock.{worker.token}"
    try:  # by the clock that stamps the claims: that of a file server may differ from this machine's
        clock.touch()
        now = clock.stat().st_mtime
        clock.unlink(missing_ok=True)
    except OSError:
        now = time()
    if now - seen > worker.stale_after:
        return True
    owner = _content(path)
    return owner.get("host") == platform.node() and not _alive(owner.get("pid"), owner.get("born"))


def _create(path: Path, worker: Worker) -> bool:
    """Create the claim; False where there is one."""
    text = {"token": worker.token, "host": platform.node(), "pid": os.getpid(), "born": _born(os.getpid())}
    try:
        handle = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
    except FileExistsError:
        return False
    try:
        os.write(handle, json.dumps(text).encode())
    finally:
        os.close(handle)
    return True


def _removed(path: Path, token: Any, worker: Worker) -> bool:
    """Rename the claim with a token away; False where there is another one, which goes back to its place."""
    aside = path.with_name(f".{path.name}.{worker.token}")
    try:
        os.rename(path, aside)
    except FileNotFoundError:
        return False
    meant = _content(aside).get("token") == token
    if not meant:  # a new claim came between the look and the rename: it goes back, if its place is still free
        with suppress(OSError):
            os.link(aside, path)
    aside.unlink(missing_ok=True)
    return meant


def _content(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_regular_file(path))
    except (InputError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _alive(pid: Any, born: Any) -> bool:
    """True where a process of this machine with that number and time of start is running, or it cannot be told."""
    if not isinstance(pid, int):
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    now = _born(pid)
    return now is None or born is None or now == born


def _born(pid: int) -> str | None:
    """Start of a process in ticks since boot; None where the system does not tell, "ended" of one not yet reaped."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    except OSError:
        return None
    return "ended" if fields[0] == "Z" else fields[19]
