"""The cache of one kernel, in the place where numba's dispatcher asks for one, and the hash that names its entries.

The hash is of the kernel's code, of all functions that it calls, and of the values that these use. It is taken from
what is in memory, not from files: an editor may have changed a file since Python read it, and what is compiled is what
Python read. Paths and comments therefore do not enter, and no file is needed (a notebook, an archive).

Numba binds the names of a function when it compiles: a global is a constant. So the code of a kernel follows from the
bytecode of the functions that are bound to their names, from the values that other names stand for, and from the
options of the compiler. A value that has no lasting description (an object of an unknown class) makes the kernel
`UnnameableError`: it is not cached rather than cached under an incomplete name. Not seen are extensions of
numba's own types and of NumPy's functions by others (`overload_method`, `overload(numpy...)`); nothing here has one.
"""

import dis
import enum
import functools
import hashlib
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import config
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps
from numba.extending import _Intrinsic

from clothsim.base.kernel_cache import shipped, storage
from clothsim.base.kernel_cache.pipelines import KernelCompiler, PartCompiler
from clothsim.base.kernel_cache.shipped import identity

PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), range, slice)
"""Types that `repr` describes completely."""

_READ_THE_FIRST_CONSTANT = {(instruction, 0) for instruction in dis.hasconst}
_TYPES = (types.Number, types.Boolean, types.Array, types.Literal, types.NoneType, types.UnicodeType)
"""Types of arguments that are described by their names: classes, and functions as arguments, are not."""


class UnnameableError(Exception):
    """Value without a complete description that is identical in every process."""


def unnameable(value: Any) -> str:
    """Raise the error, in the place of a text."""
    raise UnnameableError(f"{value!r} of {type(value).__module__}.{type(value).__qualname__}")


def plain(value: Any) -> str:
    """Description of a value of the types `PLAIN`."""
    return f"{type(value).__qualname__} {value!r}"


def array(value: Any) -> str:
    """Description of a NumPy array or scalar: its bytes."""
    if value.dtype.hasobject:
        return unnameable(value)
    return f"array {value.dtype.descr} {value.shape} {value.strides} {value.tobytes().hex()}"


def named_type(value: Any) -> str:
    """Description of a type of numba, NumPy or LLVM; `UnnameableError` where its name holds an address."""
    text = f"{type(value).__qualname__} {value}"
    return unnameable(value) if "0x" in text else text


@functools.cache
def code_text(code: CodeType) -> str:
    """Bytecode, names and constants; neither its file, nor its lines, nor its docstring."""
    variables = code.co_varnames, code.co_freevars, code.co_cellvars, code.co_names
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    table = getattr(code, "co_exceptiontable", b"")
    skipped = 0
    if code.co_consts and isinstance(code.co_consts[0], str):  # a docstring, where no instruction reads it
        instructions = set(zip(code.co_code[::2], code.co_code[1::2], strict=True))
        skipped = int(instructions.isdisjoint(_READ_THE_FIRST_CONSTANT))
    constants = [_constant(value) for value in code.co_consts[skipped:]]
    return repr((code.co_code, table, variables, counts, len(code.co_consts), constants))


def _constant(value: Any) -> str:
    """One of those that a code object holds: a frozen set has its own order in each process."""
    if isinstance(value, tuple):
        return f"tuple {[_constant(item) for item in value]}"
    if isinstance(value, frozenset):
        return f"set {sorted(_constant(item) for item in value)}"
    return code_text(value) if isinstance(value, CodeType) else plain(value)


def names_in_code(code: CodeType) -> set[str]:
    """Those that the code and the functions within it look up: globals, and attributes too."""
    within = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(names_in_code, within))


def digest_of_types(signature: Any) -> str:
    """A hash of 12 digits of the types of a kernel's arguments; `UnnameableError` where a function or class is one."""
    arguments = signature if isinstance(signature, tuple) else signature.args
    described = [_type(argument) for argument in arguments]
    returned = None if isinstance(signature, tuple) else signature.return_type
    return hashlib.blake2b(repr((described, str(returned))).encode(), digest_size=6).hexdigest()


def _type(argument: Any) -> str:
    if isinstance(argument, types.BaseTuple):
        return f"{argument} {getattr(argument, 'fields', ())} {[_type(item) for item in argument]}"
    if isinstance(argument, types.Optional):
        return f"{argument} {_type(argument.type)}"
    if isinstance(argument, types.Omitted):
        return f"omitted {argument.value!r}" if isinstance(argument.value, PLAIN) else unnameable(argument)
    return str(argument) if isinstance(argument, _TYPES) else unnameable(argument)


VERSIONED = {"builtins", "math", "cmath", "typing", "collections", "numpy", "numba", "llvmlite"}
"""Packages whose functions are identified by their version, or Python's, a part of `shipped.identity`."""


def digest(kernel: Dispatcher, target_context: Any) -> str:
    """A hash of 24 digits of all that a kernel is compiled from, its types apart.

    Parameters
    ----------
    kernel : numba.core.dispatcher.Dispatcher
        With the options of its compiler.
    target_context : numba.core.cpu.CPUContext
        It knows the compiler's options of functions made by numba's `register_jitable` and `overload`.

    Raises
    ------
    UnnameableError
        Where it uses a value without a lasting description.
    """
    target_context.refresh()  # takes in what was registered since
    return _Walk(target_context.typing_context).hash_of(kernel)


