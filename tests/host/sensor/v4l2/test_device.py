"""Modes, controls, and who stands in the way: chosen, verified, named."""

import errno
import threading

import pytest

from gellight.base.errors import CameraError, InputError
from gellight.sensor.v4l2 import controls as c
from gellight.sensor.v4l2 import structures as v
from gellight.sensor.v4l2.controls import V4l2Controls
from gellight.sensor.v4l2.device import Device
from gellight.sensor.v4l2.errors import BusyError, DeniedError, UnpluggedError
from gellight.sensor.v4l2.formats import Wanted, choose
from gellight.sensor.v4l2.options import parse_url
from gellight.sensor.v4l2.video_camera import V4l2Camera
from tests.helpers.fake_kernel import FakeCamera, FakeControl, refuse
from tests.helpers.v4l2_pictures import PATH, fake, jpeg, scene

# ---- the choice of a mode ----


def test_a_mode_is_chosen_by_size_and_rate_and_the_preferred_format_wins() -> None:
    kernel, _ = fake()
    with Device(PATH, kernel=kernel) as device:
        assert str(device.configure(Wanted(width=640, height=480))) == "MJPG 640x480 at 30 fps"
        assert str(device.configure(Wanted(width=640, height=480, fps=60))) == "MJPG 640x480 at 60 fps"
        assert str(device.configure(Wanted(letters="YUYV", width=640, height=480))) == "YUYV 640x480 at 30 fps"
        assert str(device.configure(Wanted(width=32, height=24))) == "YUYV 32x24 at 30 fps"
        assert str(device.configure(Wanted())) == "MJPG 1280x720 at 30 fps", "the largest"
        assert str(device.configure(Wanted(letters="YUYV"))) == "YUYV 640x480 at 30 fps"


@pytest.mark.parametrize(
    "wanted",
    [
        Wanted(width=641, height=480),
        Wanted(width=640, height=480, fps=31),
        Wanted(letters="GREY", width=640, height=480),
        Wanted(letters="H264", width=640, height=480),
    ],
)
def test_what_is_not_offered_is_refused_with_the_list_of_what_is(wanted: Wanted) -> None:
    kernel, _ = fake()
    with Device(PATH, kernel=kernel) as device, pytest.raises(CameraError) as caught:
        device.configure(wanted)
    assert "MJPG 640x480 at 60, 30, 15 fps" in str(caught.value)
    assert "H264, not decoded" in str(caught.value)
    assert str(wanted) in str(caught.value)


def test_a_range_of_sizes_or_rates_holds_every_step_of_it() -> None:
    kernel, _ = fake(formats={"MJPG": {(640, 480): [30]}})

    def range_of_sizes(camera: FakeCamera, entry: v.FrameSize) -> None:
        if entry.index:
            raise refuse(errno.EINVAL)
        entry.type = 3
        entry.size.values[:] = [320, 960, 16, 248, 720, 8]

    kernel._enum_framesizes = range_of_sizes  # type: ignore[method-assign]
    kernel._enum_frameintervals = lambda camera, entry: kernel._index(entry, 0)  # type: ignore[method-assign]
    with Device(PATH, kernel=kernel) as device:
        (offer,) = device.offers()
    assert offer.has(640, 480)
    assert offer.has(336, 248)
    assert not offer.has(641, 480)
    assert not offer.has(1280, 720)
    assert "320x248 to 960x720" in str(offer)
    kernel, _ = fake(formats={"MJPG": {(640, 480): [30]}})

    def range_of_rates(camera: FakeCamera, entry: v.FrameInterval) -> None:
        kernel._index(entry, 1)
        entry.type = 3
        entry.values[:] = [1, 60, 1, 1, 1, 1000]  # the shortest and the longest interval, and the step

    kernel._enum_frameintervals = range_of_rates  # type: ignore[method-assign]
    with Device(PATH, kernel=kernel) as device:
        (offer,) = offered = device.offers()
    assert str(offer) == "MJPG 640x480 at 60 to 1 fps"
    assert choose(offered, Wanted(), path=PATH).fps == 30, "not 1, the nearer one of its ends"
    assert choose(offered, Wanted(fps=25), path=PATH).fps == 25
    with pytest.raises(CameraError, match="60 to 1 fps"):
        choose(offered, Wanted(fps=90), path=PATH)


