"""Structure of the package, read from its sources: rooms, imports between them, modules with one importer."""

import ast
import re
from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import clothsim

ROOT = Path(clothsim.__file__).parents[1]
APPLICATIONS = ("garments", "study", "viewer", "cli")
OPEN = ("base",)
"""Rooms that everyone may import."""
DOORS = ("patterns", "files", "render", "gradients")
"""Engine rooms that applications import as a whole: their `__init__` names what they offer."""


@dataclass(frozen=True)
class Import:
    """An import of a module of the package; name: of what is taken from it, empty for the module itself."""

    importer: str
    module: str
    name: str
    within_function: bool
    for_types: bool


def module_name(file: Path) -> str:
    """Dotted name of a file of the package."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def module_files() -> dict[str, Path]:
    """The files of both packages by dotted name."""
    return {module_name(file): file for top in ("clothsim", "transfer") for file in (ROOT / top).rglob("*.py")}


@cache
def tree(module: str) -> ast.Module:
    """Syntax tree of a module."""
    return ast.parse(module_files()[module].read_text(encoding="utf-8"))


@cache
def all_imports() -> tuple[Import, ...]:
    """Every import of a module of the packages by another one."""
    return tuple(found for module in module_files() for found in _imports_of(module))


def room(module: str) -> str:
    """The room of a module: "garments" of clothsim.garments.fitted; "transfer"; "clothsim" for its own names."""
    parts = module.split(".")
    return parts[1] if parts[0] == "clothsim" and len(parts) > 1 else parts[0]


def arrows() -> set[tuple[str, str]]:
    """Pairs of rooms of which the first imports the second."""
    found = {(room(one.importer), room(one.module)) for one in all_imports()}
    return {(importer, imported) for importer, imported in found if importer != imported}


def engine_names() -> set[tuple[str, str]]:
    """(module, name) of an engine room's module that an application imports past the doors."""
    closed = {room(module) for module in module_files()} - {*APPLICATIONS, *OPEN, "clothsim", "transfer", "engine"}
    return {
        (one.module, one.name)
        for one in all_imports()
        if room(one.importer) in APPLICATIONS
        and room(one.module) in closed
        and one.module not in {f"clothsim.{door}" for door in DOORS}
    }


def single_importers() -> list[str]:
    """Modules that one module imports, which is in the same folder."""
    importers = defaultdict(set)
    for one in all_imports():
        importers[one.module].add(one.importer)
    return sorted(
        module
        for module, users in importers.items()
        if len(users) == 1 and module.rpartition(".")[0] == next(iter(users)).rpartition(".")[0]
    )


def function_imports() -> int:
    """Imports inside of functions, of anything."""
    return sum(
        isinstance(node, ast.Import | ast.ImportFrom)
        for module in module_files()
        for function in _outer_functions(tree(module))
        for node in ast.walk(function)
    )


def repeated_names(kind: type[ast.ClassDef] | type[ast.FunctionDef]) -> dict[str, list[str]]:
    """Public names of classes or functions at the top of several modules, by name."""
    homes = defaultdict(list)
    for module in module_files():
        for node in tree(module).body:
            if isinstance(node, kind) and not node.name.startswith("_"):
                homes[node.name].append(module)
    return {name: modules for name, modules in homes.items() if len(modules) > 1}


ELSEWHERE = {"overload_method", "jax_enable_x64", "__name__"}
"""Names of other packages in docstrings."""


SHORT = 8
"""Lines of code of a function, without its docstring, up to which it may read better in its one caller."""


def short_helpers() -> list[tuple[str, str]]:
    """(module, name) of private functions of at most SHORT lines that are used once in their module; none decorated."""
    found = []
    for module in module_files():
        every = list(ast.walk(tree(module)))
        used = Counter(node.id for node in every if isinstance(node, ast.Name))
        used.update(node.attr for node in every if isinstance(node, ast.Attribute))
        for node in every:
            if not isinstance(node, ast.FunctionDef) or not re.match(r"_[^_]", node.name) or node.decorator_list:
                continue
            body = node.body[1:] if ast.get_docstring(node) and len(node.body) > 1 else node.body
            if used[node.name] == 1 and (node.end_lineno or 0) - body[0].lineno < SHORT:
                found.append((module, node.name))
    return found


def unknown_names() -> list[tuple[str, str]]:
    """(module, name) of names with an underscore in back quotes of docstrings that neither package has."""
    known = set(ELSEWHERE)
    quoted = []
    for module in module_files():
        known.update(module.split("."))
        for node in ast.walk(tree(module)):
            known.update(getattr(node, key) for key in ("id", "attr", "arg", "name", "asname") if hasattr(node, key))
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isidentifier():
                known.add(node.value)  # a key of a file
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                quoted += [(module, name) for name in _QUOTED.findall(ast.get_docstring(node) or "")]
    parts = [(module, name.rpartition(".")[2]) for module, name in quoted if not name.startswith("tests.")]
    return [(module, name) for module, name in parts if "_" in name and name not in known]


_QUOTED = re.compile(r"`([A-Za-z_][\w.]*)(?:\(\))?`")


def lines() -> int:
    """Lines of both packages."""
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in module_files().values())


def _outer_functions(tree: ast.AST) -> list[ast.AST]:
    """Functions that are not inside another one."""
    found, todo = [], [tree]
    while todo:
        for node in ast.iter_child_nodes(todo.pop()):
            (found if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else todo).append(node)
    return found


def _imports_of(module: str) -> list[Import]:
    found: list[Import] = []
    files = module_files()

    def visit(node: ast.AST, within: bool, types: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                found.extend(Import(module, a.name, "", within, types) for a in child.names if a.name in files)
            elif isinstance(child, ast.ImportFrom) and child.module:
                for alias in child.names:
                    full = f"{child.module}.{alias.name}"
                    target, name = (full, "") if full in files else (child.module, alias.name)
                    if target in files:
                        found.append(Import(module, target, name, within, types))
            else:
                inner = within or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
                typed = types or (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test))
                visit(child, inner, typed)

    visit(tree(module), within=False, types=False)
    return found
