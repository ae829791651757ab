"""What a pydantic model allows, in a user's words: for messages and for the reference of the settings."""

import difflib
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, TypeVar
from urllib.parse import SplitResult, parse_qsl, urlsplit

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from gellight.base.errors import GellightError, InputError

Model = TypeVar("Model", bound=BaseModel)
Byte = Annotated[int, Field(ge=0, le=255)]  # one colour of an LED or a pixel
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]  # neither 0 nor infinite: scales, sizes, errors
MOST_SIDE_PX = 8192  # chosen: of pictures, beyond any sensor's camera; docs/wire-format.md promises it
NAME = "[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
ALLOWED = "at most 64 letters, digits, '-', '_' and '.', the first a letter or a digit"


class StrictModel(BaseModel):
    """Strict base: no unknown key, no text for a number, no number that is not finite."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


_BOUNDS = (
    ("minimum", "at least"),
    ("exclusiveMinimum", "above"),
    ("maximum", "at most"),
    ("exclusiveMaximum", "below"),
)
_ENTRIES = (("minItems", "at least"), ("maxItems", "at most"))
_NOUNS = {
    "boolean": "true or false", "integer": "a whole number", "number": "a number", "string": "text", "array": "a list",
    "object": "an object",
}  # fmt: skip
"""by the type of a JSON schema"""


def allowed(schema: dict[str, Any]) -> str:
    """Return in words what a value with this JSON schema may be."""
    if "allowed" in schema:
        return str(schema["allowed"])
    kind = next((option for option in schema.get("anyOf", []) if option.get("type") != "null"), schema)
    if "enum" in kind:
        return f"text, one of {', '.join(kind['enum'])}"
    if "pattern" in kind:
        return f"text like `{kind['pattern']}`"
    bounds = [f"{word} {kind[name]:g}" for name, word in _BOUNDS if name in kind]
    bounds += [
        f"of {word} {kind[name]} entr{'y' if kind[name] == 1 else 'ies'}" for name, word in _ENTRIES if name in kind
    ]
    return f"{_NOUNS[kind['type']]} {' and '.join(bounds)}".strip()


def nearest(name: str, known: Iterable[str]) -> str:
    """Return what may have been meant by an unknown name, or else all there is."""
    choice = list(known)
    close = difflib.get_close_matches(name, choice, n=1)
    return f"did you mean {close[0]}?" if close else f"choose one of {', '.join(choice)}"


def refusals(error: ValidationError, model: type[BaseModel], what: str) -> str:
    """Return why a flat `model` refuses its values; `what` is what its fields are to the user, such as "parameter"."""
    fields = model.model_json_schema(by_alias=True)["properties"]
    return "; ".join(_refusal(dict(problem), fields, what) for problem in error.errors(include_url=False))


def _refusal(problem: dict[str, Any], fields: dict[str, dict[str, Any]], what: str) -> str:
    name = str(problem["loc"][0])
    if problem["type"] == "extra_forbidden":
        return f"unknown {what} {name}: {nearest(name, fields)}"
    return f"{name} = {problem['input']} is not allowed: give {allowed(fields[name])}"


_TYPES = (
    ("int", "integer"), ("float", "number"), ("bool", "boolean"), ("string", "string"), ("list", "array"),
    ("tuple", "array"), ("too_", "array"), ("dict", "object"), ("model", "object"), ("greater", "number"),
    ("less", "number"),
)  # fmt: skip
"""by how the type of pydantic's error begins: the type of a JSON schema"""
_KEYWORDS = {
    "ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum", "pattern": "pattern",
    "min_length": "minItems", "max_length": "maxItems", "expected": "allowed",
}  # fmt: skip
"""by the name of pydantic's error"""
_SHOWN = 40
"""characters of a value that a message shows"""


def in_words(error: ValidationError, whole: str = "it") -> str:
    """Return what a model refuses first in content that somebody wrote: its place, its value, and what may stand there.

    whole: what the content is called.
    """
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(map(str, first['loc'])) or whole} {_words(dict(first))}"


@contextmanager
def explained(say: Callable[[str], GellightError] = InputError, whole: str = "it") -> Iterator[None]:
    """Raise what `say` makes of the words of `in_words` for what a model refuses."""
    try:
        yield
    except ValidationError as error:
        raise say(in_words(error, whole)) from None


def _words(problem: dict[str, Any]) -> str:
    kind, known, value = problem["type"], problem.get("ctx", {}), repr(problem["input"])
    if kind in ("missing", "extra_forbidden"):
        return "is missing" if kind == "missing" else "is unknown: leave it out"
    if kind == "json_invalid":
        return f"is no JSON ({known['error']})"
    if kind.startswith("union_tag"):
        return (
            f"has the type {known['tag']!r}: give one of {known['expected_tags']}" if "tag" in known else "has no type"
        )
    if kind == "value_error":
        return f"= {value[:_SHOWN]}: {known['error']}"
    shown = value if len(value) <= _SHOWN else value[:_SHOWN] + "..."
    return f"= {shown} is not allowed: give {allowed(_schema(kind, known))}"


def _schema(kind: str, known: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON schema that one error of pydantic tells of."""
    if kind == "finite_number":
        return {"allowed": "a finite number"}
    found = next((name for begins, name in _TYPES if kind.startswith(begins)), None)
    told = {_KEYWORDS[name]: value for name, value in known.items() if name in _KEYWORDS}
    return {"type": found} | told if found else {"allowed": "another value"} | told


def split_url(url: str) -> SplitResult:
    """Return the parts of a URL; InputError for one that has none, such as half of a bracket."""
    try:
        return urlsplit(url)
    except ValueError as error:
        raise InputError(f"{url!r} is no URL ({error}): give one such as v4l2:///dev/video0 or sim://") from None


def query_of(url: str, model: type[Model]) -> Model:
    """Return the parameters of a URL as `model`; InputError names each wrong one, its value and what is allowed."""
    given = dict(parse_qsl(split_url(url).query, keep_blank_values=True))
    try:
        return model.model_validate(given)
    except ValidationError as error:
        raise InputError(f"{url}: {refusals(error, model, 'parameter')}") from None


def check_name(name: str) -> str:
    """Return `name`; InputError where no sensor can be called so."""
    if not re.fullmatch(NAME, name):
        raise InputError(f"--name {name!r} is not possible: give {ALLOWED}")
    return name
