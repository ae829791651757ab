"""How the server answers what a page asks by POST and GET: by a thread, or with the reason why not."""

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Generic, TypeVar

from aiohttp import web
from pydantic import TypeAdapter, ValidationError

from gellight.base.allowed import in_words
from gellight.base.errors import GellightError

logger = logging.getLogger(__name__)

T = TypeVar("T")
Command = TypeVar("Command")


class Answering(Generic[T]):
    """Answers about one thing, which may be missing."""

    def __init__(self, about: T | None, name: str, missing: str) -> None:
        """Answer about something; where there is None, say what is `missing`. name: of the threads."""
        self._about, self._missing = about, missing
        self._worker = ThreadPoolExecutor(2, thread_name_prefix=f"dashboard-{name}")

    async def stop(self, app: web.Application) -> None:
        """End the threads."""
        self._worker.shutdown(wait=True, cancel_futures=True)

    async def answer(self, make: Callable[[T], web.Response], refused_by: int) -> web.Response:
        """Let a thread make the answer; what cannot be done is answered with the reason and the status `refused_by`."""
        if self._about is None:
            return refused(self._missing, 404)
        try:
            return await asyncio.get_running_loop().run_in_executor(self._worker, make, self._about)
        except (GellightError, TimeoutError, ValueError) as error:
            return refused(str(error), refused_by)
        except Exception:
            logger.exception("an answer failed")
            return refused("that failed; the log says why", 500)

    async def obey(
        self, request: web.Request, commands: TypeAdapter[Command], carry_out: Callable[[Command, T], None]
    ) -> web.Response:
        """Carry out a command; answer {}, or why not."""
        # JSON only: a form of another site could be sent without asking.
        if self._about is not None and request.content_type != "application/json":
            return refused("commands are application/json", 415)
        try:
            command = commands.validate_json(await request.read())
        except ValidationError as error:
            return refused(in_words(error, "the command"), 400)

        def carried_out(about: T) -> web.Response:
            carry_out(command, about)
            return web.json_response({})

        return await self.answer(carried_out, 409)


def refused(message: str, status: int) -> web.Response:
    """Return the answer that says why not."""
    return web.json_response({"message": message}, status=status)
