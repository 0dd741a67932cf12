"""Ctrl-C ends every call that may take long, and processes and threads of a user's own do not hinder it."""

import multiprocessing
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import painleve
import pytest

SHORT_STUDY = dict(mu=[0.5, 0.6], v_belt="-0.4", initial="a", transient_s=0.1, record_s=0.1)

# Calls that take much longer than the patience of these tests, with the time at which they are interrupted.
LONG_CALLS = {
    "run": 'painleve.run("edge", {"run.duration_s": 3000})',
    "study": 'painleve.study("robustness", runs=3000)',
    "study-of-long-rows": 'painleve.study("bifurcation", mu=0.6, v_belt="-0.4", initial="a", transient_s=1e5, record_s=1)',
    "step": "plant.step(0.0, 0.0)",
    "advance": "simulation.sample(); simulation.advance(None)",
}
# An arm so light and damped that a tick takes a second or more, and ends as too stiff.
STIFF = {
    "run.tick_hz": 10,
    "controller.estimator.bandwidth_rad_s": 10,
    "arm.damping_nms_rad": [1e3, 1e3],
    "arm.link_mass_kg": [1e-3, 1e-3],
}
PROGRAM = """
import os, signal, painleve
# A shell starts commands in the background with the signal ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
STIFF = {stiff!r}
plant, simulation = painleve.Plant("open-loop-bounce", STIFF), painleve.Simulation("open-loop-bounce", STIFF)
os.write(1, b"x")
try:
    while True:
        {call}
except KeyboardInterrupt:
    os.write(1, b"interrupted")
"""


@pytest.mark.parametrize("call", LONG_CALLS)
def test_ctrl_c_ends_a_long_call(call):
    program = PROGRAM.format(stiff=STIFF, call=LONG_CALLS[call])
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        assert child.stdout.read(1) == b"x"
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        start_s = time.monotonic()
        try:
            rest, errors = child.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            child.kill()
            raise
        took_s = time.monotonic() - start_s
    assert (rest, errors) == (b"interrupted", b"")
    # 0.2 s and the end of the interpreter.
    assert took_s < 1.0


def test_an_interrupted_plant_says_so():
    """A signal that raises in the middle of a step leaves a plant that refuses to go on."""
    plant = painleve.Plant("open-loop-bounce", STIFF)

    def raise_it(*_):
        raise KeyError("alarm")

    before = signal.signal(signal.SIGALRM, raise_it)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyError, match="alarm"):
            while True:
                plant.step(0.0, 0.0)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    with pytest.raises(RuntimeError, match="create the object again"):
        plant.step(0.0, 0.0)


def test_a_study_ends_soon_after_an_interrupt():
    """The rows that have not begun are not computed: the processor time of an interrupted study stays."""
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            painleve.study("robustness", runs=100_000)
    finally:
        signal.signal(signal.SIGALRM, before)
    time.sleep(1.0)
    start_s = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - start_s < 0.1


def short_calls():
    painleve.study("bifurcation", **SHORT_STUDY)
    painleve.run("edge", {"run.duration_s": 0.1})
    painleve.Plant("edge").step(0.0, 0.0)


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_a_child_process_computes_after_its_parent_has(method):
    short_calls()
    children = [multiprocessing.get_context(method).Process(target=short_calls) for _ in range(3)]
    for child in children:
        child.start()
    for child in children:
        child.join(20.0)
        if child.is_alive():
            child.kill()
    assert [child.exitcode for child in children] == [0, 0, 0]


def test_a_child_that_is_forked_during_a_study_computes():
    study = threading.Thread(target=painleve.study, args=("robustness",), kwargs=dict(runs=40))
    study.start()
    test_a_child_process_computes_after_its_parent_has("fork")
    study.join()


def test_objects_work_on_other_threads_one_at_a_time():
    plant, simulation, controller = painleve.Plant("edge"), painleve.Simulation("edge"), painleve.Controller("edge")

    def tick():
        sensor, _ = simulation.sample()
        simulation.advance(controller.tick(sensor))
        return plant.step(0.0, 0.0)["time_s"], simulation.state()["time_s"]

    with ThreadPoolExecutor(1) as pool:
        assert [pool.submit(tick).result() for _ in range(3)] == [(0.001, 0.001), (0.002, 0.002), (0.003, 0.003)]
    assert tick() == (0.004, 0.004)
    # Dropped on a thread that has not made it.
    objects = [plant, simulation, controller]
    del plant, simulation, controller, tick
    thread = threading.Thread(target=objects.clear)
    thread.start()
    thread.join()


def stiff_step(plant):
    with pytest.raises(RuntimeError, match="too stiff"):
        plant.step(0.0, 0.0)


def stiff_advance(simulation):
    with pytest.raises(RuntimeError, match="too stiff"):
        simulation.sample()
        simulation.advance(None)


def test_an_object_in_use_on_another_thread_says_what_to_do():
    plant, simulation = painleve.Plant("open-loop-bounce", STIFF), painleve.Simulation("open-loop-bounce", STIFF)
    calls = [
        (stiff_step, plant, [plant.state, lambda: plant.step(0.0, 0.0), lambda: plant.tick_hz]),
        (stiff_advance, simulation, [simulation.state, simulation.sample, lambda: simulation.advance(None)]),
    ]
    for call, used, others in calls:
        with ThreadPoolExecutor(1) as pool:
            step = pool.submit(call, used)
            time.sleep(0.2)
            for other in others:
                name = type(used).__name__.lower()
                with pytest.raises(RuntimeError, match=f"another call is using this {name}.*; give each thread its own"):
                    other()
            step.result()
        assert used.state()["time_s"] < 0.1


def test_other_threads_run_during_a_long_call():
    done = threading.Event()

    def times():
        ticks = []
        while not done.wait(0.01):
            ticks.append(time.monotonic())
        return ticks

    with ThreadPoolExecutor(1) as pool:
        clock = pool.submit(times)
        try:
            stiff_step(painleve.Plant("open-loop-bounce", STIFF))
        finally:
            done.set()
    ticks = clock.result()
    assert len(ticks) > 10 and max(after - before for before, after in zip(ticks, ticks[1:])) < 0.3
