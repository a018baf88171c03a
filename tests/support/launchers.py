"""What starts ranks and jobs here, and why it cannot where it cannot."""

import os
import shutil

MPIRUN = os.environ.get("MPIRUN") or "mpirun"
SLURM = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "squeue")
# Daemons live where an ordinary user's PATH does not look.
PATH = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])


def without_mpi() -> str:
    """Return why ranks cannot be started here, or nothing."""
    return "" if shutil.which(MPIRUN) else f"there is no {MPIRUN} here"


def without_slurm() -> str:
    """Return why no Slurm can be started here, or nothing."""
    missing = [name for name in SLURM if shutil.which(name, path=PATH) is None]
    if missing:
        return (
            f"no Slurm here: {', '.join(missing)} not found (Debian, as root: make test installs "
            "slurmctld slurmd slurm-client munge)"
        )
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        return "only root can start a slurmd of its own"
    return ""
