"""Use MPI: messages, an honest count of ranks, no rank left waiting.

The only module of a run that imports mpi4py, and only inside its functions: one process runs where
there is no MPI (:mod:`adhesis.ensemble.doctor.examine`, in processes of its own, tries MPI out).
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from adhesis.ensemble.errors import InputError, RankError

T = TypeVar("T")

_TAG, _URGENT_TAG = 1, 2
_PAUSE = 2e-3  # s

# Variables in which launchers give the number of processes and the rank; the first set one counts.
# Slurm's SLURM_NTASKS is not among them: a batch script has it too, outside any launcher.
_LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK", "Open MPI's mpirun"),
    ("PMI_SIZE", "PMI_RANK", "MPICH's mpirun"),
    ("MV2_COMM_WORLD_SIZE", "MV2_COMM_WORLD_RANK", "MVAPICH's mpirun"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID", "srun"),
)
# A process in whose environment none of these stands was started by itself: MPI is left alone,
# which saves a second and, on some login nodes, the process. Ranks of a launcher that is unknown
# here are kept apart by the lock of the results file.
_HINTS = (
    *("OMPI_COMM_WORLD_", "PMIX_", "PMI_", "PMI1_", "PMI2_", "MPI_LOCAL", "MPIRUN_", "MPIEXEC_"),
    *("MV2_", "HYDI_", "I_MPI_HYDRA", "PALS_", "ALPS_", "JSM_", "FLUX_TASK", "PJM_"),
    *("PSP_", "SLURM_STEP_NUM_TASKS"),
)
_SETTING = "_MCA_"  # in the names of settings, which users make for launchers


class OneRank:
    """Communicator of a process that is alone: there is nobody to talk to."""

    rank, size = 0, 1


def launched() -> tuple[int, int, str]:
    """Return (number of processes, this one's place, launcher) from the launcher's variables.

    (1, 0, "") without a launcher.
    """
    for size, rank, name in _LAUNCHERS:
        try:
            return int(os.environ[size]), int(os.environ.get(rank, "0")), name
        except (KeyError, ValueError):
            continue
    return 1, 0, ""


def world() -> Any:
    """Return COMM_WORLD, or :class:`OneRank` if this process is alone.

    InputError if a launcher started several processes and MPI sees one: two MPIs are mixed.
    """
    size, _, launcher = launched()
    hints = (name for name in os.environ if name.startswith(_HINTS) and _SETTING not in name)
    if "mpi4py.MPI" not in sys.modules and not any(hints):
        return OneRank()
    try:
        import mpi4py

        # matched probes, the default, fail on some networks; too late if MPI is loaded already
        mpi4py.rc.recv_mprobe = False
        from mpi4py import MPI
    except (ImportError, RuntimeError, OSError) as error:
        if size > 1:
            why = f"mpi4py cannot be used here: {error}"
            raise RankError(f"{launcher} started {size} processes, but {why}") from error
        return OneRank()
    comm = MPI.COMM_WORLD
    if size > 1 and comm.size == 1:
        library = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\x00 ")
        raise InputError(
            f"{launcher} started {size} processes, but MPI ({library}) sees only one in each: "
            "the launcher belongs to another MPI than mpi4py; use the mpirun of that one"
        )
    return comm if comm.size > 1 else OneRank()


def together(comm: Any, function: Callable[[], T]) -> T:
    """Run a function on rank 0 and return its value, or raise its InputError, on every rank."""
    if comm.size == 1:
        return function()
    answer: tuple[bool, Any] | None = None
    if comm.rank == 0:
        try:
            answer = (True, function())
        except InputError as error:
            answer = (False, str(error))
    wait_for_all(comm)
    good, value = comm.bcast(answer)
    if not good:
        raise InputError(value)
    result: T = value
    return result


def wait_for_all(comm: Any, seconds: float = math.inf) -> bool:
    """Return when every rank has come here; a rank that waits in a barrier would burn a core.

    False if some have not come within so many seconds.
    """
    arrived, end = comm.Ibarrier(), time.monotonic() + seconds
    while not arrived.Test():
        if time.monotonic() > end:
            return False
        time.sleep(_PAUSE)
    return True


class MpiChannel:
    """:class:`adhesis.ensemble.run.dispatch.Channel` over MPI.

    One thread a rank, so that nobody else can take a message that was probed.
    """

    def __init__(self, comm: Any) -> None:
        from mpi4py import MPI

        self._mpi = MPI
        self._comm = comm.Dup()
        self.rank: int = comm.rank
        self.workers: Sequence[int] = range(1, comm.size)

    def send(self, to: int, message: tuple[Any, ...], *, urgent: bool = False) -> None:
        """Send a message to a rank."""
        self._comm.send(message, dest=to, tag=_URGENT_TAG if urgent else _TAG)

    def poll(self, *, urgent: bool = False) -> tuple[int, tuple[Any, ...]] | None:
        """Return the next message and who sent it, or None."""
        status = self._mpi.Status()
        tag = _URGENT_TAG if urgent else _TAG
        if not self._comm.iprobe(source=self._mpi.ANY_SOURCE, tag=tag, status=status):
            return None
        source = status.Get_source()
        return source, self._comm.recv(source=source, tag=tag)
