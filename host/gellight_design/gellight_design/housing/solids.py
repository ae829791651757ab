"""Solids by the Open CASCADE kernel (package cadquery-ocp-novtk, `gellight_design[housing]`): made, cut, written.

The kernel is imported in the functions: it takes half a second, and only who makes a housing needs it. A solid is its
`TopoDS_Shape`.
"""

import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from gellight.base.errors import needed
from gellight_design.parts import Point

Solid = Any
Place = tuple[float, float, float]
FINE_MM, FINE_RAD = 0.02, 0.1
"""how far a triangle of an STL may lie off the solid, and how far the next may turn"""


def check_kernel() -> None:
    """Raise InputError where the kernel is not installed: before the work."""
    with needed('making solids needs a package: pip install "gellight_design[housing]"'):
        import OCP.gp  # noqa: F401


def turned_solid(profile: Sequence[Point]) -> Solid:
    """Return the solid of revolution of a profile of points (r, z)."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeRevol
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt

    outline = BRepBuilderAPI_MakePolygon()
    for r, z in profile:
        outline.Add(gp_Pnt(r, 0.0, z))
    outline.Close()
    face = BRepBuilderAPI_MakeFace(outline.Wire()).Face()
    return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape()


def cylinder(start: Place, along: Place, radius: float, length: float) -> Solid:
    """Return a cylinder that begins at a place."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*start), gp_Dir(*along)), radius, length).Shape()


def box(middle: Place, size: Place, across: Place = (1, 0, 0), up: Place = (0, 0, 1)) -> Solid:
    """Return a box around a place: size along `across`, along what is square to both, and along `up`."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Vec

    axes = gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(*up), gp_Dir(*across))
    corner = gp_Vec(*middle)
    for axis, length in zip((axes.XDirection(), axes.YDirection(), axes.Direction()), size, strict=True):
        corner = corner - gp_Vec(axis) * (length / 2)
    place = gp_Pnt(corner.X(), corner.Y(), corner.Z())
    return BRepPrimAPI_MakeBox(gp_Ax2(place, axes.Direction(), axes.XDirection()), *size).Shape()


def joined(first: Solid, *others: Solid) -> Solid:
    """Return solids as one."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse

    for other in others:
        first = BRepAlgoAPI_Fuse(first, other).Shape()
    return first


def cut(first: Solid, *tools: Solid) -> Solid:
    """Return a solid without what the tools take."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut

    for tool in tools:
        first = BRepAlgoAPI_Cut(first, tool).Shape()
    return first


def moved(solid: Solid, up: float, turn_rad: float = 0.0) -> Solid:
    """Return a solid turned about x, then moved along z."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec

    turn, lift = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(1, 0, 0)), turn_rad)
    lift.SetTranslation(gp_Vec(0, 0, up))
    return BRepBuilderAPI_Transform(solid, lift.Multiplied(turn), True).Shape()


def step_bytes(solids: Iterable[Solid]) -> bytes:
    """Return solids as one STEP file (ISO 10303-21), mm."""
    from OCP.Message import Message, Message_Gravity
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    writer = STEPControl_Writer()
    for solid in solids:
        writer.Transfer(solid, STEPControl_AsIs)
    return _written("part.step", lambda path: writer.Write(path))


def stl_bytes(solid: Solid) -> bytes:
    """Return a solid as binary STL."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.StlAPI import StlAPI_Writer

    BRepMesh_IncrementalMesh(solid, FINE_MM, False, FINE_RAD, True)
    writer = StlAPI_Writer()
    writer.ASCIIMode = False
    return _written("part.stl", lambda path: writer.Write(solid, path))


def _written(name: str, write: Any) -> bytes:
    """Return what the kernel, which only writes files, writes into one."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(str(path))
        return path.read_bytes()
