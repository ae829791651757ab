"""A small setup of the optimizer's studies."""

from dataclasses import replace

from gellight.lab.design import studies
from sim_reference.geometry import SensorGeometry

FEW = ("TSTEP", "SCROWN", "SINWAVE", "BSWAVE")


def setup(size: int = 64, names: tuple[str, ...] = FEW) -> studies.Setup:
    """Return the studies' input for `size` x `size` pixels and the objects `names`."""
    return replace(studies.setup_of(SensorGeometry(), 0.9, 1.0, size), names=names)
