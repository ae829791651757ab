"""Within which errors a press has to be measured: what was measured on objects and depths, and a margin.

The bounds notice a change for the worse; they are no promise of accuracy. Beyond them nothing is known, so nothing
is judged. `python -m tests.benchmarks.selfcheck_bounds` measures the table: the shipped bundle, the simulated sensor of
the paper, the worst of three places.
"""

from types import MappingProxyType

from gellight.frames.frames import GroundTruth
from sim_reference.geometry import AS_BUILT, SensorGeometry

KINDS = ("depth_error_mm", "normal_error_deg", "integral_error_mm", "picture_error_grey")
"""columns of `ERRORS`; nothing is taken off the depth"""
SMALLEST = MappingProxyType(dict(zip(KINDS, (0.020, 0.28, 0.005, 2.0), strict=True)))
"""No bound is narrower. The paper reports 0.02 mm and 0.28 degrees for its ball (section 3.2.5), and noise moves the
level of a plate by 0.012 mm from picture to picture."""
MARGIN = 1.3
PLACES_MM = (10.0, 6.0)
"""how far from the middle of the view in x and y it was measured"""
DEPTHS_MM = 0.8, 2.0
"""up to which it was pressed"""
ERRORS = MappingProxyType(
    {
        "BALL": ((0.0031, 0.1703, 0.0001, 0.2039), (0.0048, 0.2075, 0.0004, 0.2057)),
        "TSTEP": ((0.0124, 0.3068, 0.0012, 0.235), (0.2496, 1.4843, 0.0132, 0.9212)),
        "SCROWN": ((0.0043, 0.17, 0.0001, 0.2052), (0.2434, 1.0349, 0.0066, 0.8077)),
        "BALLVEX": ((0.0039, 0.3081, 0.0013, 0.213), (0.056, 1.0812, 0.0075, 0.7935)),
        "BALLCAVE": ((0.0152, 0.6323, 0.0039, 0.459), (0.4368, 2.988, 0.0184, 1.9509)),
        "WAVE": ((0.0134, 0.6234, 0.0055, 0.5357), (0.3863, 2.2645, 0.0163, 1.986)),
        "SINWAVE": ((0.0092, 0.5696, 0.0067, 0.4458), (0.2464, 1.7485, 0.0126, 1.4822)),
        "BSWAVE": ((0.0073, 0.442, 0.0033, 0.3109), (0.0578, 0.7323, 0.0089, 0.8102)),
        "PCONVEX": ((0.0092, 0.6293, 0.0049, 0.4605), (0.116, 4.3732, 0.0109, 2.2405)),
        "CCONVEX": ((0.0082, 0.3599, 0.0018, 0.2479), (0.0664, 1.5446, 0.0083, 1.0429)),
        "QUCAVE": ((0.0124, 0.6868, 0.0045, 0.5074), (0.396, 4.0918, 0.0126, 2.4611)),
    }
)
"""worst errors by object, up to each of these depths"""


def bounds_of(truth: GroundTruth, geometry: SensorGeometry) -> tuple[dict[str, float], str]:
    """Return the largest errors allowed of a press, by kind, and ""; or none, and why the press is not judged."""
    if not truth.object_name and not truth.contact.any():
        return dict(SMALLEST), ""
    why = _unknown(truth, geometry)
    if why:
        return {}, why
    shallow, deep = ERRORS[truth.object_name]
    worst = shallow if truth.press_depth_mm <= DEPTHS_MM[0] else deep
    return {kind: max(SMALLEST[kind], MARGIN * error) for kind, error in zip(KINDS, worst, strict=True)}, ""


def _unknown(truth: GroundTruth, geometry: SensorGeometry) -> str:
    """Return why there are no bounds; empty where there are."""
    if geometry != AS_BUILT:
        return "not judged: bounds were measured for the default sensor only"
    if truth.object_name not in ERRORS:
        return f"not judged: no bounds were measured for {truth.object_name or 'this object'}"
    if truth.press_depth_mm > DEPTHS_MM[-1]:
        return f"not judged beyond {DEPTHS_MM[-1]:g} mm"
    if any(abs(place) > most for place, most in zip(truth.place_mm, PLACES_MM, strict=True)):
        return f"not judged beyond {PLACES_MM[0]:g} x {PLACES_MM[1]:g} mm from the middle"
    return ""
