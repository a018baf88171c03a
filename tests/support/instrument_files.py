"""Small synthetic files of instruments, one writer a format, of the same equally spaced heights.

Each takes a path, the step in m and the heights in m (NaN where the format can say so). What each
makes of the length is the format's own convention: Dektak's extent is n - 1 steps, SDF, SUR and X3P
tell the step, Igor the step, Mitutoyo positions from one step on, Mahr every position.
"""

import struct
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dektak(path: Path, step: float, heights: Array) -> None:
    """Bruker Dektak OPDx, a surface profile; heights in nm, positions in µm."""

    def name(text: str) -> bytes:
        return struct.pack("<I", len(text.encode())) + text.encode()

    def sized(content: bytes) -> bytes:
        return b"\x04" + struct.pack("<I", len(content)) + content

    def text(key: str, value: str) -> bytes:
        return name(key) + b"\x12" + sized(value.encode())

    def quantity(key: str, value: float, unit: str, symbol: str) -> bytes:
        return name(key) + b"\x13" + sized(struct.pack("<d", value) + name(unit) + name(symbol))

    def strings(key: str, values: list[str]) -> bytes:
        return name(key) + b"\x42" + name("List") + sized(b"".join(map(name, values)))

    def container(key: str, content: bytes) -> bytes:
        return name(key) + b"\x7d" + sized(content + name("") + b"\x7f" + b"\xff\xff")

    n = heights.size
    array = b"\0" * 5 + (heights * 1e9).astype("<f8").tobytes()
    scan = (
        text("DataKind", "Raw")
        + name("NumPoints")
        + b"\x07"
        + struct.pack("<I", n)
        + quantity("Extent", (n - 1) * step * 1e6, "Micrometer", "µm")
        + quantity("DataScale", 1.0, "Nanometer", "nm")
        + name("Array")
        + b"\x40"
        + name("Double")
        + sized(array)
    )
    meta = text("DataKind", "Surface Profile") + container(
        "1D_Channels", strings("Height", ["Raw"])
    )
    path.write_bytes(
        b"VCA DATA\x01\x00\x00\x55"
        + container("MetaData", meta)
        + container("1D_Data", container("Raw", scan))
        + name("")
        + b"\x7f"
    )


def mahr(path: Path, step: float, heights: Array, tip_radius: float = 2e-6) -> None:
    """Mahr MarWin QEP: a zipped profile in mm, each point with its position and a flag."""
    n = heights.size
    strings = [f">ProbeRadius={tip_radius * 1e3!r}", ">MachineName=Test"]
    head = bytearray(0xC4)
    head[:8] = b"[p3dlin]"
    struct.pack_into("<i", head, 0x14, n)
    table = struct.pack("<i", len(strings)) + b"".join(
        struct.pack("<i", len(s)) + s.encode("latin-1") for s in strings
    )
    x = 1.5 + 1e3 * step * np.arange(n)
    flags = np.isnan(heights).astype("<f4")
    z = np.nan_to_num(1e3 * heights)
    data = x.tobytes() + np.zeros(n).tobytes() + z.tobytes() + flags.tobytes()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "Kontur1.prf", bytes(head) + table + b"[sellsg]" + b"[Trajec]" + b"\0" * 41 + data
        )


def mitutoyo(path: Path, step: float, heights: Array) -> None:
    """Mitutoyo SurfTest spreadsheet: positions in mm from one step on, heights in µm."""
    import openpyxl

    book = openpyxl.Workbook()
    data = book.active
    data.title = "DATA"
    data["A1"] = "Ra 0.5 µm"
    for k, z in enumerate(heights):
        data.cell(k + 1, 5, float(1e3 * step * (k + 1)))
        data.cell(k + 1, 6, float(1e6 * z))
    certificate = book.create_sheet("Certificate")
    certificate["E2"] = "01-Mar-2024"
    certificate["E48"] = "0.8mm"
    book.save(path)


