"""Charts and pictures of the reports: what they show is where the numbers say, and nothing is drawn of what is not."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from gellight_design.charts import Axes, Series, heat_colour, heat_map, line_chart

AXES = Axes(title="<title>", x="x", y="y")
SVG = "{http://www.w3.org/2000/svg}"


def curves(chart: str) -> list[str]:
    """Return the paths of the curves, legend apart."""
    paths = ElementTree.fromstring(chart).iter(f"{SVG}path")
    return [path.attrib["d"] for path in paths if path.attrib.get("fill") == "none"]


def texts(chart: str, kind: str) -> list[str]:
    return [text.text or "" for text in ElementTree.fromstring(chart).iter(f"{SVG}text") if text.get("class") == kind]


def points(curve: str) -> np.ndarray:
    return np.array([[float(value) for value in point.split()] for point in re.split("[ML]", curve)[1:]])


def test_a_curve_lies_where_its_ticks_say() -> None:
    chart = line_chart([Series("a", [0, 2, 4], [0.0, 50.0, 100.0])], AXES)
    assert texts(chart, "tick")[:6] == ["0", "20", "40", "60", "80", "100"]
    (curve,) = curves(chart)
    assert points(curve).tolist() == [[50, 222], [205, 124], [360, 26]]


def test_a_logarithmic_axis_has_equal_steps_for_equal_factors() -> None:
    chart = line_chart([Series("", [0, 1, 2], [0.1, 1.0, 10.0])], Axes(title="t", x="x", y="y", log=True))
    assert texts(chart, "tick")[:5] == ["0.1", "0.3", "1", "3", "10"]
    y = points(curves(chart)[0])[:, 1]
    assert y[0] - y[1] == pytest.approx(y[1] - y[2])


@pytest.mark.parametrize(("log", "gap"), [(False, float("nan")), (True, float("nan")), (True, 0.0), (True, -1.0)])
def test_a_curve_is_interrupted_where_it_has_no_value(log: bool, gap: float) -> None:
    axes = Axes(title="t", x="x", y="y", log=log)
    (curve,) = curves(line_chart([Series("a", [0, 1, 2, 3], [1.0, gap, 3.0, 2.0])], axes))
    assert [part.count("L") + 1 for part in curve.split("M")[1:]] == [1, 2]


def test_a_curve_without_any_value_leaves_an_empty_chart() -> None:
    nothing = [float("nan")] * 2
    assert curves(line_chart([Series("a", [0, 1], nothing)], AXES)) == [""]
    assert curves(line_chart([], AXES)) == []


def test_reference_lines_stand_at_their_values() -> None:
    axes = Axes(title="t", x="x", y="y", levels=((50, "half"),))
    chart = line_chart([Series("", [0, 2], [0, 100])], axes)
    marks = [
        path.attrib["d"] for path in ElementTree.fromstring(chart).iter(f"{SVG}path") if path.get("class") == "mark"
    ]
    assert marks == ["M50.0 124.0H360.0"]
    assert {"half"} <= set(texts(chart, "tick"))


def test_a_legend_that_is_too_long_takes_another_row() -> None:
    def height(label: str) -> float:
        return float(ElementTree.fromstring(line_chart([Series(label, [0], [1])] * 2, AXES)).attrib["height"])

    assert height("a" * 40) - height("a") == 16
    assert height("a") - height("") == 16


def boxes(chart: str) -> np.ndarray:
    """Left, top, right and bottom of each upright text, a letter 0.55 as wide as high; the last row: of the chart."""
    found = []
    for text in ElementTree.fromstring(chart).iter(f"{SVG}text"):
        if "transform" in text.attrib:
            continue
        kind, x, y = text.attrib["class"], float(text.attrib["x"]), float(text.attrib["y"])
        high = {"title": 12, "tick": 9.5, "axis": 10.5, "cell": 9}[kind]
        wide = 0.55 * high * len(text.text or "")
        anchor = text.get("text-anchor", "middle" if kind == "cell" else "start")
        x -= {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * wide
        found.append((x, y - 0.75 * high, x + wide, y))
    return np.array([*found, [float(number) for number in ElementTree.fromstring(chart).attrib["viewBox"].split()]])


def long_line_chart() -> str:
    axes = Axes(title="an error", x="incident angle, deg", y="mm", levels=((0.3, "half"),),
                legend="lights")  # fmt: skip
    return line_chart([Series(name, [0, 2, 4], [0.1, 0.3, 1e-3]) for name in ("three", "six of them", "c" * 40)], axes)


def long_heat_map() -> str:
    axes = Axes(title="error by mounting height and incident angle", x="angle, deg", y="mm")
    return heat_map([[12.5, 0.4], [3.0, 40.0]], ["6.5 mm", "6"], ["5", "a long column"], axes, largest=30)


@pytest.mark.parametrize("chart", [long_line_chart(), long_heat_map()], ids=["line", "heat"])
def test_no_text_is_cut_or_covers_another(chart: str) -> None:
    *texts, whole = boxes(chart)
    for number, one in enumerate(texts):
        assert (one[:2] >= whole[:2]).all()
        assert (one[2:] <= whole[2:]).all()
        for other in texts[number + 1 :]:
            assert (np.maximum(one[:2], other[:2]) >= np.minimum(one[2:], other[2:])).any(), (one, other)


def test_each_curve_has_its_colour_in_the_legend() -> None:
    one, other = Series("a", [0, 1], [0, 1]), Series("b", [0, 1], [1, 0])
    paths = [path.attrib for path in ElementTree.fromstring(line_chart([one, other], AXES)).iter(f"{SVG}path")]
    drawn = [path for path in paths if "stroke" in path]
    assert [path["stroke"] for path in drawn] == ["#3b6fd4", "#d6453d"] * 2


def test_titles_and_labels_cannot_break_the_page() -> None:
    chart = line_chart([Series("a & b", [0, 1], [0, 1])], AXES)
    assert texts(chart, "title") == ["<title>"]
    assert "a & b" in texts(chart, "axis")
    assert ElementTree.fromstring(chart).attrib["aria-label"] == "<title>"


def test_a_heat_map_shows_each_value_and_frames_the_smallest_of_each_row() -> None:
    table = [[1.0, 40.0], [9.996, 2.0]]
    chart = heat_map(table, ["3", "6"], ["5", "13"], AXES, largest=30)
    assert texts(chart, "cell") == ["1.00", "40.0", "10.0", "2.00"]
    cells = list(ElementTree.fromstring(chart).iter(f"{SVG}rect"))
    assert ["stroke" in cell.attrib for cell in cells] == [True, False, False, True]
    assert cells[1].attrib["fill"] == heat_colour(2) == "#a50f26"


def test_colours_go_from_blue_to_red() -> None:
    assert [heat_colour(share) for share in (-1, 0, 0.1, 1)] == ["#3160b4", "#3160b4", "#5286c2", "#a50f26"]
