"""Import graph of the package, read from the sources: modules that an effect needs, and those only it needs."""

import ast
from functools import cache
from pathlib import Path

import clothsim
from clothsim.scene.effects import EFFECTS

PACKAGE = Path(clothsim.__file__).parent
FLOORS = ("clothsim.physics.energies.", "clothsim.physics.contact.")
"""Where effects live."""


def _name(file):
    return ".".join(["clothsim", *file.relative_to(PACKAGE).with_suffix("").parts]).removesuffix(".__init__")


FILES = {_name(file): file for file in PACKAGE.rglob("*.py")}


@cache
def imports(module, within_functions):
    """The modules of the package that a module imports, at its top or also inside of its functions."""
    found = set()
    todo = [ast.parse(FILES[module].read_text(encoding="utf-8"))]
    while todo:
        for node in ast.iter_child_nodes(todo.pop()):
            if isinstance(node, ast.FunctionDef) and not within_functions:
                continue
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                continue
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            if isinstance(node, ast.ImportFrom) and node.module:
                found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            todo.append(node)
    return frozenset(found & set(FILES))


def reached(*roots, within_functions):
    """The modules that importing the roots imports, or, within functions too, may come to import."""
    seen, todo = set(), list(roots)
    while todo:
        module = todo.pop()
        if module not in seen:
            seen.add(module)
            todo += [*imports(module, within_functions), *([module.rpartition(".")[0]] if "." in module else [])]
    return seen


def of_effects(modules):
    """Those of the modules in which effects live."""
    return {module for module in modules if module.startswith(FLOORS)}


def with_kernels(modules):
    """Those of the modules that hold compiled kernels."""
    kernels = "clothsim.base.jit"
    return {module for module in modules if module in FILES and kernels in imports(module, within_functions=True)}


def home(name):
    """The module of an effect's builder."""
    return EFFECTS[name].load().__module__


BUILT = {"membrane": "clothsim.physics.energies.neo_hookean_membrane"}
"""Energies of the default keys that a builder imports once it knows that it is not off."""


def run_roots():
    """The modules that each run imports: `simulate` imports them within itself, and others where a scene asks."""
    begun = imports("clothsim.run.simulate", within_functions=True)
    asked = {module for module in begun if module.startswith("clothsim.study.error_control")}
    return {"clothsim", "clothsim.run.simulate", *begun - asked}


def needed(*names):
    """The modules of effects that a scene with these effects imports (a membrane of the default material)."""
    built = [BUILT[name] for name in names if name in BUILT]
    return of_effects(reached(*run_roots(), *map(home, names), *built, within_functions=False))


def own(name):
    """The modules of effects that serve this one alone."""
    others = [home(other) for other in EFFECTS if other != name]
    mine, theirs = (of_effects(reached(*roots, within_functions=True)) for roots in ([home(name)], others))
    return mine - theirs - needed()
