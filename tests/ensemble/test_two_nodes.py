"""Two nodes on one machine: network namespaces with host names of their own, TCP between them.

What a cluster has and one machine lacks is tried for real: ranks that reach each other through a
network only, and a whole node that dies. Needs root, namespaces and Open MPI; nothing of this
machine's own network is touched, and the namespaces are removed afterwards.
"""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from adhesis.ensemble.results.read import Results
from tests.support.campaign_support import (
    MPIRUN,
    adhesis_here,
    command,
    differences,
    done_rows,
    started,
    wait_until,
    write_campaign,
)
from tests.support.processes import executable, ran

pytestmark = pytest.mark.mpi
NETWORK = "10.77.0.0/24"
NAMES, ADDRESSES = ("nodea", "nodeb"), ("10.77.0.1", "10.77.0.2")


def missing() -> str:
    lacking = [name for name in ("ip", "unshare", "mount", MPIRUN) if shutil.which(name) is None]
    if lacking:
        return f"no {', '.join(lacking)} here"
    if os.geteuid() != 0:
        return "only root may make network namespaces"
    reported = ran(MPIRUN, "--version").stdout
    return "" if "Open MPI) 4" in reported else "the options are those of Open MPI 4"


@dataclass
class Nodes:
    """Two namespaces, and what starts ranks in both."""

    spaces: tuple[str, str]
    folder: Path

    def launch(self, *words: object, fake: str) -> subprocess.Popen[str]:
        options = {
            "plm": "rsh",
            "plm_rsh_agent": str(self.folder / "agent"),
            "btl": "self,vader,tcp",
            "btl_tcp_if_include": NETWORK,
            "oob_tcp_if_include": NETWORK,
        }
        mca = [word for name, value in options.items() for word in ("--mca", name, value)]
        start = [MPIRUN, "--allow-run-as-root", *mca, "--host", "nodea:2,nodeb:2", "-n", "4"]
        program = command(words, ranks=4, fake=fake)[3:]  # without the launcher
        enter = 'mount --bind "$0" /etc/hosts && hostname nodea && exec "$@"'
        unshare = ["unshare", "--uts", "--ipc", "--mount", "bash", "-c", enter]
        inside = ["ip", "netns", "exec", self.spaces[0], *unshare, str(self.folder / "hosts")]
        return started([*inside, *start, *program])

    def kill(self, node: int) -> None:
        for pid in ran("ip", "netns", "pids", self.spaces[node], check=True).stdout.split():
            os.kill(int(pid), signal.SIGKILL)


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[Nodes]:
    if reason := missing():
        pytest.skip(reason)
    spaces = tuple(f"adhesis-{name}-{os.getpid()}" for name in NAMES)
    (tmp_path / "hosts").write_text(
        "127.0.0.1 localhost\n"
        + "".join(f"{a} {n}\n" for a, n in zip(ADDRESSES, NAMES, strict=True))
    )
    executable(
        tmp_path / "agent",
        "#!/bin/bash\nhost=$1\nshift\n"
        f'exec ip netns exec "adhesis-$host-{os.getpid()}" unshare --uts --ipc --mount bash -c '
        f'\'mount --bind {tmp_path}/hosts /etc/hosts && hostname "$0" && exec bash -c "$1"\' '
        '"$host" "$*"\n',
    )
    links = tuple(f"adh{os.getpid() % 100000}{end}" for end in "ab")
    steps = [f"ip netns add {space}" for space in spaces]
    steps.append(f"ip link add {links[0]} type veth peer name {links[1]}")
    for space, link, address in zip(spaces, links, ADDRESSES, strict=True):
        inside = f"ip -n {space}"
        steps += [
            f"ip link set {link} netns {space}",
            f"{inside} addr add {address}/24 dev {link}",
            f"{inside} link set {link} up",
            f"{inside} link set lo up",
        ]
    try:
        for step in steps:
            done = ran(*step.split())
            if done.returncode:
                pytest.skip(f"no network namespaces here: {step}: {done.stderr.strip()}")
        yield Nodes((spaces[0], spaces[1]), tmp_path)
    finally:
        for space in spaces:
            ran("ip", "netns", "del", space)


def test_a_campaign_runs_over_two_nodes_and_outlives_one(nodes: Nodes, tmp_path: Path) -> None:
    path, out, whole = write_campaign(tmp_path), tmp_path / "r.h5", tmp_path / "whole.h5"
    assert adhesis_here("run", path, "--out", whole, fake="").returncode == 0
    process = nodes.launch("run", path, "--out", out, fake="hold=1")
    wait_until(lambda: done_rows(out) >= 2 or process.poll() is not None)
    assert process.poll() is None, process.communicate()[1]
    nodes.kill(1)
    process.communicate(timeout=150)
    assert process.returncode not in (0, 1, 2, 75)
    kept, log = done_rows(out), tmp_path / "log"
    assert 2 <= kept <= 3  # one of each worker
    process = nodes.launch("run", path, "--out", out, fake=f"step=0.05 log={log}")
    _, errors = process.communicate(timeout=150)
    assert process.returncode == 0, errors
    assert len(log.read_text().splitlines()) == 8 - kept
    assert differences(out, whole) == []
    with Results(out) as results:
        ranks = set(results.column("rank").tolist())
    assert 1 in ranks  # beside rank 0 on the first node
    assert ranks & {2, 3}  # on the second one
