"""Every number that a module of the host names says what it was measured by, where it stands, or that it was chosen.

It says so in a docstring below, in a comment on its line, or in one above its block, which an empty line ends.
"""

import ast
from collections.abc import Iterator
from itertools import pairwise

import pytest

from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.style
HOST = CHECKOUT / "host/gellight"
PARTS = (
    ast.Constant | ast.Name | ast.Attribute | ast.Load | ast.Tuple | ast.List | ast.Set
    | ast.UnaryOp | ast.BinOp | ast.operator | ast.unaryop
)  # fmt: skip
"""of what is numeric: no types, no calls, no tables by name"""


def is_numeric(node: ast.stmt) -> bool:
    """Say whether a statement names a number, or several."""
    value = node.value if isinstance(node, ast.Assign | ast.AnnAssign) else None
    parts = list(ast.walk(value)) if value else []
    kinds = {type(part.value) for part in parts if isinstance(part, ast.Constant)}
    return all(isinstance(part, PARTS) for part in parts) and bool(kinds) and kinds <= {int, float}


def unexplained(source: str) -> Iterator[str]:
    """Yield the numeric constants of a module without a word."""
    lines, explained, before = ["", *source.splitlines()], False, 0
    for node, below in pairwise([*ast.parse(source).body, ast.Pass()]):
        if not is_numeric(node):
            explained = False
            continue
        end = node.end_lineno or node.lineno
        goes_on = explained and before == node.lineno - 1
        explained = goes_on or lines[node.lineno - 1].startswith("#")
        docstring = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
        if not (explained or docstring or "  # " in "\n".join(lines[node.lineno : end + 1])):
            yield ast.unparse(node)
        before = end


def test_every_number_of_the_host_has_a_word() -> None:
    sources = {path.relative_to(HOST): path.read_text() for path in sorted(HOST.rglob("*.py"))}
    assert sum(is_numeric(node) for source in sources.values() for node in ast.parse(source).body) > 500
    assert [(str(path), name) for path, source in sources.items() for name in unexplained(source)] == []


def test_a_number_without_a_word_is_noticed() -> None:
    explained = '# of a header\nA = 1\nB, C = 2, A << 3\nD = -4.0  # measured\n\nE = 5\n"""chosen"""\nF = f(6)\n'
    assert list(unexplained(explained)) == []
    bare = '# of a header\nA = 1\n\nB = 2\nC = 3  # this one alone\nD: float = 4\n"""of D"""\nE = (5, 6)\n'
    assert list(unexplained(bare)) == ["B = 2", "E = (5, 6)"]
