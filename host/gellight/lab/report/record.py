"""Figures with their names: kept in files, shown as JSON, printed in reports."""

from typing import Any

from pydantic import BaseModel, ConfigDict


class Record(BaseModel):
    """Figures with their names."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def as_json(self) -> dict[str, Any]:
        """Return the figures ready for JSON; what is unknown is left out."""
        return self.model_dump(mode="json", exclude_none=True)
