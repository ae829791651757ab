"""What a service says while it runs: lines for people, or one JSON object a line for programs that collect logs."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Literal

LogForm = Literal["text", "json"]
logger = logging.getLogger("gellight")


class JsonFormatter(logging.Formatter):
    """Makes one line of JSON of a record: `time` (ISO 8601, UTC), `level`, `logger`, `process`, `sensor`, `message`.

    `exception` holds the traceback where there is one.
    """

    def __init__(self, sensor: str) -> None:
        """Name the sensor in every line."""
        super().__init__()
        self._sensor = sensor

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        said = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "process": record.process,
            "sensor": self._sensor,
            "message": record.getMessage(),
        }
        if record.exc_info:
            said["exception"] = self.formatException(record.exc_info)
        return json.dumps(said)


def configure(form: LogForm, sensor: str) -> None:
    """Log in this form to standard error from now on; text is Python's own: warnings and errors, as they are."""
    if form == "text":
        return
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonFormatter(sensor))
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logger.setLevel(logging.INFO)


def say(text: str, *, level: int = logging.INFO) -> None:
    """Say something that a person who watches wants to know: a line on standard error, or a line of the JSON log."""
    if any(isinstance(handler.formatter, JsonFormatter) for handler in logging.getLogger().handlers):
        logger.log(level, text)
    else:
        print(text, file=sys.stderr, flush=True)
