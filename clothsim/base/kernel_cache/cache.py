"""The cache of one kernel, in the place where numba's dispatcher asks for one."""

import functools
import pickle
from pathlib import Path
from typing import Any

from numba.core import config
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from clothsim.base.kernel_cache import shipped, storage
from clothsim.base.kernel_cache.compiler import identity
from clothsim.base.kernel_cache.descriptions import UnnameableError, digest_of_types
from clothsim.base.kernel_cache.digest import digest

LONGEST = 100
"""Characters of a kernel's name in the names of its files; Windows limits a path to 260."""


class KernelCache(NullCache):
    """Machine code of a kernel, by argument types.

    Parameters
    ----------
    kernel : numba.core.dispatcher.Dispatcher
        It asks this cache before it compiles.
    """

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
        self._places: dict[Any, Path] = {}

    @property
    def cache_path(self) -> str | None:
        """The folder of all kernels' caches; None where there is none."""
        root = storage.root(config.CACHE_DIR)
        return None if root is None else str(root)

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """The machine code for these types, None where it has to be compiled."""
        self._places.pop(sig, None)
        try:
            stem = self.stem(target_context)
            place = None if stem is None else stem.with_name(f"{stem.name}-{digest_of_types(sig)}{storage.SUFFIX}")
        except UnnameableError as error:
            storage.warn_once(f"Each process compiles {self._name}: it uses {error}, which has no lasting description.")
            return None
        if place is None:
            return None
        self._places[sig] = place  # of the code as it is now, before it is compiled
        _remove_unused_once(place.parents[1])
        content = storage.read(place) or shipped.read(place.name, target_context.codegen())
        return None if content is None else _rebuilt(content, target_context)

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store the machine code for these types; not where it holds addresses of this process."""
        place = self._places.pop(sig, None)
        lasting = not data.library.has_dynamic_globals and all(loop.can_cache for loop in data.lifted)
        if place is not None and lasting:
            storage.write(place, dumps(data._reduce()))

    def flush(self) -> None:
        """Nothing: a name stands for one content."""

    def stem(self, target_context: Any) -> Path | None:
        """Common prefix of the paths of this kernel's files; None where no folder can be chosen.

        Raises
        ------
        UnnameableError
            As `digest`.
        """
        root = storage.root(config.CACHE_DIR)
        if root is None:
            return None
        code = digest(self._kernel, target_context)
        name = self._name.replace("<", "").replace(">", "")  # of a function within another: not in Windows' names
        return root / identity(target_context.codegen()) / f"{name[-LONGEST:]}-{code}"


def is_cached(kernel: Any) -> bool:
    """True where machine code of the kernel is on disk, for any types; shipped or compiled here."""
    if not hasattr(kernel, "targetctx"):  # NUMBA_DISABLE_JIT: a function of Python, nothing to compile
        return True
    try:
        stem = kernel._cache.stem(kernel.targetctx)
    except UnnameableError:
        return False
    if stem is None:
        return False
    folders = filter(None, (stem.parent, shipped.folder_for(kernel.targetctx.codegen())))
    return any(any(folder.glob(f"{stem.name}-*{storage.SUFFIX}")) for folder in folders)


def cached_kernels() -> int:
    """Number of files of machine code that were compiled here, by any process and for any compiler's identity."""
    root = storage.root(config.CACHE_DIR)
    return 0 if root is None else sum(1 for _ in root.glob(f"*/*{storage.SUFFIX}"))


def can_store() -> bool:
    """True where the folder for machine code exists and can be written."""
    root = storage.root(config.CACHE_DIR)
    return root is not None and storage.can_write(root)


def _rebuilt(content: bytes, target_context: Any) -> CompileResult | None:
    try:
        return CompileResult._rebuild(target_context, *pickle.loads(content))
    except Exception:  # a damaged file may raise anything: the kernel is compiled and stored once more
        return None


@functools.cache
def _remove_unused_once(root: Path) -> None:
    storage.remove_unused(root)