class _Walk:
    """Traversal of the call graph: each function is described once, later named by its number."""

    def __init__(self, typing_context: Any) -> None:
        self._typing_context = typing_context
        self._numbers: dict[FunctionType, int] = {}
        self._functions: list[FunctionType] = []
        self._kinds: list[tuple[Any, Callable[[Any], str]]] = [
            ((enum.Enum, *PLAIN), plain),
            ((tuple, list), lambda values: f"{type(values).__qualname__} {[self.describe(each) for each in values]}"),
            ((set, frozenset), lambda values: f"set {sorted(self.describe(each) for each in values)}"),
            (dict, lambda values: f"dict {sorted((self.describe(k), self.describe(v)) for k, v in values.items())}"),
            ((np.ndarray, np.generic), array),
            ((types.Type, np.dtype, ir.Type, ir.Constant), named_type),
        ]
        self._callables: list[tuple[Any, Callable[[Any], str]]] = [
            (CodeType, code_text),
            (FunctionType, lambda value: f"function {self._number(value)}"),
            (
                Dispatcher,
                lambda value: (
                    f"compiled {self._number(value.py_func)} "
                    + self.describe((value.targetoptions, value.locals, value._compiler.pipeline_class))
                ),
            ),
            (_Intrinsic, lambda value: f"intrinsic {self._number(value._defn)} {value._prefer_literal}"),
            (type, self._class),
        ]

    def hash_of(self, kernel: Dispatcher) -> str:
        hasher = hashlib.blake2b(self.describe(kernel).encode(), digest_size=12)
        for function in self._functions:  # grows while they are described
            hasher.update(self._describe_function(function).encode())
        return hasher.hexdigest()

    def _number(self, function: Any) -> int:
        if function not in self._numbers:
            self._numbers[function] = len(self._functions)
            self._functions.append(function)
        return self._numbers[function]

    def _describe_function(self, function: FunctionType) -> str:
        """Its code, its defaults, the values of its names, and the compiler's options that numba registered for it."""
        code = function.__code__
        names = frozenset(names_in_code(code))
        values = function.__globals__
        used = {name: self.describe(values[name], names) for name in sorted(names.intersection(values))}
        cells = []
        for cell in function.__closure__ or ():
            try:
                cells.append(self.describe(cell.cell_contents))
            except ValueError:  # empty: the name is not bound yet
                cells.append("empty")
        defaults = self.describe((function.__defaults__, function.__kwdefaults__))
        registered = self._typing_context._get_global_type(function)  # what stands for it in kernels
        overloads = [
            self.describe((template._jit_options, template._inline.value, template._overload_func))
            for template in getattr(registered, "templates", ())
            if hasattr(template, "_overload_func")
        ]
        return repr((code_text(code), defaults, used, cells, overloads))

    def describe(self, value: Any, names: frozenset[str] = frozenset()) -> str:
        """A text that is the same for the same value in each process.

        names: those that the code mentions, attributes included: of a module only they are looked at.
        """
        for kinds, described in self._kinds:
            if isinstance(value, kinds):
                return described(value)
        if isinstance(value, ModuleType):
            if _is_versioned(value.__name__):
                return f"module {value.__name__}"
            used = sorted(names.intersection(vars(value)))
            return f"module {[(name, self.describe(vars(value)[name], names - {name})) for name in used]}"
        if callable(value) and (name := _versioned_name(value)):
            return name
        for kinds, described in self._callables:
            if isinstance(value, kinds):
                return described(value)
        return unnameable(value)

    def _class(self, value: type) -> str:
        if value in (KernelCompiler, PartCompiler):  # their code is a matter of `shipped.FORMAT`
            return value.__qualname__
        if issubclass(value, enum.Enum):
            return f"enum {[(name, self.describe(member.value)) for name, member in value.__members__.items()]}"
        if issubclass(value, tuple) and hasattr(value, "_fields"):
            return f"fields {value._fields}"
        return unnameable(value)


def _versioned_name(value: Any) -> str:
    """Qualified name of a function or class of a versioned package; empty for all others.

    An object that only looks like a function, as numba's `vectorize` makes, has the module of its class for its own.
    """
    name, module = getattr(value, "__name__", None), getattr(value, "__module__", None)
    if not (isinstance(name, str) and isinstance(module, str) and _is_versioned(module)):
        return ""
    own = isinstance(value, FunctionType | BuiltinFunctionType | type)
    found = own or getattr(sys.modules.get(module), name, None) is value
    return f"{module}.{getattr(value, '__qualname__', name)}" if found else ""


def _is_versioned(module: str) -> bool:
    return module.partition(".")[0] in VERSIONED


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
        try:
            return None if content is None else CompileResult._rebuild(target_context, *pickle.loads(content))
        except Exception:  # a damaged file may raise anything: the kernel is compiled and stored once more
            return None

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

        UnnameableError as `digest`.
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


@functools.cache
def _remove_unused_once(root: Path) -> None:
    storage.remove_unused(root)
