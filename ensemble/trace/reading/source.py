"""Refuse files that have to be unpacked or exported: archives, workbooks, pictures."""

from __future__ import annotations

from pathlib import Path

from adhesis.ensemble.errors import InputError

# By their first bytes: name of the format, and program that unpacks it.
_COMPRESSED = {
    b"\x1f\x8b": ("gzip", "gunzip"),
    b"BZh": ("bzip2", "bunzip2"),
    b"\xfd7zXZ\0": ("xz", "unxz"),
    b"\x28\xb5\x2f\xfd": ("zstd", "unzstd"),
    b"7z\xbc\xaf\x27\x1c": ("7z", "7z x"),
    b"Rar!": ("rar", "unrar x"),
}
_DOCUMENTS = {
    b"%PDF": "a PDF",
    b"\x89PNG": "a picture (PNG)",
    b"\xff\xd8\xff": "a picture (JPEG)",
    b"GIF8": "a picture (GIF)",
}
_ZIP, _COMPOUND = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
_WORKBOOKS = frozenset((".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"))
_BEGIN = 4096


def beginning(path: Path) -> bytes:
    """Return the first bytes of a file of measurements.

    Raises
    ------
    InputError
        If it is missing, no regular file, unreadable, empty, or has to be unpacked or exported
        first.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path} is a directory: a trace is a file")
        if not path.exists():
            raise InputError(f"cannot read {path}: there is no such file")
        if not path.is_file():
            raise InputError(f"{path} is a pipe or a device: write its content to a file first")
        with path.open("rb") as stream:
            begin = stream.read(_BEGIN)
    except InputError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read {path}: {reason}") from None
    if not begin.strip():
        raise InputError(f"{path} is empty")
    _refuse(path, begin)
    return begin


def _refuse(path: Path, begin: bytes) -> None:
    for magic, (name, program) in _COMPRESSED.items():
        if begin.startswith(magic):
            raise InputError(f"{path} is compressed ({name}): unpack it first ({program} {path})")
    for magic, name in _DOCUMENTS.items():
        if begin.startswith(magic):
            raise InputError(f"{path} is {name}: export the heights as text")


def container(path: Path) -> str | None:
    """Return a message for a workbook or an archive that is no instrument's file, else None."""
    with path.open("rb") as stream:
        begin = stream.read(_BEGIN)
    suffix = path.suffix.lower()
    if begin.startswith((_ZIP, _COMPOUND)) and suffix in _WORKBOOKS:
        return f"{path} is a workbook: save its columns as text (CSV)"
    if begin.startswith(_ZIP) and suffix == ".npz":
        return f"{path} is an archive of arrays: save the one of the heights as .npy"
    if begin.startswith(_ZIP) and suffix == ".zip":
        return f"{path} is an archive (zip): unpack it first (unzip {path})"
    return None
