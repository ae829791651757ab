"""Make `layout.json` beside this file: what Foxglove shows of a sensor that runs with `stream.foxglove`.

python docs/foxglove/layout.py
"""

import json
from pathlib import Path

import foxglove.layouts as fl

DEEPEST_M = 0.001
"""of the colour scale; change it in the settings of the panels"""


def panels() -> fl.Layout:
    """Return the layout: camera, depth as colours and as a surface, indentation and force over time, the state."""
    depth = fl.ImageModeConfig(
        image_topic="/gellight/depth/image", color_mode="colormap", color_map="turbo", min_value=0, max_value=DEEPEST_M
    )
    surface = fl.BaseRendererPointCloudTopicSettings(
        visible=True, color_mode="colormap", color_map="turbo", color_field="z", min_value=0, max_value=DEEPEST_M
    )
    indentation = fl.PlotSeries(value="/gellight/contact.point.z", label="indentation, m")
    force = fl.PlotSeries(value="/gellight/contact/wrench.wrench.force.z", label="normal force, N")
    left = [
        fl.ImagePanel(
            title="Camera", config=fl.ImageConfig(image_mode=fl.ImageModeConfig(image_topic="/gellight/image_raw"))
        ),
        fl.PlotPanel(title="Indentation", config=fl.PlotConfig(paths=[indentation])),
        fl.PlotPanel(title="Force", config=fl.PlotConfig(paths=[force])),
        fl.DiagnosticsSummaryPanel(config=fl.DiagnosticsSummaryConfig(topic_to_render="/diagnostics")),
    ]
    right = [
        fl.ImagePanel(title="Depth", config=fl.ImageConfig(image_mode=depth)),
        fl.ThreeDeePanel(
            title="Gel",
            config=fl.ThreeDeeConfig(
                follow_tf="gellight_gel",
                topics={"/gellight/points": surface},
                camera_state=fl.ThreeDeeCameraState(distance=0.06, perspective=True, phi=45, near=0.001, far=1),
            ),
        ),
    ]
    columns = [
        fl.SplitContainer(direction="column", items=[fl.SplitItem(content=panel) for panel in column])
        for column in (left, right)
    ]
    return fl.Layout(
        content=fl.SplitContainer(direction="row", items=[fl.SplitItem(content=column) for column in columns])
    )


def content() -> str:
    """Return the text of the file."""
    return json.dumps(json.loads(panels().to_json()), indent=2) + "\n"


if __name__ == "__main__":
    Path(__file__).with_name("layout.json").write_text(content())
