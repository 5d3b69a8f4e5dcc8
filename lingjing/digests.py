"""SHA-256 without OpenSSL: `hashlib` loads its library, which takes a thirtieth of a cold `lingjing validate`.

Python 3.11 has it in a module of its own; a later Python, or one that was built without that module, uses `hashlib`.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from hashlib import sha256
else:
    try:
        from _sha256 import sha256
    except ImportError:
        from hashlib import sha256

__all__ = ["sha256"]
