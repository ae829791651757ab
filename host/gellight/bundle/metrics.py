"""`metrics.json` of a bundle: what was measured, of which the program reads a few figures and people the rest."""

from typing import Any

from pydantic import BaseModel, FiniteFloat, ValidationError

from gellight.base.allowed import in_words
from gellight.base.errors import BundleError
from gellight.bundle.manifest import AGAIN, METRICS


class _Figures(BaseModel, extra="allow"):
    """What the program reads."""

    verification: dict[str, Any] | None = None
    """on fresh presses"""
    pattern_match: FiniteFloat | None = None
    ball_radius_mm: FiniteFloat | None = None
    learnt_on_other_units: list[str] | None = None


def read_metrics(content: bytes, source: str) -> dict[str, Any]:
    """Return the content of the file; BundleError, naming `source`, where it is no object or a figure no figure."""
    try:
        return _Figures.model_validate_json(content).model_dump(exclude_unset=True)
    except ValidationError as error:
        raise BundleError(f"{source}: {METRICS}: {in_words(error)}; {AGAIN}") from error
