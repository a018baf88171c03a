"""Which tests of `make test` run in one process, one after another, and which begin first.

A module's tests stay together, in order: what they share is made once, and none of them can depend
on what another process does. Modules that start ranks or jobs stay together, too, or these would
crowd each other out, and those that load what takes seconds. What takes ten seconds begins first.
"""

from typing import Any

TOGETHER = {
    "ranks": ("test_mpi.py", "test_two_nodes.py", "test_slurm.py", "test_doctor.py"),
    # which load SurfaceTopography
    "readers": ("test_heights.py", "test_trace_instruments.py", "test_trace_field_texts.py"),
}
LONG = (
    *("ranks", "test_hostile.py", "test_kinetics.py", "test_docs.py", "test_report.py"),
    *("test_precision.py", "test_notebook.py", "test_run.py", "test_symmetry.py", "test_damage.py"),
    *("test_merge.py", "test_store.py", "test_preload.py", "test_extremes.py", "test_grid.py"),
    *("test_limits.py", "test_report_axes.py", "readers", "test_staging.py", "test_every_claim"),
)


def group_of(nodeid: str) -> str:
    path, _, name = nodeid.partition("::")
    module = path.rpartition("/")[2]
    for group, modules in TOGETHER.items():
        if module in modules:
            return group
    # each whole validation is as long as many a module
    return name if name.startswith("test_every_claim") else path


def rank_of(nodeid: str) -> int:
    """Return when a test begins, its group before others."""
    group = group_of(nodeid)
    return next((i for i, name in enumerate(LONG) if name in group), len(LONG))


def scheduler(config: Any, log: Any) -> Any:
    from xdist.scheduler import LoadScopeScheduling

    class Groups(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    return Groups(config, log)
