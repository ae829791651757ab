"""`/metrics` for Prometheus, and `/health` for what only asks whether the sensor works."""

import json
from collections.abc import Awaitable, Callable, Iterator, Mapping
from typing import Any

from aiohttp import web

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
COUNTERS = {
    "frames": ("gellight_frames_total", "Tactile frames that were computed."),
    "dropped": ("gellight_dropped_frames_total", "Camera frames that were replaced by a newer one."),
    "lost": ("gellight_lost_frames_total", "Frames that the camera took and that never came."),
}
"""name and meaning of what only grows, by the key of the status"""


def add_metrics(app: web.Application, status_text: Callable[[], Awaitable[str]]) -> None:
    """Add `/metrics` and `/health`, which answers 200, or 503 with what is wrong, by the status as JSON."""

    async def show_metrics(request: web.Request) -> web.Response:
        text = "\n".join(metric_lines(json.loads(await status_text()))) + "\n"
        return web.Response(body=text.encode(), headers={"Content-Type": CONTENT_TYPE})

    async def show_health(request: web.Request) -> web.Response:
        error = json.loads(await status_text())["error"]
        return web.json_response({"ok": error is None, "error": error}, status=503 if error else 200)

    app.router.add_get("/metrics", show_metrics)
    app.router.add_get("/health", show_health)


def metric_lines(status: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of Prometheus's text format for a status; see `SensorSession.status`."""
    for key, (name, meaning) in COUNTERS.items():
        yield from described(name, meaning, "counter", {"": status.get(key)})
    yield from described("gellight_up", "1 while the sensor works.", "gauge", {"": int(status.get("error") is None)})
    yield from described("gellight_frame_rate", "Tactile frames a second.", "gauge", {"": status.get("fps")})
    ages = {"0.5": "median", "0.95": "p95"}
    found = {f'{{quantile="{q}"}}': seconds(status.get("frame_age_ms", {}).get(name)) for q, name in ages.items()}
    yield from described("gellight_frame_age_seconds", "From the exposure to the depth map.", "gauge", found)
    stages = {f'{{stage="{name}"}}': seconds(ms) for name, ms in status.get("stage_ms", {}).items()}
    yield from described("gellight_stage_seconds", "Median time of a stage of the frame path.", "gauge", stages)
    touch = status.get("touch") or {}
    deep, force_n = touch.get("indentation_mm"), (touch.get("force") or {}).get("normal_n")
    yield from described("gellight_indentation_mm", "Largest depth of the newest frame.", "gauge", {"": deep})
    yield from described("gellight_force_newtons", "Normal force of the newest frame.", "gauge", {"": force_n})
    heat = status.get("ring") or {}
    warm = {f'{{part="{part}"}}': heat.get(f"{part}_c") for part in ("chip", "ring")}
    yield from described("gellight_light_celsius", "Of the light ring and of its board's chip.", "gauge", warm)
    watch = status.get("watch") or {}
    kinds = {f'{{kind="{finding["kind"]}"}}': 1 for finding in watch.get("findings", [])}
    yield from described("gellight_finding", "What has changed since the calibration.", "gauge", kinds)


def described(name: str, meaning: str, kind: str, values: Mapping[str, float | None]) -> Iterator[str]:
    """Yield a metric with its values by their labels; nothing for values that are not known yet."""
    known = {labels: value for labels, value in values.items() if value is not None}
    if known:
        yield f"# HELP {name} {meaning}"
        yield f"# TYPE {name} {kind}"
        yield from (f"{name}{labels} {value:.12g}" for labels, value in known.items())


def seconds(ms: float | None) -> float | None:
    """Return s for ms."""
    return None if ms is None else ms * 1e-3
