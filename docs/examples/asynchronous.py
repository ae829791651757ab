"""Read frames in an asyncio program: other tasks go on while a frame is waited for."""

import asyncio
import sys

import gellight

sys.tracebacklimit = 0  # errors in one line
name = sys.argv[1] if sys.argv[1:] else "auto"


async def watch(seconds: float) -> int:
    """Count the frames that show a contact."""
    touched = 0
    async with asyncio.timeout(seconds):
        with gellight.subscribe(name, wait_s=60) as frames:
            async for frame in frames:
                touched += frame.contact.area_mm2 > 0
                if touched >= 5:
                    break
    return touched


print(asyncio.run(watch(30)), "frames with a contact")
