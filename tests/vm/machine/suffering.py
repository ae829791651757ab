"""Faults drawn at random, for a guest that uses a sensor: `python -m tests.vm.machine.suffering SECONDS [SEED]`.

The cable is pulled at a transfer that is drawn, while the guest streams and records or calibrates; its programs are
frozen as for sleep; it stops as a whole. Afterwards files are whole, LEDs dark, the message says what happened, and the
next start works.
"""

import random
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.virtual_usb.device import VirtualSensor, open_virtual
from tests.vm.machine.bench import LIT, Bench, sized
from tests.vm.machine.qemu import Guest, booted
from tests.vm.machine.tiny_bundle import tiny_bundle

NAME, SIZE = "lit", sized(80, 60)
FRAMES, AFTERWARDS = 60, 3
LATEST_TRANSFER = 1500
TOLD = ("unplugged", "plug it in", "plugged", "reconnecting", "is gone", "not answer", "no sensor", "cable", "away")
"""one of these is in what is said of a cable that was pulled"""


@dataclass
class Tally:
    """What became of the faults of one class."""

    tried: int = 0
    passed: int = 0
    worst_s: float = 0.0
    """the next start, or the gap in the stream"""
    broken: list[str] = field(default_factory=list)


class Shears:
    """Cut a sensor's cable at a transfer."""

    def __init__(self, sensor: VirtualSensor, after: int) -> None:
        """Let so many transfers through from now on; the next is never answered."""
        assert sensor._cable is not None
        self.count, self._after, self._cable = 0, after, sensor._cable
        self._answer = self._cable._answer
        self._cable._answer = self._counted  # type: ignore[method-assign]

    def ended(self) -> bool:
        """Cut no more; whether they have cut."""
        self._after, after = sys.maxsize, self._after
        return self.count > after

    def _counted(self, packet: bytes) -> None:
        self.count += 1
        if self.count > self._after:
            self._cable.pull()
        self._answer(packet)


def lit_sensor() -> VirtualSensor:
    """Return the sensor that suffers: the firmware lights it."""
    return open_virtual("sim://?programme=0", serial_number=LIT, geometry=SIZE)


