"""Mutants of a module: numbers and operators of its formulas, each changed in one place.

A mutant is a float or a term of a sum times 0.98, an integer of a sum, product or power plus 1, an operator replaced by
its opposite, or a sign turned. Left alone is what computes no physics: defaults, indices, sizes, axes, messages, times
by a clock, zeros, numbers below 1e-4 (tolerances), constants of modules (documented defaults), functions that return
texts.
"""

import ast
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

OPPOSITES = {ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")}
BORDERS = {ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">")}
SMALLEST = 1e-4
"""Numbers below it are tolerances."""
SIZES = {"range", "len", "zeros", "empty", "ones", "full", "reshape", "arange", "repeat", "tile", "split"}
"""Functions whose arguments are counts."""


@dataclass(frozen=True)
class Mutant:
    """A change of a file's text: `old` at the offset `at` becomes `new`, in the function `inside`."""

    file: str
    inside: str
    at: int
    old: str
    new: str
    line: int
    before: str
    after: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What names it when lines above have moved."""
        return self.file, self.inside, self.before, self.after

    def applied(self, text: str) -> str:
        """The text of the file with the change."""
        assert text.startswith(self.old, self.at)
        return text[: self.at] + self.new + text[self.at + len(self.old) :]


def mutants_of(root: Path, file: str) -> list[Mutant]:
    """All mutants of a file below root, in the order of its text."""
    text = (root / file).read_text()
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for inside, line, column, old, new in _Sites(text).all():
        at, end = starts[line - 1] + column, starts[line] - 1
        before = text[starts[line - 1] : end]
        after = before[:column] + new + before[column + len(old) :]
        found.append(Mutant(file, inside, at, old, new, line, before.strip(), after.strip()))
    return sorted(found, key=lambda mutant: mutant.at)


def drawn(mutants: list[Mutant], count: int, seed: int) -> list[Mutant]:
    """`count` of them, by hashes of seed and key: what is edited elsewhere changes none of the others.

    Numbers and terms are drawn twice as often as operators, four times as often as < and <=, which rarely differ.
    """
    first: dict[float, Mutant] = {}
    for mutant in mutants:
        digest = hashlib.blake2b(repr((seed, mutant.key)).encode(), digest_size=6).digest()
        rarity = 1 if not mutant.old or mutant.old[0].isdigit() else (4 if mutant.old[0] in "<>" else 2)
        first.setdefault(rarity * int.from_bytes(digest), mutant)
    return [first[number] for number in sorted(first)][:count]


Site = tuple[str, int, int, str, str]
"""Function, line, column in characters, the text there, and what replaces it."""


class _Sites:
    """Walk over the functions of a module."""

    def __init__(self, text: str) -> None:
        self._tree = ast.parse(text)
        self._lines = text.splitlines()

    def all(self) -> Iterator[Site]:
        yield from self._within(self._tree, "")

    def _within(self, node: ast.AST, name: str) -> Iterator[Site]:
        """The functions of a module or class, and those within them."""
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef):
                yield from self._within(child, f"{name}{child.name}.")
            elif isinstance(child, ast.FunctionDef) and not _returns_text(child):
                for statement in child.body:
                    yield from self._sites(statement, f"{name}{child.name}")

    def _sites(self, node: ast.AST, name: str) -> Iterator[Site]:
        """The sites of a statement or expression, and of all that is in it."""
        if _computes_nothing(node):
            return
        if isinstance(node, ast.FunctionDef):
            for statement in node.body:
                yield from self._sites(statement, f"{name}.{node.name}")
            return
        if isinstance(node, ast.BinOp):
            yield from self._of_operation(node, name)
        elif isinstance(node, ast.AugAssign) and type(node.op) in OPPOSITES:
            old, new = OPPOSITES[type(node.op)]
            yield self._operator(name, node.target, node.value, f"{old}=", f"{new}=")
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in BORDERS:
            yield self._operator(name, node.left, node.comparators[0], *BORDERS[type(node.ops[0])])
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            yield self._at(name, node, "-", "+")
        elif isinstance(node, ast.Constant) and type(node.value) is float and SMALLEST <= node.value < float("inf"):
            yield self._at(name, node, ast.unparse(node), repr(round(0.98 * node.value, 12)))
        for child in ast.iter_child_nodes(node):
            if not (isinstance(node, ast.Subscript) and child is node.slice):
                yield from self._sites(child, name)

    def _of_operation(self, node: ast.BinOp, name: str) -> Iterator[Site]:
        """The operator, and operands that are integers or terms."""
        if type(node.op) in OPPOSITES:
            yield self._operator(name, node.left, node.right, *OPPOSITES[type(node.op)])
        for side in (node.left, node.right):
            if isinstance(side, ast.Constant) and type(side.value) is int:
                yield self._at(name, side, str(side.value), str(side.value + 1))
            elif isinstance(node.op, ast.Add | ast.Sub) and _is_term(node, side):
                yield self._at(name, side, "", "0.98 * ")

    def _at(self, name: str, node: ast.expr, old: str, new: str) -> Site:
        column = self._column(node.lineno, node.col_offset)
        if not self._lines[node.lineno - 1].startswith(old, column):  # as 1e5, which is not written as repr has it
            old = re.match(r"[\w.]+", self._lines[node.lineno - 1][column:])[0]
        return name, node.lineno, column, old, new

    def _operator(self, name: str, left: ast.expr, right: ast.expr, old: str, new: str) -> Site:
        """The operator between two operands; brackets, spaces and a new line may stand beside it."""
        line, start = left.end_lineno, self._column(left.end_lineno, left.end_col_offset)
        while (column := self._lines[line - 1].find(old, start)) < 0:
            line, start = line + 1, 0
        return name, line, column, old, new

    def _column(self, line: int, offset: int) -> int:
        return len(self._lines[line - 1].encode()[:offset].decode())


def _is_term(total: ast.BinOp, side: ast.expr) -> bool:
    """True for a term of a sum of floats: no sum itself, and no integer beside or within it, as indices have."""
    if isinstance(side, ast.Constant) or (isinstance(side, ast.BinOp) and isinstance(side.op, ast.Add | ast.Sub)):
        return False
    near = [total.left, total.right, *(getattr(side, name, None) for name in ("left", "right"))]
    return not any(isinstance(each, ast.Constant) and type(each.value) is int for each in near)


def _returns_text(function: ast.FunctionDef) -> bool:
    return function.returns is not None and "str" in ast.unparse(function.returns)


def _computes_nothing(node: ast.AST) -> bool:
    """True for errors, texts, names of axes, readings of a clock, and calls whose arguments are counts."""
    if isinstance(node, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        return called in SIZES
    if isinstance(node, ast.BinOp):
        parts = (ast.List, ast.Tuple, ast.JoinedStr, ast.ListComp)
        return any(isinstance(side, parts) or _is_text(side) for side in (node.left, node.right))
    if isinstance(node, ast.Assign | ast.AugAssign | ast.Return):
        return "perf_counter" in ast.unparse(node)
    if isinstance(node, ast.keyword):
        return node.arg in {"axis", "maxlen", "dtype", "ndmin"}
    return isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
