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
        ("BALL", 0.4): (0.0046, 0.0711, 0, 0.2021),
        ("BALL", 0.8): (0.0065, 0.0774, 0.0001, 0.2021),
        ("BALL", 1.2): (0.008, 0.0854, 0.0003, 0.2037),
        ("BALL", 1.6): (0.0152, 0.1154, 0.0009, 0.2264),
        ("BALL", 2): (0.0411, 0.1877, 0.0019, 0.2767),
        ("TSTEP", 0.4): (0.004, 0.1364, 0.001, 0.2179),
        ("TSTEP", 0.8): (0.0548, 0.4095, 0.0031, 0.4324),
        ("TSTEP", 1.2): (0.0643, 1.261, 0.0055, 0.884),
        ("TSTEP", 1.6): (0.1163, 2.5262, 0.0063, 1.8663),
        ("TSTEP", 2): (0.0883, 3.8491, 0.0065, 2.6714),
        ("SCROWN", 0.4): (0.0057, 0.07, 0, 0.2024),
        ("SCROWN", 0.8): (0.0081, 0.074, 0.0001, 0.2033),
        ("SCROWN", 1.2): (0.0253, 0.1465, 0.0008, 0.2364),
        ("SCROWN", 1.6): (0.0804, 0.8607, 0.007, 0.9129),
        ("SCROWN", 2): (0.0733, 1.9844, 0.0067, 1.592),
        ("BALLVEX", 0.4): (0.0062, 0.1298, 0.0006, 0.2118),
        ("BALLVEX", 0.8): (0.0218, 0.2911, 0.003, 0.295),
        ("BALLVEX", 1.2): (0.0565, 1.0281, 0.0045, 0.7831),
        ("BALLVEX", 1.6): (0.1379, 2.2344, 0.0038, 1.8007),
        ("BALLVEX", 2): (0.0844, 3.5612, 0.0056, 2.5391),
        ("BALLCAVE", 0.4): (0.0356, 0.4444, 0.0057, 0.4928),
        ("BALLCAVE", 0.8): (0.0954, 1.8868, 0.0053, 1.6608),
        ("BALLCAVE", 1.2): (0.0954, 3.3562, 0.0051, 2.6223),
        ("BALLCAVE", 1.6): (0.4272, 4.4882, 0.0042, 3.9732),
        ("BALLCAVE", 2): (0.8039, 5.5514, 0.0038, 5.4429),
        ("WAVE", 0.4): (0.0118, 0.4262, 0.0048, 0.5351),
        ("WAVE", 0.8): (0.1965, 2.4057, 0.0059, 2.2533),
        ("WAVE", 1.2): (0.35, 5.4916, 0.0066, 4.4563),
        ("WAVE", 1.6): (0.2551, 7.3816, 0.006, 5.3189),
        ("WAVE", 2): (0.3172, 8.8321, 0.0058, 5.7611),
        ("SINWAVE", 0.4): (0.0197, 0.3486, 0.0044, 0.4419),
        ("SINWAVE", 0.8): (0.1607, 1.6583, 0.0074, 1.6979),
        ("SINWAVE", 1.2): (0.3269, 4.1215, 0.0091, 3.5167),
        ("SINWAVE", 1.6): (0.3032, 5.704, 0.0076, 4.424),
        ("SINWAVE", 2): (0.2846, 7.1129, 0.0075, 4.8108),
        ("BSWAVE", 0.4): (0.007, 0.1489, 0.001, 0.2385),
        ("BSWAVE", 0.8): (0.0576, 0.4422, 0.0067, 0.522),
        ("BSWAVE", 1.2): (0.1969, 1.3401, 0.0084, 1.3673),
        ("BSWAVE", 1.6): (0.3481, 3.4462, 0.0079, 3.1844),
        ("BSWAVE", 2): (0.4101, 5.4316, 0.0083, 4.3999),
        ("PCONVEX", 0.4): (0.0193, 0.3474, 0.003, 0.3794),
        ("PCONVEX", 0.8): (0.1375, 2.0925, 0.0053, 1.6245),
        ("PCONVEX", 1.2): (0.2115, 5.8819, 0.0072, 3.6509),
        ("PCONVEX", 1.6): (0.3216, 8.8411, 0.0064, 5.2586),
        ("PCONVEX", 2): (0.2609, 10.8716, 0.0081, 6.2566),
        ("CCONVEX", 0.4): (0.0087, 0.1605, 0.0009, 0.2352),
        ("CCONVEX", 0.8): (0.0321, 0.4588, 0.0036, 0.4359),
        ("CCONVEX", 1.2): (0.0762, 1.5825, 0.0054, 1.1695),
        ("CCONVEX", 1.6): (0.1672, 3.2828, 0.0054, 2.4068),
        ("CCONVEX", 2): (0.1072, 4.8881, 0.006, 3.2114),
        ("QUCAVE", 0.4): (0.0283, 0.4491, 0.0051, 0.4703),
        ("QUCAVE", 0.8): (0.1085, 2.2177, 0.0058, 1.8786),
        ("QUCAVE", 1.2): (0.1491, 4.7925, 0.006, 3.3904),
        ("QUCAVE", 1.6): (0.3359, 6.8628, 0.0049, 4.9006),
        ("QUCAVE", 2): (0.674, 8.3599, 0.0052, 6.2999),
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
