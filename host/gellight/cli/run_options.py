"""The options of the verbs that run a sensor: apart from what runs it, which takes a second to import."""

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Annotated

import typer

from gellight.cli.ending import until_interrupted
from gellight.cli.options import name_option


@dataclass(frozen=True)
class RunOptions:
    """How a sensor runs."""

    calibration: Annotated[str | None, typer.Option(help="Calibration bundle.", show_default="that of the sensor")] = (
        None
    )
    port: Annotated[int | None, typer.Option(help="Port of the dashboard; 0: any free one.", show_default="8420")] = (
        None
    )
    host: Annotated[
        str | None,
        typer.Option(help="Address of the dashboard; 0.0.0.0: for others too, with a token.", show_default="127.0.0.1"),
    ] = None
    tls_cert: Annotated[
        str | None, typer.Option(help="Certificate (PEM): the dashboard is encrypted by it.", show_default="none")
    ] = None
    tls_key: Annotated[str | None, typer.Option(help="Private key of --tls-cert (PEM).", show_default="none")] = None
    mode: Annotated[
        str | None, typer.Option(help="How slopes are found: network or photometric.", show_default="network")
    ] = None
    sequence: Annotated[
        str | None, typer.Option(help="Light groups shown in turn: rgb, single or a JSON file.", show_default="none")
    ] = None
    light_mode: Annotated[
        str | None, typer.Option(help="What moves the light on: hold, free or ext.", show_default="hold")
    ] = None
    publish: Annotated[bool | None, typer.Option(help="Publish frames to other programs.", show_default="publish")] = (
        None
    )
    name: Annotated[str | None, name_option("Name to publish under.", "that of the sensor")] = None
    lan: Annotated[bool | None, typer.Option("--lan", help="Publish to other computers too.")] = None
    zenoh_config: Annotated[str | None, typer.Option(help="Zenoh's own settings, for TLS and access control.")] = None
    ros2: Annotated[str | None, typer.Option(help="Publish ROS 2 topics by this router of rmw_zenoh.")] = None
    foxglove: Annotated[bool | None, typer.Option("--foxglove", help="Serve a live view for Foxglove.")] = None
    sinks: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="Send frames to these sinks of other distributions.")
    ] = None
    realtime: Annotated[
        bool | None, typer.Option("--realtime", help="Let camera and reconstruction run before all other programs.")
    ] = None
    log: Annotated[str | None, typer.Option(help="Form of the log: text or json.", show_default="text")] = None
    frames: Annotated[int, typer.Option(help="Stop after this number of frames; 0: run until Ctrl-C.", min=0)] = 0

    def flags(self) -> dict[str, object]:
        """Return the settings that were given as options.

        A run of a number of frames is for programs, several of which may run at once: its port is a free one.
        """
        port = 0 if self.frames and self.port is None else self.port
        return {
            "sensor.calibration": self.calibration,
            "dashboard.port": port,
            "dashboard.host": self.host,
            "dashboard.tls_cert": self.tls_cert,
            "dashboard.tls_key": self.tls_key,
            "reconstruction.mode": self.mode,
            "lighting.sequence": self.sequence,
            "lighting.light_mode": self.light_mode,
            "stream.enabled": self.publish,
            "stream.name": self.name,
            "stream.lan": self.lan,
            "stream.zenoh_config": self.zenoh_config,
            "stream.ros2": self.ros2,
            "stream.foxglove": self.foxglove,
            "stream.sinks": self.sinks,
            "service.log": self.log,
            "service.realtime": self.realtime,
        }

    def ended_by_hand(self) -> AbstractContextManager[None]:
        """Return what takes Ctrl-C and SIGTERM for the proper end, unless a number of frames was asked for."""
        return until_interrupted(not self.frames)
