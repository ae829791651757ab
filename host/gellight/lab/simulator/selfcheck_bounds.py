"""Within which errors a press has to be measured: what was measured on a grid of objects and depths, and a margin.

The bounds notice a change for the worse; they are no promise of accuracy. Beyond the grid nothing is known, so nothing
is judged. `python -m tests.benchmarks.selfcheck_bounds` measures the table: the shipped bundle, the simulated sensor of
the paper, the worst of three places.
"""

from types import MappingProxyType

from gellight.frames.frames import GroundTruth
from sim_reference.geometry import SensorGeometry

KINDS = ("depth_error_mm", "normal_error_deg", "integral_error_mm", "picture_error_grey")
"""columns of `ERRORS`; nothing is taken off the depth"""
SMALLEST = MappingProxyType(dict(zip(KINDS, (0.010, 0.28, 0.005, 2.0), strict=True)))
"""No bound is narrower. The paper reports 0.02 mm and 0.28 degrees for its ball (section 3.2.5)."""
MARGIN = 1.3
PLACES_MM = (10.0, 6.0)
"""how far from the middle of the view in x and y it was measured"""
ERRORS = MappingProxyType(
    {
        ("BALL", 0.4): (0.0008, 0.0713, 0.0001, 0.2014),
        ("BALL", 0.8): (0.0021, 0.0766, 0.0001, 0.2013),
        ("BALL", 1.2): (0.0014, 0.0824, 0.0002, 0.2023),
        ("BALL", 1.6): (0.0036, 0.092, 0.0002, 0.2055),
        ("BALL", 2): (0.0046, 0.117, 0.0004, 0.2165),
        ("TSTEP", 0.4): (0.0061, 0.1261, 0.0004, 0.2152),
        ("TSTEP", 0.8): (0.0212, 0.2174, 0.0012, 0.2859),
        ("TSTEP", 1.2): (0.034, 0.5723, 0.0051, 0.4853),
        ("TSTEP", 1.6): (0.0306, 1.221, 0.0086, 0.8825),
        ("TSTEP", 2): (0.0647, 2.2057, 0.01, 1.4982),
        ("SCROWN", 0.4): (0.0009, 0.0706, 0.0001, 0.203),
        ("SCROWN", 0.8): (0.0021, 0.0734, 0.0001, 0.202),
        ("SCROWN", 1.2): (0.0061, 0.131, 0.0004, 0.2074),
        ("SCROWN", 1.6): (0.0121, 0.4168, 0.0015, 0.4073),
        ("SCROWN", 2): (0.0342, 1.185, 0.0073, 0.8309),
        ("BALLVEX", 0.4): (0.0061, 0.1218, 0.0005, 0.2072),
        ("BALLVEX", 0.8): (0.0064, 0.2021, 0.0015, 0.2336),
        ("BALLVEX", 1.2): (0.0129, 0.5149, 0.0028, 0.4027),
        ("BALLVEX", 1.6): (0.0191, 1.1016, 0.0037, 0.7553),
        ("BALLVEX", 2): (0.0359, 1.962, 0.0059, 1.2542),
        ("BALLCAVE", 0.4): (0.0022, 0.2799, 0.0019, 0.3099),
        ("BALLCAVE", 0.8): (0.0156, 1.0403, 0.0044, 0.7941),
        ("BALLCAVE", 1.2): (0.0543, 2.1143, 0.0072, 1.4654),
        ("BALLCAVE", 1.6): (0.228, 3.6998, 0.0077, 2.728),
        ("BALLCAVE", 2): (0.4889, 5.4796, 0.0072, 4.2877),
        ("WAVE", 0.4): (0.0041, 0.3139, 0.0029, 0.4516),
        ("WAVE", 0.8): (0.0299, 1.1713, 0.0051, 1.0024),
        ("WAVE", 1.2): (0.0291, 2.5299, 0.0067, 2.0503),
        ("WAVE", 1.6): (0.1382, 3.8963, 0.0079, 2.8925),
        ("WAVE", 2): (0.3876, 5.4954, 0.0068, 3.8617),
        ("SINWAVE", 0.4): (0.0044, 0.27, 0.0036, 0.3837),
        ("SINWAVE", 0.8): (0.0213, 0.842, 0.0065, 0.7874),
        ("SINWAVE", 1.2): (0.0419, 1.9215, 0.0084, 1.5572),
        ("SINWAVE", 1.6): (0.0631, 2.8119, 0.0091, 2.1379),
        ("SINWAVE", 2): (0.2326, 4.1984, 0.0086, 2.8698),
        ("BSWAVE", 0.4): (0.0038, 0.1448, 0.0009, 0.229),
        ("BSWAVE", 0.8): (0.0142, 0.2911, 0.0032, 0.3426),
        ("BSWAVE", 1.2): (0.0383, 0.7826, 0.0064, 0.6763),
        ("BSWAVE", 1.6): (0.0522, 1.489, 0.0077, 1.3063),
        ("BSWAVE", 2): (0.0498, 2.3518, 0.0088, 1.8572),
        ("PCONVEX", 0.4): (0.0046, 0.2924, 0.0025, 0.3407),
        ("PCONVEX", 0.8): (0.0359, 1.0607, 0.0047, 0.9235),
        ("PCONVEX", 1.2): (0.0592, 2.7995, 0.0076, 1.9816),
        ("PCONVEX", 1.6): (0.087, 4.7184, 0.0079, 3.0044),
        ("PCONVEX", 2): (0.1181, 6.3515, 0.0087, 3.842),
        ("CCONVEX", 0.4): (0.0104, 0.1519, 0.0009, 0.2378),
        ("CCONVEX", 0.8): (0.0076, 0.2832, 0.002, 0.3079),
        ("CCONVEX", 1.2): (0.0158, 0.8024, 0.0036, 0.586),
        ("CCONVEX", 1.6): (0.0258, 1.7201, 0.0053, 1.0787),
        ("CCONVEX", 2): (0.0416, 2.8066, 0.0064, 1.6906),
        ("QUCAVE", 0.4): (0.0032, 0.3075, 0.0023, 0.3329),
        ("QUCAVE", 0.8): (0.0209, 1.1637, 0.0048, 0.913),
        ("QUCAVE", 1.2): (0.0651, 3.0569, 0.0062, 1.8893),
        ("QUCAVE", 1.6): (0.1707, 5.3801, 0.0076, 3.3159),
        ("QUCAVE", 2): (0.4174, 7.5152, 0.0067, 4.9529),
    }
)
"""worst errors by object and press depth in mm"""
DEEPEST_MM = max(depth for _, depth in ERRORS)


