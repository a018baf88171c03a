"""What the handler of a signal raises arrives as it is, wherever the signal comes."""

import signal
import threading
import time

import numpy as np
import pytest

from adhesis import Method, Problem, make_method, run_loop
from adhesis.solver._kernels import set_up_response
from adhesis.solver.runtime.uninterrupted import uninterrupted
from adhesis.solver.sharp.method import SharpMethod
from tests.support.scenes import HALF_SPACE, of_paper, rough
from tools.interrupted import Interrupt, interrupted

INTERRUPTS = 8  # of each method


@pytest.fixture(scope="module", params=["sharp", "grid"])
def chosen(request: pytest.FixtureRequest) -> Method:
    """A method for all loops of the test, each as it comes after another one."""
    if request.param == "grid":
        few = Problem(rough(1, 4, 3, period=1e-3), HALF_SPACE, 0.04)
        return make_method("grid", few, nodes_per_wave=8)
    return make_method("sharp", Problem(of_paper(1, ratio=4), HALF_SPACE, 0.04))


def loss(chosen: Method) -> tuple[str, str]:
    loop = run_loop(chosen, max_penetration=0.8, load_steps=4)
    return loop.loss.hex(), loop.mean_stress.tobytes().hex()


def test_a_signal_that_comes_in_a_long_kernel_ends_it(alarm):
    """A descent of many gaps takes seconds; its handler is called between two steps."""
    edges = SharpMethod(Problem(of_paper(1), HALF_SPACE, 0.01)).edges
    ends = np.linspace(0.1, 6.2, 800).reshape(-1, 2)
    response = set_up_response(ends, 1e-3, edges.law, edges.model)
    ended = threading.Event()

    def descend() -> None:
        while not ended.is_set():
            response.descend(ends, ends, 1e-3, 100_000, False, edges.law, edges.model)

    signal.setitimer(signal.ITIMER_REAL, 0.3)
    started = time.perf_counter()
    with pytest.raises(Interrupt):
        descend()
    assert time.perf_counter() - started < 60


def test_a_loop_that_is_interrupted_anywhere_ends_in_what_was_raised(chosen):
    """Or it is done; and the same method gives the same bits afterwards."""
    expected = loss(chosen)
    started = time.perf_counter()
    loss(chosen)
    taken = time.perf_counter() - started
    rng = np.random.default_rng(1)
    ended = [interrupted(lambda: loss(chosen), t) for t in rng.uniform(0, taken, INTERRUPTS)]
    assert set(ended) <= {"raised", "done"}
    assert loss(chosen) == expected


def test_an_interrupt_that_meets_the_start_of_a_thread_arrives_as_itself(monkeypatch):
    """A signal may reach another thread, and its handler then runs though signals are held."""
    name = next(n for n in ("_start_joinable_thread", "_start_new_thread") if hasattr(threading, n))
    start = getattr(threading, name)

    def interrupted_start(*args, **options):
        start(*args, **options)
        while any(not thread.is_alive() for thread in threading.enumerate()):
            time.sleep(1e-3)  # until the thread has struck itself off those that begin
        raise Interrupt

    monkeypatch.setattr(threading, name, interrupted_start)
    with pytest.raises(Interrupt):
        uninterrupted(lambda: time.sleep(0.2))()
