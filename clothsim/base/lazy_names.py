"""Lazy names: a module's `if TYPE_CHECKING:` block as the one list of what it offers, imported when it is used."""

import ast
import sys
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_names(
    module: str, *more: str, earlier: Mapping[str, str] | None = None
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` (PEP 562) of a module.

    Parameters
    ----------
    module : str
        Its `__name__`. The imports of its `if TYPE_CHECKING:` block, which type checkers read, are its names.
    *more : str
        Other names that `dir` shows.
    earlier : mapping of str to str, optional
        Earlier names and what each is now; they still work, with a DeprecationWarning.

    Returns
    -------
    __getattr__, __dir__ : callable
        For the module; a name is imported when it is first asked for, and kept.
    __all__ : list of str
        The names in alphabetical order.
    """
    own = sys.modules[module]
    homes = {  # module and original name of each name that an `if TYPE_CHECKING:` block imports
        alias.asname or alias.name: (node.module, alias.name)
        for block in ast.parse(Path(str(own.__file__)).read_text(encoding="utf-8")).body
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }

    def __getattr__(name: str) -> Any:
        if earlier and name in earlier:
            warnings.warn(f"{module}.{name} is now {earlier[name]}.", DeprecationWarning, stacklevel=2)
            return getattr(own, earlier[name])
        if name not in homes:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        home, original = homes[name]
        value = getattr(import_module(home), original)
        setattr(own, name, value)
        return value

    def __dir__() -> list[str]:
        return [*sorted(homes), *more]

    return __getattr__, __dir__, sorted(homes)