def bounds_of(truth: GroundTruth, geometry: SensorGeometry) -> tuple[dict[str, float], str]:
    """Return the largest errors allowed of a press, by kind, and ""; or none, and why the press is not judged."""
    if not truth.object_name and not truth.contact.any():
        return dict(SMALLEST), ""
    why = _unknown(truth, geometry)
    if why:
        return {}, why
    name, depth_mm = truth.object_name, truth.press_depth_mm
    deeper = min(depth for known, depth in ERRORS if known == name and depth >= depth_mm)
    rows = [errors for (known, depth), errors in ERRORS.items() if known == name and depth <= deeper]
    worst = [MARGIN * max(column) for column in zip(*rows, strict=True)]
    return {kind: max(SMALLEST[kind], error) for kind, error in zip(KINDS, worst, strict=True)}, ""


def _unknown(truth: GroundTruth, geometry: SensorGeometry) -> str:
    """Return why there are no bounds; empty where there are."""
    if geometry != SensorGeometry():
        return "not judged: bounds were measured for the default sensor only"
    if not any(known == truth.object_name for known, _ in ERRORS):
        return f"not judged: no bounds were measured for {truth.object_name or 'this object'}"
    if truth.press_depth_mm > DEEPEST_MM:
        return f"not judged beyond {DEEPEST_MM:g} mm"
    if any(abs(place) > most for place, most in zip(truth.place_mm, PLACES_MM, strict=True)):
        return f"not judged beyond {PLACES_MM[0]:g} x {PLACES_MM[1]:g} mm from the middle"
    return ""
