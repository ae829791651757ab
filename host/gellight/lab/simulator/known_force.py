"""The force that presses the simulated gel: its constants are known, and no load cell is needed.

How well a frame tells it was judged on the presses of tests/data/fem, whose force finite elements know: the share below
covers what the depth that is felt in pictures with noise leaves of them (docs/force.md).
"""

from datetime import UTC, datetime

from gellight.lab.simulator.printed_dots import dots_height_mm
from gellight.reconstruction.force_file import ForceRecord, force_file
from sim_reference.fem.gel import FemGel
from sim_reference.geometry import SensorGeometry

ERROR_SHARE = 0.05
SIDE_ERROR_SHARE = 0.05
"""of forces along the gel, which the layer gives as it finds them"""
ERROR_FLOOR_N = 0.005
"""a gel at rest weighs 0; what presses it less than the threshold of a contact is not felt"""
JUDGED_N = (0.151, 11.757)
"""lightest and heaviest of those presses"""
JUDGED = 13
"""presses"""


def known_force(geometry: SensorGeometry) -> dict[str, bytes]:
    """Return `force.json`, by its name, for a bundle of the simulated sensor."""
    record = ForceRecord(
        gel_thickness_mm=geometry.gel_thickness_mm,
        poisson_ratio=geometry.poisson_ratio,
        youngs_modulus_mpa=FemGel.youngs_modulus_mpa,
        error_share=ERROR_SHARE,
        error_floor_n=ERROR_FLOOR_N,
        lightest_n=JUDGED_N[0],
        heaviest_n=JUDGED_N[1],
        side_error_share=SIDE_ERROR_SHARE,
        camera_height_mm=dots_height_mm(geometry),
        readings=JUDGED,
        source="the simulated gel",
        created=datetime.now(UTC).replace(microsecond=0),
    )
    return force_file(record)
