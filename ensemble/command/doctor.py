"""Report which MPI, HDF5, FFTW and writer this installation uses, and why.

Exit code 1 if it is not usable.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import asdict
from pathlib import Path

from adhesis.ensemble.doctor.examine import Diagnosis, examine
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.exit_codes import DONE, SOME_FAILED

EXAMPLES = ("adhesis doctor", "adhesis doctor --in /scratch/me --json")


OPTIONS = (
    ("--json", bool, "the findings as JSON on stdout"),
    (
        *("--in DIR", Path),
        "try parallel writing in DIR, on the file system of the campaign (default: a temporary "
        "folder)",
        {"dest": "directory"},
    ),
)


def execute(args: argparse.Namespace) -> int:
    """Print what was found; 0 if campaigns can run here."""
    folder = args.directory
    if folder is not None and not (os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)):
        raise InputError(f"--in is {folder}: it must be a folder that can be written")
    diagnosis = examine(args.directory)
    if args.json:
        print(json.dumps({"usable": diagnosis.usable, **asdict(diagnosis)}, indent=2))
    else:
        print(_text(diagnosis))
    return DONE if diagnosis.usable else SOME_FAILED


def _text(diagnosis: Diagnosis) -> str:
    versions, mpirun = dict(diagnosis.versions), diagnosis.mpirun
    if mpirun and diagnosis.mpirun_version:
        mpirun += f" ({diagnosis.mpirun_version})"
    rows = [
        ("adhesis", f"{versions.pop('adhesis')}, Python {versions.pop('python')}"),
        ("MPI", f"{versions.pop('mpi')} (mpi4py {versions.pop('mpi4py')})"),
        ("mpirun", mpirun or "none"),
        ("HDF5", f"{versions.pop('hdf5')} (h5py {versions.pop('h5py')})"),
        ("FFTW", f"{versions.pop('fftw')} (pyfftw {versions.pop('pyfftw')})"),
        *versions.items(),
        ("cores", str(diagnosis.cores)),
        ("writer", f"{diagnosis.writer}: {diagnosis.why}"),
    ]
    found = [f"{name:<10}{text}" for name, text in rows]
    marks = (
        "ok  " if check.ok else "FAIL" if check.needed else "note" for check in diagnosis.checks
    )
    tried = [f"{m}  {c.name}: {c.text}" for m, c in zip(marks, diagnosis.checks, strict=True)]
    verdict = "usable" if diagnosis.usable else "not usable as it is: see FAIL above"
    return "\n".join([*found, "", *tried, "", verdict])
