"""Memory that is freed stays with the process, where its C library lets one say so.

A field of a thousand gaps takes and frees ten megabytes. glibc gives free memory at the end of the
heap back to the system at once, which hands it out again page by page, each one cleared: a quarter
of such a field's time. The process grows no larger by what it keeps than it has been.
"""

from __future__ import annotations

import ctypes
from functools import cache

# mallopt's parameters in glibc's malloc.h, and the largest threshold that it accepts for mmap
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD = -1, -2, -3
_LARGEST_FROM_HEAP = 1 << 25
_KEPT = 1 << 28  # bytes
_AHEAD = 1 << 22


@cache
def keep_freed() -> bool:
    """Let this process keep up to 256 MiB of freed memory; whether its C library does."""
    try:
        library = ctypes.CDLL(None)
        set_option, _ = library.mallopt, library.gnu_get_libc_version
    except (OSError, TypeError, AttributeError):  # not glibc
        return False
    options = (
        (_MMAP_THRESHOLD, _LARGEST_FROM_HEAP),
        (_TRIM_THRESHOLD, _KEPT),
        (_TOP_PAD, _AHEAD),
    )
    return bool(sum(set_option(name, value) for name, value in options) == len(options))
