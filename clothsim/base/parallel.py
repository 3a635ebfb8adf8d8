"""Threads of a step: independent tasks side by side, with the same results at every number of threads.

Tasks share nothing that one of them writes, and their results are taken in the order in which they are given: so no bit
depends on the number of threads or on which of them takes a task. A task gains where its time goes into code that
releases Python's lock: kernels (`jit`), NumPy's and MKL's.
"""

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


def available_cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Helpers(threading.local):
    """The helping threads of the thread that takes a step; the helpers themselves have none."""

    pool: ThreadPoolExecutor | None = None


_helpers = _Helpers()


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let `together` take up to `count` threads in this block: the calling one and helpers, which end with the block.

    None is started for a count of 1, before the first task, or within a block that has helpers.
    """
    if count <= 1 or _helpers.pool is not None:
        yield
        return
    with ThreadPoolExecutor(count - 1, thread_name_prefix="clothsim") as pool:
        _helpers.pool = pool
        try:
            yield
        finally:
            _helpers.pool = None


def together(*tasks: Callable[[], T], long: bool = True) -> list[T]:
    """Call functions without arguments, side by side where the block has threads; return their results in order.

    A task that no helper has begun is taken by the caller. An error, also Ctrl-C, is raised once no task runs any more:
    that of the first of the tasks that failed. Tasks that are not `long` (0.1 ms) are not worth a thread.

    Examples
    --------
    >>> with threads(2):
    ...     together(lambda: 1, lambda: 2)
    [1, 2]
    """
    pool = _helpers.pool
    if pool is None or not long or len(tasks) < 2:
        return [task() for task in tasks]
    futures: list[Future[T]] = [pool.submit(task) for task in tasks[1:]]
    try:
        results = [tasks[0]()]
        for task, future in zip(tasks[1:], futures, strict=True):
            results.append(task() if future.cancel() else future.result())
    finally:
        for future in futures:
            future.cancel()
        wait(futures)
    return results
