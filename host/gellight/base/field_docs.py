"""What stands below the fields of a dataclass, in its `help()`: Python keeps no docstrings of fields."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from typing import TypeVar

Class = TypeVar("Class", bound=type)


def with_field_docs(cls: Class) -> Class:
    """Let the docstring of a dataclass end with its fields and what is written below them, read when it is asked for.

    Decorate the finished dataclass. Where the source is not there, the docstring stays as it is.
    """
    cls.__doc__ = _Docstring(cls.__doc__ or "")  # type: ignore[assignment]
    return cls


class _Docstring:
    """A docstring that is put together when somebody reads it: sources cost tens of milliseconds."""

    def __init__(self, said: str) -> None:
        self._said = said

    def __get__(self, instance: object, owner: type) -> str:
        """Return the docstring of the class with its fields."""
        told = "\n".join(_fields(owner))
        return f"{inspect.cleandoc(self._said)}\n\nFields:\n\n{told}" if told else self._said


def _fields(cls: type) -> Iterator[str]:
    """Yield each field, those of base classes first, with its type and what its docstring says."""
    for base in reversed(cls.__mro__[:-1]):
        try:
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(base))).body
        except (OSError, TypeError):
            continue
        assert isinstance(tree, ast.ClassDef)
        for line, below in zip(tree.body, [*tree.body[1:], None], strict=True):
            if isinstance(line, ast.AnnAssign) and not ast.unparse(line.target).startswith("_"):
                yield ast.unparse(line.target) + ": " + ast.unparse(line.annotation)
                yield from textwrap.indent(_text(below), "    ").splitlines()


def _text(line: ast.stmt | None) -> str:
    """Return what a statement says that is nothing but a string, else nothing."""
    told = line.value if isinstance(line, ast.Expr) else None
    return inspect.cleandoc(told.value) if isinstance(told, ast.Constant) and isinstance(told.value, str) else ""