class Suffering:
    """Makes faults, and judges what is left."""

    def __init__(self, guest: Guest, bench: Bench, bundle: Path, seed: int) -> None:
        """Use the sensor `NAME` of a bench; bundle: of that sensor, for recordings."""
        self.guest, self.bench, self._bundle, self._draw = guest, bench, bundle, random.Random(seed)
        self.tallies: dict[str, Tally] = {}
        self._number = 0
        guest.main.preload("tests.vm.inside.suffering")
        self.kinds: dict[str, Callable[[], float]] = {
            "cable pulled while it streams": lambda: self._pulled("stream"),
            "cable pulled while it calibrates": lambda: self._pulled("calibrate"),
            "programs frozen": self._frozen,
            "computer stopped": self._stopped,
        }

    def one(self, kind: str) -> None:
        """Make a fault, and count what became of it."""
        tally = self.tallies.setdefault(kind, Tally())
        tally.tried += 1
        begun_s = time.monotonic()
        try:
            tally.worst_s = max(tally.worst_s, self.kinds[kind]())
            tally.passed += 1
        except AssertionError as error:
            tally.broken.append(str(error)[-600:])
        finally:
            self._clear()
        print(f"{kind}: {time.monotonic() - begun_s:.0f} s {tally.broken[-1:]}", file=sys.stderr, flush=True)

    def _clear(self) -> None:
        """Unplug it, also where to plug it in has failed."""
        with suppress(AssertionError):
            self.bench.clear()
        self._sensor.unplug()
        self._sensor.unplugged.wait(15)

    @property
    def _sensor(self) -> VirtualSensor:
        return self.bench.sensors[NAME]

    def _port(self) -> int:
        return self._draw.randrange(8)

    def _pulled(self, what: str) -> float:
        self._number += 1
        place = f"/tmp/suffered-{self._number}"
        self.bench.plug(NAME, self._port())
        after = int(LATEST_TRANSFER ** self._draw.random())
        shears = Shears(self._sensor, after)
        found = self._use(what, place)
        print(f"  {what}: after {after} transfers {found}", file=sys.stderr, flush=True)
        if found["said"]:
            assert any(word in found["said"] for word in TOLD), f"after {after} transfers it says {found['said']!r}"
            assert "please report" not in found["said"], found["said"]
        else:  # it was done before, or ended as it closed
            assert len(found.get("sequences", ())) == FRAMES or found.get("step") == "aborted", found
        if shears.ended():
            assert self._sensor.unplugged.wait(15)
            self.guest.run("plugging:unplugged", port=self.bench._in.pop(NAME))
            self.bench.plug(NAME, self._port())
        begun_s = time.monotonic()
        again = self._use(what, place, "b")
        taken_s = time.monotonic() - begun_s
        self._judge(what, found, again)
        return taken_s

    def _use(self, what: str, place: str, name: str = "a") -> dict[str, Any]:
        if what == "calibrate":
            return self.guest.run("suffering:calibrate", number=LIT, place=place, seconds=60.0, limit_s=150)
        count = FRAMES if name == "a" else AFTERWARDS
        arguments = {"number": LIT, "bundle": str(self._bundle), "place": f"{place}/{name}.mcap", "count": count}
        return self.guest.run("suffering:stream", limit_s=150, **arguments)

    def _judge(self, what: str, found: dict[str, Any], again: dict[str, Any]) -> None:
        assert not again["said"], f"the next start: {again['said']}"
        if what == "calibrate":
            assert set(again["done"]) >= set(found["done"]), f"{found['done']} was done, then {again['done']}"
            return
        assert found["kept"] == len(found["sequences"]), f"{found['kept']} of {len(found['sequences'])} can be read"
        assert again["kept"] == AFTERWARDS
        assert found["draft"] == again["draft"] == [], f"left: {found['draft']} {again['draft']}"

    # ---- sleep ----

    def _frozen(self) -> float:
        seconds = self._draw.randrange(2, 5)

        def freeze() -> None:
            said = self.guest.aside.run("suffering:freeze", seconds=seconds, limit_s=100)
            assert not said, said

        return self._through(freeze)

    def _stopped(self) -> float:
        seconds = self._draw.uniform(2, 5)

        def stop() -> None:
            with self.guest.stopped():
                time.sleep(seconds)

        return self._through(stop)

    def _through(self, sleep: Callable[[], None]) -> float:
        """Let the guest sleep while it streams; the LEDs are dark meanwhile, and the stream goes on afterwards."""
        self.bench.plug(NAME, self._port())
        board = self._sensor.board
        assert board is not None
        call = self.guest.start("suffering:go_on", number=LIT, seconds=10.0, limit_s=120)
        call.event("streaming")
        begun_us, mark_s = board.virtual_us(time.monotonic()), time.monotonic()
        try:
            sleep()
        except AssertionError:
            call.result()  # or its answer would be taken for that of the next
            raise
        slept_s = time.monotonic() - mark_s
        dark = [light for light in board.light_during(begun_us, board.virtual_us(time.monotonic()))
                if not light.colours.any()]  # fmt: skip
        assert dark, f"the LEDs were never dark in {slept_s:.1f} s"
        found = call.result()
        assert found["sequences"] == sorted(set(found["sequences"])), "no frame twice, none out of order"
        assert found["grey"] > 20, f"it is lit again: {found['grey']:.0f} grey"
        assert not found["said"] or "reconnecting" in found["said"], found["said"]
        return max(float(found["gap_s"]) - slept_s, 0.0)


def main() -> int:
    """Draw faults for so many seconds; print a table. Return 1 where something did not hold."""
    seconds, seed = float(sys.argv[1]), int((sys.argv[2:] or ["1"])[0])
    with tempfile.TemporaryDirectory() as name, booted(Path(name)) as guest:
        tiny_bundle(Path(name) / "bundle", SIZE)
        with Bench(guest, {NAME: lit_sensor()}) as bench:
            suffering = Suffering(guest, bench, Path(name) / "bundle", seed)
            end_s, kinds = time.monotonic() + seconds, list(suffering.kinds)
            turn = 0
            while time.monotonic() < end_s:
                suffering.one(kinds[turn % len(kinds)])
                turn += 1
    for kind, tally in suffering.tallies.items():
        print(f"{kind:34}{tally.tried:5} tried {tally.passed:5} passed, worst {tally.worst_s:.1f} s")
        print("".join(f"  {text}\n" for text in tally.broken), end="")
    return int(any(tally.broken for tally in suffering.tallies.values()))


if __name__ == "__main__":
    sys.exit(main())
