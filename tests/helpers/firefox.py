"""Firefox for the tests, spoken to in WebDriver BiDi: Debian's own, which Playwright cannot drive."""

import asyncio
import json
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiohttp

from tests.helpers import children

PATIENCE_S = 60.0


class Firefox:
    def __init__(self, loop: asyncio.AbstractEventLoop, line: aiohttp.ClientWebSocketResponse) -> None:
        self._loop, self._line, self._count = loop, line, 0
        self.complaints: list[str] = []
        self._ask("session.new", capabilities={})
        self._page = self._ask("browsingContext.getTree")["contexts"][0]["context"]
        self._ask("session.subscribe", events=["log.entryAdded"])

    def _ask(self, method: str, **what: Any) -> Any:
        return self._loop.run_until_complete(asyncio.wait_for(self._answer(method, what), PATIENCE_S))

    async def _answer(self, method: str, what: dict[str, Any]) -> Any:
        self._count += 1
        await self._line.send_json({"id": self._count, "method": method, "params": what})
        while True:
            said = await self._line.receive_json()
            if said.get("method") == "log.entryAdded" and said["params"]["level"] == "error":
                self.complaints.append(said["params"]["text"])
            if said.get("id") == self._count:
                assert said["type"] == "success", said
                return said["result"]

    def open(self, url: str, width: int = 1366, height: int = 768) -> None:
        """Open a page in a window of this size."""
        self._ask("browsingContext.setViewport", context=self._page, viewport={"width": width, "height": height})
        self._ask("browsingContext.navigate", context=self._page, url=url, wait="complete")

    def evaluate(self, expression: str) -> Any:
        """Return what an expression, or the promise of one, is."""
        given = self._ask(
            "script.evaluate",
            expression=f"Promise.resolve({expression}).then(JSON.stringify)",
            target={"context": self._page},
            awaitPromise=True,
        )
        assert given["type"] == "success", given
        return json.loads(given["result"].get("value", "null"))

    def wait(self, expression: str) -> None:
        """Wait until an expression is true."""
        self.evaluate(f"""new Promise((done, fail) => {{
            const timer = setInterval(() => ({expression}) && (clearInterval(timer), done(true)), 30);
            setTimeout(() => fail(new Error("never true")), {PATIENCE_S * 900:.0f});
        }})""")

    def drag(self, element: str, *places: tuple[float, float]) -> None:
        """Hold the mouse and go through places, as parts of an element's size."""
        left, top, width, height = self.evaluate(
            f"(() => {{ const b = document.getElementById('{element}').getBoundingClientRect();"
            " return [b.left, b.top, b.width, b.height]; })()"
        )
        moves = [
            {"type": "pointerMove", "x": round(left + x * width), "y": round(top + y * height), "duration": 50}
            for x, y in places
        ]
        held = [moves[0], {"type": "pointerDown", "button": 0}, *moves[1:], {"type": "pause", "duration": 300}]
        actions = [{"type": "pointer", "id": "mouse", "actions": [*held, {"type": "pointerUp", "button": 0}]}]
        self._ask("input.performActions", context=self._page, actions=actions)


@contextmanager
def firefox(program: str, profile: Path) -> Iterator[Firefox]:
    command = [program, "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile", str(profile)]
    loop = asyncio.new_event_loop()
    with children.started(command, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        address = next(filter(None, (re.search(r"BiDi listening on (ws://\S+)", line) for line in running.stderr)))[1]

        async def connect() -> tuple[aiohttp.ClientSession, aiohttp.ClientWebSocketResponse]:
            client = aiohttp.ClientSession()
            return client, await client.ws_connect(f"{address}/session", max_msg_size=0)

        client, line = loop.run_until_complete(connect())
        try:
            yield Firefox(loop, line)
        finally:
            loop.run_until_complete(client.close())
            loop.close()
