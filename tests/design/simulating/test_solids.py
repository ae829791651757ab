"""STL files as objects: heights of known bodies, and files that are refused."""

import numpy as np
import pytest

from gellight_design.simulating.solids import RECORD, height_map, read_stl
from sim_reference.deformation import NO_OBJECT, grid

SIZE, SPACING = 65, 0.125
AT = grid(SIZE, SPACING)


def pyramid(side: float, height: float) -> np.ndarray:
    """A square pyramid about (10, 20), its tip up at z = 3."""
    half, tip = side / 2, np.array([10.0, 20.0, 3.0])
    base = [tip + np.array([x, y, -height]) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    sides = [[base[i], base[(i + 1) % 4], tip] for i in range(4)]
    return np.array([*sides, [base[0], base[2], base[1]], [base[0], base[3], base[2]]])


def binary(triangles: np.ndarray) -> bytes:
    records = np.zeros(len(triangles), RECORD)
    records["corners"] = triangles
    return b"solid in name only".ljust(80) + np.uint32(len(triangles)).tobytes() + records.tobytes()


def text(triangles: np.ndarray) -> bytes:
    facets = [
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {} {} {}\n".format(*p) for p in t) + "endloop\nendfacet\n"
        for t in triangles
    ]
    return f"solid x\n{''.join(facets)}endsolid x\n".encode()


@pytest.mark.parametrize("written", [binary, text])
def test_a_pyramid_has_its_heights(written) -> None:
    height = height_map(read_stl(written(pyramid(6.0, 2.0))), SIZE, SPACING)
    x, y = np.meshgrid(AT, AT)
    out = np.maximum(np.abs(x), np.abs(y))
    expected = np.where(out <= 3.0, -2.0 * out / 3.0, NO_OBJECT)
    np.testing.assert_allclose(height, expected, rtol=0, atol=1e-5)


def test_y_is_up_in_the_file_and_down_in_the_map() -> None:
    triangles = pyramid(6.0, 2.0)
    tip = triangles[0, 2].copy()
    triangles[(triangles == tip).all(axis=2)] += [0.0, 1.0, 0.0]
    height = height_map(read_stl(binary(triangles)), SIZE, SPACING)
    row, _ = np.unravel_index(height.argmax(), height.shape)
    assert AT[row] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (binary(pyramid(6.0, 2.0)[1:]), r"not closed: 3 edges.*\("),
        *((binary(pyramid(side, side / 3)), "scale it to mm") for side in (0.006, 6000.0)),
        (binary(pyramid(6.0, 0.0)), "it is flat: all of it is at z = 3"),
        (b"", "no triangles"),
        (b"GIF89a", "no triangles"),
        (binary(pyramid(6.0, 2.0)[:0]), "no triangles"),
        (b"solid x\nvertex 1 2\nendsolid", "1 corners"),
        (text(pyramid(6.0, 2.0))[:-60], "17 corners.* cut off"),
        (text(pyramid(6.0, 2.0)).replace(b"10.0", b"ten"), "no three numbers"),
        (b"x" * 200, "200 bytes"),
        (binary(pyramid(6.0, 2.0))[:-30], "354 bytes, .* 384: it is cut off"),
    ],
)
def test_what_is_no_whole_body_in_mm_is_refused(content: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        read_stl(content)


@pytest.mark.parametrize("written", [binary, text])
def test_a_corner_that_is_nowhere_is_refused_with_its_place(written) -> None:
    triangles = pyramid(6.0, 2.0)
    triangles[4, 1, 2] = np.nan
    with pytest.raises(ValueError, match=r"corner 2 of triangle 5 is at \(13, 23, nan\)"):
        read_stl(written(triangles))
