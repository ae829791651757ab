"""Whatever bytes come to a daemon or to its readers: an answer or a refusal, and the frames go on."""

import json
from collections.abc import Iterator

import pytest
import zenoh
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from gellight.base.errors import InputError, StreamError
from gellight.base.locking import lock
from gellight.base.runtime_folder import folder
from gellight.sensor.v4l2.options import parse_url
from gellight.stream.network import close, key, subscribing_session
from gellight.stream.publisher import Publisher
from gellight.stream.running import running
from gellight.stream.subscription import read_status
from tests.helpers.streamed import bump_daemon

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
calls = st.builds(
    lambda kind, rest: json.dumps({**rest, "type": kind}).encode(),
    st.sampled_from(["status", "calibration", "light", "zero", "press", "release", "mode", "nonsense"]) | json_values,
    st.dictionaries(st.sampled_from(["colours", "object", "depth_mm", "x_mm", "y_mm", "x"]), json_values, max_size=5),
)


@pytest.mark.parametrize("answer", [b"", b"[" * 200_000, b"\xff", b"5", b"[]"])
def test_an_answer_that_is_no_status_is_an_error_of_the_stream(answer: bytes) -> None:
    with pytest.raises(StreamError, match="what answers as finger gives no status"):
        read_status(answer, "finger")


@pytest.mark.parametrize("url", ["v4l2://[", "sim://[x", "v4l2://[::1"])
def test_a_url_with_half_a_bracket_is_refused(url: str) -> None:
    with pytest.raises(InputError, match="is no URL"):
        parse_url(url)


@pytest.fixture(scope="module")
def called(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[zenoh.Session, str]]:
    """A client of zenoh, and the address of the daemon that it is connected to."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))
        daemon, _ = bump_daemon(period_s=0.02)
        with daemon, Publisher(daemon, name="finger"):
            endpoint = running()[0].endpoint
            session = subscribing_session(endpoint, config=None)
            yield session, endpoint.removeprefix("tcp/")
            close(session)


@given(st.binary(max_size=300) | calls)
@example(b"[" * 50_000)
@example(b'{"type": "light", "colours": [' + b"[1,2,3]," * 8000 + b"[1,2,3]]}")
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_daemon_answers_any_call_and_lives_on(called: tuple[zenoh.Session, str], content: bytes) -> None:
    caller, _ = called
    (reply,) = caller.get(key("finger", "call"), payload=content, timeout=20)
    assert (reply.ok is None) != (reply.err is None)
    (status,) = caller.get(key("finger", "call"), payload=b'{"type": "status"}', timeout=20)
    assert json.loads(status.ok.payload.to_bytes())["frames"] >= 0


@given(st.binary(max_size=6000))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_file_of_a_daemon_may_hold_anything(content: bytes) -> None:
    """Locked as by a daemon that lives: it is passed over."""
    folder().mkdir(parents=True, exist_ok=True)
    (folder() / "x.json").write_bytes(content)
    with (folder() / "x.json").open("a+") as handle:
        assert lock(handle)
        assert running() == []
