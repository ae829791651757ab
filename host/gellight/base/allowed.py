"""What a pydantic model allows, in a user's words: for messages and for the reference of the settings."""

import difflib
from collections.abc import Iterable
from typing import Any, TypeVar
from urllib.parse import SplitResult, parse_qsl, urlsplit

from pydantic import BaseModel, ConfigDict, ValidationError

from gellight.base.errors import InputError

Model = TypeVar("Model", bound=BaseModel)


class StrictModel(BaseModel):
    """Strict base: no unknown key, no text for a number, no number that is not finite."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


_BOUNDS = (
    ("minimum", "at least"),
    ("exclusiveMinimum", "above"),
    ("maximum", "at most"),
    ("exclusiveMaximum", "below"),
)


def allowed(schema: dict[str, Any]) -> str:
    """Return in words what a key with this JSON schema may be."""
    if "allowed" in schema:
        return str(schema["allowed"])
    kind = next((option for option in schema.get("anyOf", []) if option.get("type") != "null"), schema)
    if kind["type"] == "boolean":
        return "true or false"
    if "enum" in kind:
        return f"text, one of {', '.join(kind['enum'])}"
    if kind["type"] == "string":
        return f"text like `{kind['pattern']}`" if "pattern" in kind else "text"
    bounds = [f"{word} {kind[name]:g}" for name, word in _BOUNDS if name in kind]
    return f"{'a whole number' if kind['type'] == 'integer' else 'a number'} {' and '.join(bounds)}".strip()


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


_LIMITS = (("ge", "at least"), ("gt", "above"), ("le", "at most"), ("lt", "below"))
_NOUNS = (
    ("finite", "a finite number"), ("int", "a whole number"), ("float", "a number"), ("bool", "true or false"),
    ("string", "text"), ("list", "a list"), ("tuple", "a list"), ("dict", "an object"), ("model", "an object"),
)  # fmt: skip
"""by how the type of pydantic's error begins: what was to be given"""
_SHOWN = 40
"""characters of a value that a message shows"""


def in_words(error: ValidationError, whole: str = "it") -> str:
    """Return what a model refuses first in content that somebody wrote: its place, its value, and what may stand there.

    whole: what the content is called.
    """
    first = error.errors(include_url=False)[0]
    return f"{'.'.join(map(str, first['loc'])) or whole} {_words(dict(first))}"


def _words(problem: dict[str, Any]) -> str:
    kind, known, value = problem["type"], problem.get("ctx", {}), repr(problem["input"])
    given = f"= {value if len(value) <= _SHOWN else value[:_SHOWN] + '...'} is not allowed: give"
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
    limits = " and ".join(f"{word} {known[name]:g}" for name, word in _LIMITS if name in known)
    lengths = (("min_length", "at least"), ("max_length", "at most"))
    entries = next(
        (f"{word} {known[name]} entr{'y' if known[name] == 1 else 'ies'}" for name, word in lengths if name in known),
        "",
    )
    pattern = f"text like `{known['pattern']}`" if "pattern" in known else ""
    noun = next((noun for begins, noun in _NOUNS if kind.startswith(begins)), "another value")
    return f"{given} {limits or known.get('expected') or pattern or entries or noun}"


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