def igor(path: Path, step: float, heights: Array) -> None:
    """Igor binary wave, version 5, one dimension, in m."""
    data = heights.astype("<f8").tobytes()
    wave = bytearray(320)
    struct.pack_into("<i", wave, 12, heights.size)  # npnts
    struct.pack_into("<h", wave, 16, 4)  # type: 64-bit floats
    wave[28:34] = b"height"
    struct.pack_into("<4i", wave, 68, heights.size, 0, 0, 0)
    struct.pack_into("<4d", wave, 84, step, 1.0, 1.0, 1.0)
    wave[148:149] = b"m"  # data units
    wave[152:153] = b"m"  # dimension units
    head = struct.pack("<hHi", 5, 0, len(wave) + len(data)) + b"\0" * 56
    check = int(-np.frombuffer(head + wave, "<i2").astype(np.int64).sum()) & 0xFFFF
    path.write_bytes(head[:2] + struct.pack("<H", check) + head[4:] + wave + data)


def netcdf(path: Path, step: float, heights: Array) -> None:
    """SurfaceTopography's own netCDF, a uniform line scan in µm."""
    from SurfaceTopography import UniformLineScan

    n = heights.size
    UniformLineScan(1e6 * heights, 1e6 * n * step, unit="µm").to_netcdf(str(path))


def x3p(path: Path, step: float, heights: Array) -> None:
    """ISO 25178-72, a map of one row."""
    from SurfaceTopography import Topography

    n = heights.size
    rows = np.ma.masked_invalid(heights.reshape(n, 1))
    Topography(rows, (n * step, step), unit="m").to_x3p(str(path))


def sdf(path: Path, step: float, heights: Array, rows: int = 1) -> None:
    """ISO 25178-71, binary, 64-bit numbers; every row the same heights."""
    head = b"bISO-1.0" + b"test".ljust(10) + b"010320241030" * 2
    head += struct.pack("<HH4dBBB", heights.size, rows, step, step, 1.0, -1.0, 0, 7, 0)
    path.write_bytes(head + np.tile(heights, (rows, 1)).astype("<f8").tobytes())


def sur(path: Path, step: float, heights: Array) -> None:
    """Digital Surf, a map of one row: whole numbers of 0.1 nm, gaps two below the least."""
    raw = np.nan_to_num(np.round(heights / 1e-10)).astype("<i4")
    least, most = int(raw.min()), int(raw.max())
    raw[np.isnan(heights)] = least - 2
    unit = [b"mm", b"mm", b"um", b"mm", b"mm", b"um"]
    head = struct.pack(
        "<12s4H30s30s5H8xHiiiiIfff",
        *(b"DIGITAL SURF", 0, 1, 256, 2, b"test", b"test", 0, 0, 0, 1, 0, 32, least, most),
        *(heights.size, 1, heights.size, 1e3 * step, 1e3 * step, 1e-4),
    )
    head += struct.pack("<3s13x3s13x3s13x", b"X", b"Y", b"Z")
    head += b"".join(u.ljust(16, b"\0") for u in unit)
    head += struct.pack("<3f", 1.0, 1.0, 1.0) + struct.pack("<3H", 0, 0, 0) + b"\0" * 12
    head += struct.pack("<7H", 0, 0, 10, 1, 3, 2024, 0) + struct.pack("<f", 0.0) + b"\0" * 10
    head += struct.pack("<2H", 0, 0) + b"\0" * 128 + struct.pack("<3f", 0, 0, 0) + b"\0" * 34
    path.write_bytes(head + raw.tobytes())


WRITERS = {
    "dektak.OPDx": dektak,
    "mahr.qep": mahr,
    "mitutoyo.xlsx": mitutoyo,
    "igor.ibw": igor,
    "topography.nc": netcdf,
    "row.x3p": x3p,
    "row.sdf": sdf,
    "row.sur": sur,
}
