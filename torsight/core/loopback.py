"""The address under which a computer reaches itself and no other one reaches it: all that is served is served there."""

from __future__ import annotations

from typing import Final

LOOPBACK: Final = "127.0.0.1"
