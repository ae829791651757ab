"""What a bundle must have reached on fresh presses: judged by the plain depth error wherever it is known."""

from types import SimpleNamespace

import pytest

from gellight.base.errors import BundleError
from gellight.bundle.limits import Limits


def verified(**figures: float) -> SimpleNamespace:
    return SimpleNamespace(metrics={"verification": figures}, source="my-sensor")


def test_a_bundle_within_the_limits_passes() -> None:
    Limits().check(verified(depth_mm=0.02, true_depth_mm=0.03, normal_deg=2.0))  # type: ignore[arg-type]
    Limits().check(verified(depth_mm=0.02, normal_deg=2.0))  # type: ignore[arg-type]


def test_a_true_depth_error_beyond_the_limit_is_refused_and_named_first() -> None:
    with pytest.raises(
        BundleError, match=r"\(depth 150 um; 20 um with the mean error of each press taken off; normals"
    ):
        Limits().check(verified(depth_mm=0.02, true_depth_mm=0.15, normal_deg=2.0))  # type: ignore[arg-type]


def test_where_only_the_shape_is_known_it_is_called_so() -> None:
    with pytest.raises(BundleError, match="shape of the depth 150 um with the mean error of each press taken off"):
        Limits().check(verified(depth_mm=0.15, normal_deg=2.0))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "metrics", [{}, {"verification": {}}, {"verification": None}, {"verification": {"depth_mm": 1}}]
)
def test_a_bundle_that_was_never_verified_is_refused(metrics: dict[str, object]) -> None:
    with pytest.raises(BundleError, match="was never verified on fresh presses"):
        Limits().check(SimpleNamespace(metrics=metrics, source="my-sensor"))  # type: ignore[arg-type]
