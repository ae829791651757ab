"""The elastic layer, which the studies use, against the gel by finite elements, on every object of the benchmark."""

from dataclasses import asdict, dataclass
from html import escape
from math import isnan
from typing import Any

import numpy as np

from gellight.base.errors import InputError
from gellight.lab.design.studies import StudySetup
from gellight.lab.report.html import box, section, table
from gellight.lab.simulator.gel_models import gel_model
from gellight.lab.simulator.sweep import Study, Task
from sim_reference import gel
from sim_reference.deformation import Deformation, NotConverged
from sim_reference.fem.gel import FemGel
from sim_reference.imaging import normals
from sim_reference.metrics import angular_error
from sim_reference.optimizer.benchmark import deformed, region
from sim_reference.surface import sample

COARSE_MM = 0.6
"""between vertices, where the studies themselves do without finite elements: ten objects in some ten minutes"""


@dataclass(frozen=True, kw_only=True)
class GelRow:
    """How far the layer is from finite elements under one object: means over the region, and where it touches."""

    object_name: str
    resolution_mm: float
    not_found: str = ""
    """why finite elements gave no answer; the figures are NaN then"""
    fem_force_n: float = float("nan")
    layer_force_n: float = float("nan")
    height_um: float = float("nan")
    height_in_contact_um: float = float("nan")
    normals_deg: float = float("nan")
    normals_in_contact_deg: float = float("nan")


def resolution_of(setup: StudySetup) -> float:
    """Return the resolution of the table in mm: that of the studies if they use finite elements, else a coarse one."""
    return setup.resolution_mm if setup.gel == "fem" else COARSE_MM


def gel_study(setup: StudySetup) -> Study[list[GelRow]]:
    """Return the study of the layer against finite elements: one task an object."""
    return Study(
        [Task(f"{name} (gel)", compare_gels, (name, setup)) for name in setup.names],
        lambda found: [GelRow(**one) for one in found],
    )


def compare_gels(name: str, setup: StudySetup) -> dict[str, Any]:
    """Return the fields of `GelRow` for one object, for JSON."""
    resolution = resolution_of(setup)
    try:
        fem = _pressed(name, setup, resolution)
    except InputError as error:
        if not isinstance(error.__cause__, NotConverged):
            raise
        return gel_json(GelRow(object_name=name, resolution_mm=resolution, not_found=str(error.__cause__)))
    layer = _pressed(name, setup, None)
    here, there = (sample(one, setup.sampling.on(setup.geometry), 0.0, 0.0) for one in (layer, fem))
    inside, _, _ = region(setup.sampling, setup.geometry)
    contact = inside & here.contact
    height_um = np.abs(here.depth_mm - there.depth_mm) * 1e3
    angle_deg = np.degrees(angular_error(normals(here.gradient_map), normals(there.gradient_map)))
    layer_force_n, fem_force_n = (_force_n(one, setup) for one in (layer, fem))
    row = GelRow(
        object_name=name,
        resolution_mm=resolution,
        fem_force_n=fem_force_n,
        layer_force_n=layer_force_n,
        height_um=float(height_um[inside].mean()),
        height_in_contact_um=float(height_um[contact].mean()),
        normals_deg=float(angle_deg[inside].mean()),
        normals_in_contact_deg=float(angle_deg[contact].mean()),
    )
    return gel_json(row)


def gel_json(row: GelRow) -> dict[str, Any]:
    """Return a row of the table, without the figures that are not there."""
    return {name: value for name, value in asdict(row).items() if not (isinstance(value, float) and isnan(value))}


def _pressed(name: str, setup: StudySetup, resolution_mm: float | None) -> Deformation:
    """Press into finite elements of this resolution, or (None) into the layer."""
    model = gel.press if resolution_mm is None else gel_model("fem", resolution_mm)
    return deformed(name, setup.sampling, setup.geometry, setup.parameters, model)


def _force_n(pressed: Deformation, setup: StudySetup) -> float:
    modulus = FemGel().shear_modulus_mpa(setup.geometry)
    return float(pressed.pressure.sum()) * pressed.spacing_mm**2 * modulus


def gel_section(rows: list[GelRow], setup: StudySetup) -> str:
    """Return the section of the report."""
    head = ["object", "force", "layer's over it", "height: region", "in contact", "normals: region", "in contact"]
    return section(
        "The gel: elastic layer against finite elements",
        f"<p>Each object {setup.sampling.press_depth_mm:g} mm deep in the layer, and in Neo-Hookean finite elements "
        f"with {rows[0].resolution_mm:g} mm between vertices (Young's modulus 0.2 MPa, Poisson's ratio "
        f"{setup.geometry.poisson_ratio:g}, no friction). The differences are means over the evaluated disc of "
        f"{setup.sampling.region_diameter_mm:g} mm, and over what touches in the layer. The studies on this page use "
        f"{'finite elements' if setup.gel == 'fem' else 'the layer'}.</p>",
        box("wide", table(head, [_cells(row) for row in rows])),
    )


def _cells(row: GelRow) -> list[str]:
    if row.not_found:
        return [row.object_name, escape(f"not found: {row.not_found}"), *[""] * 5]
    return [
        row.object_name,
        f"{row.fem_force_n:.2f} N",
        f"{row.layer_force_n / row.fem_force_n:.2f}",
        f"{row.height_um:.1f} µm",
        f"{row.height_in_contact_um:.1f} µm",
        f"{row.normals_deg:.2f}°",
        f"{row.normals_in_contact_deg:.2f}°",
    ]