def test_the_lines_of_a_picture_are_as_long_as_the_driver_says_and_those_of_a_jpeg_have_no_length() -> None:
    kernel, _ = fake()
    plain = kernel._s_fmt

    def padded(camera: FakeCamera, argument: v.Format) -> None:
        plain(camera, argument)
        argument.fmt.pix.bytesperline = 1344  # some drivers say the same of MJPG

    kernel._s_fmt = padded  # type: ignore[method-assign]
    with Device(PATH, kernel=kernel) as device:
        for letters, line_bytes in (("YUYV", 1344), ("MJPG", 0)):
            assert device.configure(Wanted(letters=letters, width=640, height=480)).line_bytes == line_bytes


def test_a_node_is_judged_by_its_own_abilities_and_by_those_of_the_driver_where_it_tells_none() -> None:
    kernel, _ = fake()

    def answering(capabilities: int, of_the_node: int) -> None:
        def tell(camera: FakeCamera, answer: v.Capability) -> None:
            answer.capabilities, answer.device_caps = capabilities, of_the_node

        kernel._querycap = tell  # type: ignore[method-assign]

    able, metadata = v.CAP_VIDEO_CAPTURE | v.CAP_STREAMING, 0x00800000 | v.CAP_STREAMING
    answering(able, 0)  # an old driver
    Device(PATH, kernel=kernel).close()
    answering(able | metadata | v.CAP_DEVICE_CAPS, metadata)  # the second node of a UVC camera
    with pytest.raises(CameraError, match="delivers no pictures"):
        Device(PATH, kernel=kernel)


# ---- who and what stands in the way ----


def test_no_camera_a_foreign_camera_and_no_permission_are_told_apart() -> None:
    kernel, camera = fake()
    with pytest.raises(UnpluggedError, match=r"no camera at /dev/video8.*gellight find"):
        Device("/dev/video8", kernel=kernel)
    camera.denied = True
    with pytest.raises(DeniedError, match="install-udev"):
        Device(PATH, kernel=kernel)
    camera.denied, camera.capabilities = False, 0x00800000
    with pytest.raises(CameraError, match="delivers no pictures"):
        Device(PATH, kernel=kernel)
    camera.errors[v.QUERYCAP] = errno.ENOTTY
    with pytest.raises(CameraError, match="is no V4L2 camera: `gellight find` lists"):
        Device(PATH, kernel=kernel)
    assert not kernel.opened, "what could not be used was closed again"


def test_a_busy_camera_says_who_holds_it_and_a_full_bus_the_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    busy, _ = fake(busy=True)
    monkeypatch.setattr("gellight.base.holders.holders", lambda path, proc: [(4711, "cheese")])
    with pytest.raises(BusyError, match=r"in use by cheese \(process 4711\): end that programme"):
        V4l2Camera(PATH, kernel=busy)
    full, camera = fake()
    camera.errors[v.STREAMON] = errno.ENOSPC
    with pytest.raises(CameraError, match="has no bandwidth left: use format=MJPG"):
        V4l2Camera(PATH, kernel=full)
    assert not busy.opened | full.opened


def test_a_camera_without_memory_for_two_pictures_is_told_and_nothing_stays_mapped() -> None:
    kernel, camera = fake()
    kernel._reqbufs = lambda camera, argument: setattr(argument, "count", 1)  # type: ignore[method-assign]
    with pytest.raises(CameraError, match="memory for 1 pictures only: ask for a smaller size"):
        V4l2Camera(PATH, kernel=kernel)
    assert not kernel.opened
    kernel, camera = fake()
    camera.errors[v.STREAMON] = errno.EIO
    with pytest.raises(CameraError, match="fails to start its stream"):
        V4l2Camera(PATH, kernel=kernel)
    assert all(memory.closed for memory in camera.mapped)
    assert camera.mapped


def test_the_controls_of_a_camera_that_was_closed_say_so() -> None:
    kernel, _ = fake()
    camera = V4l2Camera(PATH, kernel=kernel)
    camera.close()
    for use in (camera.controls.names, camera.controls.deviations, lambda: camera.controls.set("gain", 3)):
        with pytest.raises(CameraError, match="is closed: open it again"):
            use()


# ---- controls ----


def controls_of(**changes: FakeControl) -> tuple[FakeCamera, V4l2Controls]:
    kernel, camera = fake()
    return camera, Device(PATH, kernel=kernel).controls


