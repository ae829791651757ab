"""Faults of Python code, drawn at random: one place of one file, changed in its text."""

import ast
import random
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

COMPARISONS = {
    ast.Lt: ">=", ast.GtE: "<", ast.Gt: "<=", ast.LtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Pow: "*", ast.Mod: "*"}
NOT_CODE = ("annotation", "returns", "type_params", "decorator_list")
"""fields of a node that say types, or what else no test can miss"""


class Mutant(NamedTuple):
    """A fault: in `file`, which holds `source`, the bytes from `begin` to `end` become `new`."""

    file: Path
    source: bytes
    line: int
    begin: int
    end: int
    new: str

    def planted(self) -> str:
        return (self.source[: self.begin] + self.new.encode() + self.source[self.end :]).decode()

    def __str__(self) -> str:
        """Say what becomes what, in one line."""
        old = self.source[self.begin : self.end].decode()
        return f"{self.file}:{self.line}: {_short(old)} -> {_short(self.new)}"


def draw(rooms: dict[str, list[Path]], count: int, seed: int) -> list[Mutant]:
    """Draw that many mutants in different places, an equal share in each room; in a room every place is as likely."""
    chance = random.Random(seed)
    places = [_places(rooms[room]) for room in chance.sample(sorted(rooms), len(rooms))]
    for of_room in places:
        chance.shuffle(of_room)
    in_turn = [chance.choice(place) for turn in zip_longest(*places) for place in turn if place]
    return in_turn[:count]


def _places(files: list[Path]) -> list[list[Mutant]]:
    """Return what can be changed in these files: for each place its mutants."""
    places: dict[tuple[Path, int, int], list[Mutant]] = {}
    for mutant in (mutant for file in sorted(files) for mutant in mutants_of(file)):
        places.setdefault((mutant.file, mutant.begin, mutant.end), []).append(mutant)
    return list(places.values())


def mutants_of(file: Path) -> list[Mutant]:
    """Return every mutant of a file; none is in a docstring, a type hint, a message, a line of log, or in `strict=`."""
    source = file.read_bytes()
    starts = [0]
    for line in source.split(b"\n"):
        starts.append(starts[-1] + len(line) + 1)

    def mutant(node: ast.expr | ast.stmt, new: str) -> Mutant:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        begin, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        return Mutant(file, source, node.lineno, begin, end, new)

    return [mutant(node, new) for part in _code(ast.parse(source)) for node, new in _changes(part)]


def _code(node: ast.AST) -> Iterator[ast.expr | ast.stmt]:
    """Yield the expressions and statements that run and matter."""
    for name, value in ast.iter_fields(node):
        if name in NOT_CODE:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or _is_talk(child):
                continue
            if isinstance(child, ast.expr | ast.stmt):
                yield child
            yield from _code(child)


def _is_talk(node: ast.AST) -> bool:
    """Whether it is text for people: a docstring, an error, a line of log; or a type, an import, or a zip's check."""
    if isinstance(node, ast.Expr):
        called = node.value.func if isinstance(node.value, ast.Call) else None
        logs = isinstance(called, ast.Attribute) and ast.unparse(called.value) == "logger"
        return logs or isinstance(node.value, ast.Constant)
    if isinstance(node, ast.keyword):
        return node.arg == "strict"
    checks_types = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    return checks_types or isinstance(node, ast.Raise | ast.Import | ast.ImportFrom | ast.JoinedStr)


def _changes(node: ast.expr | ast.stmt) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    match node:
        case ast.Compare(ops=[only]) if type(only) in COMPARISONS:
            yield node, _joined(node.left, COMPARISONS[type(only)], node.comparators[0])
        case ast.BinOp() if type(node.op) in OPERATORS and not _has_text(node):
            yield node, _joined(node.left, OPERATORS[type(node.op)], node.right)
        case ast.BoolOp():
            word = " or " if isinstance(node.op, ast.And) else " and "
            yield node, f"({word.join(f'({ast.unparse(value)})' for value in node.values)})"
        case ast.Constant(value=bool()):
            yield node, str(not node.value)
        case ast.Constant(value=int(value)):
            yield from (
                (node, f"({new!r})") for new in dict.fromkeys((value + 1, 3 * value, value // 3)) if new != value
            )
        case ast.Constant(value=float(value)):
            new_values = dict.fromkeys((2 * value + 1, 3 * value, value / 3))
            yield from ((node, f"({new!r})") for new in new_values if new != value)
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node, f"({ast.unparse(node.operand)})"
        case ast.If() | ast.IfExp() if not isinstance(node.test, ast.Compare | ast.UnaryOp):
            yield node.test, f"(not ({ast.unparse(node.test)}))"
        case ast.Return(value=ast.expr()) if ast.unparse(node.value) != "None":
            yield node, "return None"
        case ast.Expr(value=ast.Call() | ast.Await()) | ast.AugAssign() | ast.Break() | ast.Continue():
            yield node, "pass"
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]):
            yield node, "pass"


def _joined(left: ast.expr, word: str, right: ast.expr) -> str:
    return f"(({ast.unparse(left)}) {word} ({ast.unparse(right)}))"


def _has_text(node: ast.AST) -> bool:
    return any(isinstance(child, ast.Constant) and isinstance(child.value, str | bytes) for child in ast.walk(node))


def _short(code: str) -> str:
    return repr(" ".join(code.split()))[1:-1][:90]
