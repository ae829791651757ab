"""A computer made of nothing, for the doctor to examine: its pictures are as bright as its LEDs."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from gellight.lab.doctor.examination import examine
from gellight.lab.doctor.shutter_meter import ShutterEstimate
from gellight.sensor.findings import Finding, Level
from tests.helpers.sensor_bench import Bench, BenchRing

WEBCAM = (0x046D, 0x0825)


MEASURED = ShutterEstimate(exposure_s=0.008, readout_s=0.012, delay_s=-0.021, scatter_s=2e-4)


class TalkingRing(BenchRing):
    """Answers what the doctor asks; a round trip takes `answer_s`."""

    answer_s, temperature = 0.001, 655

    def counters(self) -> Any:
        return SimpleNamespace(packets=7)

    def clock(self, host_us: int = 0) -> None:
        self.kernel.sleep(self.answer_s)


class Clinic(Bench):
    """A computer whose pictures are as bright as its LEDs."""

    blind = False

    def plug(self, port: str, serial: str, **changes: Any) -> Any:
        camera = super().plug(port, serial, **{"formats": {"YUYV": {(32, 24): [30]}}, **changes})
        camera.payload = self.look
        return camera

    def look(self, number: int) -> bytes:
        lit = max((int(ring.lit.mean()) for ring in self.rings), default=0)
        return bytes([20 + (0 if self.blind else lit), number % 251] * 32 * 24)

    def open_ring(self, url: str) -> Any:
        self.rings.append(TalkingRing(self.kernel, url))
        return self.rings[-1]

    def examine(self, tmp_path: Path, name: str | None = None) -> list[Finding]:
        return list(examine(name, surroundings=self.surroundings, folder=tmp_path, rules=tmp_path))


def wrong(findings: list[Finding]) -> dict[str, Finding]:
    assert all(bool(finding.remedy) == (finding.level is not Level.OK) for finding in findings)
    return {finding.check: finding for finding in findings if finding.level is not Level.OK}