def test_locking_switches_everything_automatic_off_and_keeps_what_is_not_named() -> None:
    camera, controls = controls_of()
    controls.lock({"exposure_us": 8000, "white_balance_k": 5000})
    values = {number: control.value for number, control in camera.controls.items()}
    assert values == {c.EXPOSURE_AUTO: 1, c.EXPOSURE: 80, c.DYNAMIC_RATE: 0, c.GAIN: 0, c.WHITE_BALANCE_AUTO: 0,
                      c.WHITE_BALANCE: 5000, c.POWER_LINE: 0}  # fmt: skip
    assert all(controls.locked().values())
    controls.verify()


def test_values_are_in_units_and_read_back_from_the_camera() -> None:
    camera, controls = controls_of()
    assert controls.names() == ("exposure_us", "gain", "white_balance_k")
    assert controls.range("exposure_us") == (100, 500_000, 100)
    assert controls.set("exposure_us", 7849) == 7800
    assert controls.read("exposure_us") == 7800
    assert controls.set("white_balance_k", 5004) == camera.controls[c.WHITE_BALANCE].value == 5000
    assert controls.set("gain", 3) == controls.read("gain") == camera.controls[c.GAIN].value == 3
    assert camera.controls[c.EXPOSURE_AUTO].value == 1, "set alone switches the automatic off too"


def test_a_value_out_of_range_a_control_that_is_not_there_and_what_the_camera_refuses_are_told() -> None:
    camera, controls = controls_of()
    with pytest.raises(InputError, match="takes 2800 to 6500 in steps of 10"):
        controls.set("white_balance_k", 9000)
    del camera.controls[c.GAIN]
    with pytest.raises(CameraError, match=r"no control gain \(it has: exposure_us, white_balance_k\)"):
        controls.set("gain", 3)
    kernel, camera = fake()
    controls = Device(PATH, kernel=kernel).controls
    camera.errors[v.S_CTRL] = errno.EIO
    with pytest.raises(CameraError, match="refuses the dynamic frame rate = 0"):
        controls.lock({})


def test_an_exposure_longer_than_the_frame_period_is_refused_with_the_way_out() -> None:
    kernel, camera = fake()
    with pytest.raises(InputError, match=r"exposure of 40 ms is longer than the frame period of 33.33 ms.*at most 25"):
        V4l2Camera(PATH, parse_url(f"v4l2://{PATH}?exposure_us=40000")[1], kernel=kernel)
    camera.controls[c.EXPOSURE].value = 500
    with pytest.raises(CameraError, match="exposure of 50 ms is longer"):
        V4l2Camera(PATH, kernel=kernel)
    assert not kernel.opened


@pytest.mark.parametrize("number", [c.EXPOSURE, c.WHITE_BALANCE_AUTO, c.DYNAMIC_RATE])
def test_a_control_that_does_not_hold_is_an_error(number: int) -> None:
    camera, controls = controls_of()
    camera.controls[number].keeps = lambda value: value + 1
    with pytest.raises(CameraError, match=r"does not keep its settings: .* was set to \S+ and is \S+; use a camera"):
        controls.lock({"exposure_us": 8000})


def test_a_control_that_is_reset_when_the_stream_starts_is_an_error() -> None:
    kernel, camera = fake(payload=lambda number: jpeg(scene(number)))
    with V4l2Camera(PATH, parse_url("v4l2://x?exposure_us=8000")[1], shape=(480, 640), kernel=kernel) as opened:
        camera.controls[c.EXPOSURE].value = 157
        with pytest.raises(CameraError, match="exposure_us was set to 8000 and is 15700"):
            opened.read()


def test_a_mains_filter_that_cannot_be_off_is_left_alone_unless_one_is_asked_for() -> None:
    camera, controls = controls_of()
    camera.controls[c.POWER_LINE] = FakeControl(1, 2, 1, 2)
    controls.lock({})
    assert camera.controls[c.POWER_LINE].value == 2
    for frequency_hz, value in ((60, 2), (50, 1)):  # as the kernel numbers them
        controls.lock({}, power_line_hz=frequency_hz)
        assert camera.controls[c.POWER_LINE].value == value


def test_a_value_that_is_being_set_is_never_found_changed() -> None:
    camera, controls = controls_of()
    controls.lock({})
    wrong: list[object] = []
    camera.controls[c.EXPOSURE].keeps = lambda value: wrong.extend(looked()) or value

    def looked() -> list[object]:
        watcher = threading.Thread(target=lambda: wrong.extend(controls.deviations()))
        watcher.start()
        watcher.join(0.05)
        assert watcher.is_alive(), "it waits until the value is noted"
        return []

    controls.set("exposure_us", 5000)
    assert not wrong
