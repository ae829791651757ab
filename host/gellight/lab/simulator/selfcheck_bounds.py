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
        ("BALL", 0.4): (0.0047, 0.0723, 0.0001, 0.2022),
        ("BALL", 0.8): (0.0059, 0.0781, 0.0001, 0.2029),
        ("BALL", 1.2): (0.0054, 0.0858, 0.0002, 0.2038),
        ("BALL", 1.6): (0.0048, 0.0978, 0.0002, 0.2097),
        ("BALL", 2): (0.0086, 0.137, 0.0005, 0.2294),
        ("TSTEP", 0.4): (0.0163, 0.128, 0.0008, 0.2248),
        ("TSTEP", 0.8): (0.0297, 0.2676, 0.0021, 0.3161),
        ("TSTEP", 1.2): (0.0607, 0.991, 0.0061, 0.6621),
        ("TSTEP", 1.6): (0.0704, 2.1629, 0.0084, 1.3361),
        ("TSTEP", 2): (0.1309, 3.3248, 0.0086, 2.0401),
        ("SCROWN", 0.4): (0.0054, 0.0707, 0.0001, 0.2039),
        ("SCROWN", 0.8): (0.0073, 0.0739, 0.0001, 0.203),
        ("SCROWN", 1.2): (0.0186, 0.1354, 0.0005, 0.2205),
        ("SCROWN", 1.6): (0.0313, 0.7524, 0.0063, 0.6241),
        ("SCROWN", 2): (0.0641, 1.7536, 0.0109, 1.1463),
        ("BALLVEX", 0.4): (0.0073, 0.1289, 0.0005, 0.2148),
        ("BALLVEX", 0.8): (0.0109, 0.2388, 0.0019, 0.263),
        ("BALLVEX", 1.2): (0.0315, 0.7089, 0.0031, 0.4964),
        ("BALLVEX", 1.6): (0.0426, 1.7704, 0.0047, 1.1124),
        ("BALLVEX", 2): (0.0789, 2.9044, 0.0066, 1.7082),
        ("BALLCAVE", 0.4): (0.018, 0.361, 0.0034, 0.3807),
        ("BALLCAVE", 0.8): (0.0298, 1.6863, 0.0058, 1.169),
        ("BALLCAVE", 1.2): (0.1107, 2.8762, 0.008, 2.0029),
        ("BALLCAVE", 1.6): (0.3008, 3.6175, 0.0078, 2.8554),
        ("BALLCAVE", 2): (0.5997, 4.4464, 0.0072, 4.0043),
        ("WAVE", 0.4): (0.0088, 0.3984, 0.0039, 0.5085),
        ("WAVE", 0.8): (0.0538, 2.0428, 0.006, 1.4619),
        ("WAVE", 1.2): (0.2355, 4.3589, 0.0076, 3.6474),
        ("WAVE", 1.6): (0.3259, 5.2882, 0.0085, 3.9736),
        ("WAVE", 2): (0.5651, 6.2955, 0.0076, 4.4895),
        ("SINWAVE", 0.4): (0.0136, 0.3312, 0.004, 0.4186),
        ("SINWAVE", 0.8): (0.0403, 1.3653, 0.0072, 1.0935),
        ("SINWAVE", 1.2): (0.1049, 3.1558, 0.0085, 2.4289),
        ("SINWAVE", 1.6): (0.2335, 4.2305, 0.009, 3.0557),
        ("SINWAVE", 2): (0.287, 5.1801, 0.0084, 3.4012),
        ("BSWAVE", 0.4): (0.0095, 0.1547, 0.001, 0.2408),
        ("BSWAVE", 0.8): (0.0279, 0.3858, 0.0044, 0.42),
        ("BSWAVE", 1.2): (0.0714, 1.2395, 0.0075, 1.0609),
        ("BSWAVE", 1.6): (0.0929, 2.9631, 0.0079, 2.3062),
        ("BSWAVE", 2): (0.118, 4.0851, 0.0088, 2.9406),
        ("PCONVEX", 0.4): (0.0178, 0.3281, 0.0028, 0.3745),
        ("PCONVEX", 0.8): (0.0622, 1.4332, 0.0054, 1.1229),
        ("PCONVEX", 1.2): (0.0914, 4.2226, 0.0068, 2.5154),
        ("PCONVEX", 1.6): (0.1392, 6.8477, 0.0076, 3.7126),
        ("PCONVEX", 2): (0.2209, 8.5342, 0.0078, 4.571),
        ("CCONVEX", 0.4): (0.0154, 0.163, 0.0009, 0.2521),
        ("CCONVEX", 0.8): (0.0172, 0.353, 0.0025, 0.3605),
        ("CCONVEX", 1.2): (0.0391, 1.1572, 0.0038, 0.7498),
        ("CCONVEX", 1.6): (0.0459, 2.7051, 0.0052, 1.5923),
        ("CCONVEX", 2): (0.1132, 4.0197, 0.006, 2.2573),
        ("QUCAVE", 0.4): (0.0145, 0.3834, 0.0033, 0.3992),
        ("QUCAVE", 0.8): (0.0389, 1.8873, 0.0064, 1.3254),
        ("QUCAVE", 1.2): (0.1179, 4.314, 0.0064, 2.6478),
        ("QUCAVE", 1.6): (0.2693, 6.0188, 0.0067, 3.8008),
        ("QUCAVE", 2): (0.5389, 7.2336, 0.0071, 4.9292),
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
