"""Starting ranks from within a program: which ``mpirun``, how many cores, which environment."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

# What a launcher tells its ranks. A program that passes it on to a launcher of its own is taken
# for one of those ranks, and both wait for each other or end without a word.
_RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE")
_LAUNCHER_PREFIXES = ("OMPI_", "OPAL_", "ORTE_", "PRTE_", "PMIX_", "PMI_", "HYDI_", "HYDRA_")


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def launcher() -> str | None:
    """Find this installation's ``mpirun``: ``$MPIRUN``, set-up's choice, or the one in PATH."""
    recorded = Path(sys.prefix, "mpirun")
    beside = str(Path(sys.executable).parent)
    candidates = [os.environ.get("MPIRUN", "")]
    if recorded.is_file():
        candidates.append(recorded.read_text().strip())
    for name in filter(None, candidates):
        found = shutil.which(name)
        if found:
            return found
    for name in ("mpirun", "mpiexec"):
        found = shutil.which(name, path=beside) or shutil.which(name)
        if found:
            return found
    return None


def launch_environment(ranks: int) -> dict[str, str]:
    """Environment in which a launcher starts ``ranks`` ranks here, also from within a rank.

    As root, or for more ranks than cores, Open MPI must be told that this is meant.
    """
    # A copy of os.environ already lacks what an MPI in this process has put into C's environment.
    nested = any(mark in os.environ for mark in _RANK_MARKS)
    env = {
        name: value
        for name, value in os.environ.items()
        if not (nested and name.startswith(_LAUNCHER_PREFIXES))
    }
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        for prefix in ("OMPI", "PRTE"):
            env[f"{prefix}_ALLOW_RUN_AS_ROOT"] = "1"
            env[f"{prefix}_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    if ranks > cores():
        env["OMPI_MCA_rmaps_base_oversubscribe"] = "1"
        env["OMPI_MCA_hwloc_base_binding_policy"] = "none"
        env["PRTE_MCA_rmaps_default_mapping_policy"] = ":oversubscribe"
        env["PRTE_MCA_hwloc_default_binding_policy"] = "none"
    return env
