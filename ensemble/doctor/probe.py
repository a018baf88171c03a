"""Test the libraries in a process or a rank that ``adhesis doctor`` starts, and report.

Run as ``python -m adhesis.ensemble.doctor.probe SCRATCH [together]``.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path
from typing import Any

from adhesis.ensemble.versions import installed, last_lines


def report(scratch: Path, together: bool) -> None:
    """Load the libraries, write a file together if one of several ranks, and write a report."""
    found: dict[str, Any] = {}
    comm: Any = None
    if together:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD
        found["size"] = comm.size
    else:
        # MPI is loaded but not initialised, which can hang if the network is misconfigured.
        found["mpi_loads"] = True
        try:
            import mpi4py

            mpi4py.rc.initialize = False
            importlib.import_module("mpi4py.MPI")
        except (ImportError, RuntimeError) as error:
            found["mpi_loads"] = False
            reason = last_lines(str(error))
    found["versions"] = installed()
    if found.get("mpi_loads") is False:
        found["versions"]["mpi"] = f"does not load: {reason}"
    parallel = False
    try:
        import h5py

        parallel = bool(h5py.get_config().mpi)
    except ImportError:
        pass  # installed() has the reason
    found["parallel_hdf5"] = parallel
    if comm is not None and comm.size > 1:
        found["mpio"] = (
            _write_together(scratch / "together.h5", comm) if parallel else "serial h5py"
        )
    (scratch / f"report-{os.getpid()}.json").write_text(json.dumps(found))


def _write_together(path: Path, comm: Any) -> str:
    """Create a file collectively and write one row a rank; return "ok" or the reason."""
    import h5py
    import numpy as np

    try:
        with h5py.File(path, "w", driver="mpio", comm=comm) as file:
            rows = file.create_dataset("rows", (comm.size, 1000), dtype="f8")
            with rows.collective:
                rows[comm.rank] = comm.rank
            file.flush()
            rows[comm.rank, 0] = comm.rank + 0.5
        comm.Barrier()
        with h5py.File(path, "r") as file:
            expected = np.repeat(np.arange(comm.size, dtype=float)[:, None], 1000, axis=1)
            expected[:, 0] += 0.5
            if not np.array_equal(file["rows"][()], expected):
                return "the file does not hold what was written"
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        return last_lines(str(error))
    return "ok"


if __name__ == "__main__":
    report(Path(sys.argv[1]), together=len(sys.argv) > 2)
