"""Open sources of measurements: a file, or the content of a stream.

Files that have to be unpacked or exported first are refused: archives, workbooks, pictures.
"""

from __future__ import annotations

import io
import os
import re
import shlex
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from adhesis.ensemble.errors import InputError, reason
from adhesis.ensemble.escape import printable
from adhesis.ensemble.files import open_regular
from adhesis.solver import checks

MOST_BYTES = 200_000_000

# By their first bytes: what a file is, and the program that unpacks it; without one the heights are
# to be exported.
_NO_TRACES = {
    b"\x1f\x8b": ("compressed (gzip)", "gunzip"),
    b"BZh": ("compressed (bzip2)", "bunzip2"),
    b"\xfd7zXZ\0": ("compressed (xz)", "unxz"),
    b"\x28\xb5\x2f\xfd": ("compressed (zstd)", "unzstd"),
    b"7z\xbc\xaf\x27\x1c": ("compressed (7z)", "7z x"),
    b"Rar!": ("compressed (rar)", "unrar x"),
    b"%PDF": ("a PDF", None),
    b"\x89PNG": ("a picture (PNG)", None),
    b"\xff\xd8\xff": ("a picture (JPEG)", None),
    b"GIF8": ("a picture (GIF)", None),
}
_ZIP, _COMPOUND = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
_BOOK = "Workbook".encode("utf-16-le")
_WORKBOOKS = frozenset((".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"))
_BEGIN = 4096
_BLOCK = 1 << 20
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
# Texts of instruments that the reader of their files knows, by their first signs.
_INSTRUMENT_TEXT = re.compile(rb"[ab]ISO-1\.0|fileformat", re.IGNORECASE)
# Those that no reader here knows.
_OTHER_TEXTS = {
    re.compile(rb"\s*ISO ?5436|(?s:.*)\nCX\s+[AIM]\s"): "a profile in the form of ISO 5436-2 (SMD)",
    re.compile(rb"\s*[ab](ISO|BCR)[-\s]*\d"): "a variant of SDF (ISO 25178-71)",
    re.compile(rb"DSAA\s"): "a grid of Surfer (DSAA)",
    re.compile(rb"Zygo XYZ"): "a file of Zygo (XYZ), which counts pixels",
}


@dataclass(frozen=True)
class Source:
    """A file of measurements, or what a stream held."""

    name: str  # in messages; its ending may decide the format
    content: bytes | None = None  # of a stream; None for a file, whose name is its path

    def __str__(self) -> str:
        return printable(self.name).replace("\n", r"\n")

    @property
    def is_npy(self) -> bool:
        """Whether it is an array of NumPy, whatever its name."""
        return self.beginning().startswith(b"\x93NUMPY")

    def holds_numbers(self) -> bool:
        """Return whether it is a text or a .npy, and no instrument's file.

        InputError if it cannot be read, or has to be unpacked or exported first.
        """
        if self.is_npy:
            return True
        begin = self.beginning().removeprefix(b"\xef\xbb\xbf")
        is_wide = begin.startswith(_UTF16)
        if _INSTRUMENT_TEXT.match(begin[2:].replace(b"\0", b"") if is_wide else begin):
            return False
        for known, name in _OTHER_TEXTS.items():
            if known.match(begin):
                raise InputError(
                    f"{self} is {name}, whose numbers are no plain columns: export the trace as "
                    "text"
                )
        return is_wide or not self.holds_zero_bytes()

    def holds_zero_bytes(self) -> bool:
        """Return whether there is a zero byte anywhere: a text has none (InputError)."""
        with self._reading() as stream:
            return any(b"\0" in block for block in iter(lambda: stream.read(_BLOCK), b""))

    def open(self) -> BinaryIO:
        """Open it to read (OSError)."""
        return open_regular(self.name) if self.content is None else io.BytesIO(self.content)

    @contextmanager
    def _reading(self) -> Iterator[BinaryIO]:
        """Open it to read; InputError if anything fails."""
        try:
            with self.open() as stream:
                yield stream
        except FileNotFoundError:
            raise InputError(f"cannot read {self}: there is no such file") from None
        except OSError as error:
            raise InputError(f"cannot read {self}: {reason(error)}") from None

    def read(self) -> bytes:
        """Return its whole content; InputError if it cannot be read, or is too large for a text."""
        with self._reading() as stream:
            size = stream.seek(0, os.SEEK_END)
            if size > MOST_BYTES:
                raise InputError(
                    f"{self} holds {size / 1e6:.0f} MB: at most {MOST_BYTES // 10**6} MB"
                )
            stream.seek(0)
            return stream.read()

    def beginning(self) -> bytes:
        """Return its first bytes.

        InputError if it is missing, no regular file, unreadable, empty, or has to be unpacked or
        exported first.
        """
        with self._reading() as stream:
            begin = stream.read(_BEGIN)
        if not begin.strip() and not self.read().strip():
            raise InputError(f"{self} is empty")
        for magic, (what, program) in _NO_TRACES.items():
            if begin.startswith(magic):
                command = f" ({program} {shlex.quote(str(self))})" if self.content is None else ""
                mend = f"unpack it first{command}" if program else "export the heights as text"
                raise InputError(f"{self} is {what}: {mend}")
        return begin

    def refuse(self, sentence: str) -> NoReturn:
        """Raise InputError; a workbook or an archive is named as that."""
        raise InputError(self._container() or f"{self} {sentence}") from None

    def _container(self) -> str | None:
        """Return a message for a workbook or an archive that is no instrument's file, else None."""
        begin, suffix = self.beginning(), Path(self.name).suffix.lower()
        workbook = f"{self} is a workbook: save its columns as text (CSV)"
        if begin.startswith(_COMPOUND) and (suffix in _WORKBOOKS or _BOOK in self.read()):
            return workbook
        if not begin.startswith(_ZIP):
            return None
        try:
            with self.open() as stream, zipfile.ZipFile(stream) as file:
                names = file.namelist()
        except (OSError, zipfile.BadZipFile):
            names = []
        if suffix in _WORKBOOKS or any(re.match(r"xl/|content\.xml", n) for n in names):
            return workbook
        if names and all(name.endswith(".npy") for name in names):
            return f"{self} is an archive of arrays: save the one of the heights as .npy"
        # Instruments write archives, too.
        if suffix == ".zip" or (names and all(n.endswith((".csv", ".txt")) for n in names)):
            return f"{self} is an archive (zip): unpack it first (unzip {shlex.quote(str(self))})"
        return None


def source_of(given: Any) -> Source:
    """Return the source of a path, or of a stream, read to its end (TypeError)."""
    if isinstance(given, str | os.PathLike):
        return Source(str(checks.path("source", given)))
    if not hasattr(given, "read"):
        raise TypeError(
            f"source is {checks.shown(given)}: it must be a path, an open file or other stream, an "
            "array or list of heights (or of positions and heights), or a pandas DataFrame or "
            "Series"
        )
    content = given.read()
    name = getattr(given, "name", None)
    return Source(
        name if isinstance(name, str) else "the stream",
        content.encode() if isinstance(content, str) else bytes(content),
    )
