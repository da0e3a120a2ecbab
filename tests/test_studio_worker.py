"""Processes that compute for the studio: what they answer, and how they end."""

import asyncio
import os
import resource
import signal
import time
from pathlib import Path

import psutil
import pytest
from mpi4py import MPI

from carillon.errors import UserError
from carillon.processes.memory import FIRST_TO_GO, memory_bytes
from studio.processes.worker import Worker
from tests.listening import listening
from tests.patience import HANG_SECONDS, wait_for

BENCH = "tests.test_studio_worker:Bench"


class Bench:
    """Something to call in another process."""

    def __init__(self):
        self.count = 0

    def add(self, number):
        self.count += number
        return self.count

    def fail(self, *sentences):
        raise UserError(*sentences)

    def go_wrong(self):
        return {}["what"]

    def sleep(self, seconds):
        time.sleep(seconds)

    def work(self):
        while True:
            pass

    def tell_on(self, tell, count):
        for number in range(count):
            tell(number)
        return "told"

    def pid(self):
        return os.getpid()

    def limits(self):
        return resource.getrlimit(resource.RLIMIT_DATA)[0], Path(
            "/proc/self/oom_score_adj"
        ).read_text()

    def directory(self):
        return MPI.Is_initialized(), os.environ["OMPI_MCA_orte_top_session_dir"]

    def listening(self):
        return MPI.Is_initialized(), listening([psutil.Process()])


@pytest.fixture
def worker():
    made = Worker(BENCH)
    yield made
    made.end()


async def test_a_process_listens_on_no_network(worker):
    assert await worker.call("listening") == (True, [])


async def test_calls_are_answered_in_order_by_one_object(worker):
    assert await asyncio.gather(*(worker.call("add", number) for number in (1, 2, 3))) == [1, 3, 6]


async def test_a_worker_spares_the_memory_of_its_machine(worker):
    limit, score = await worker.call("limits")
    assert limit > 2 * memory_bytes()  # infinite is -1
    assert int(score) >= FIRST_TO_GO


async def test_news_come_before_the_answer(worker):
    news = []
    assert await worker.call("tell_on", 5, tell=news.append) == "told"
    assert news == [0, 1, 2, 3, 4]


async def test_errors_are_the_same_sentences(worker):
    with pytest.raises(UserError) as caught:
        await worker.call("fail", "no file a", "no file b")
    assert caught.value.args == ("no file a", "no file b")
    with pytest.raises(UserError, match="fault of the program .KeyError") as caught:
        await worker.call("go_wrong")
    assert "\n" not in str(caught.value)
    assert await worker.call("add", 1) == 1


async def test_what_takes_too_long_is_ended_and_the_next_call_answered(worker):
    with pytest.raises(UserError, match="more than 0.1 s of processor time"):
        await worker.call("work", seconds=0.1)
    assert await worker.call("add", 1) == 1


async def test_a_process_that_does_not_get_to_work_is_waited_for(worker):
    pid = await worker.call("pid")
    os.kill(pid, signal.SIGSTOP)
    asking = asyncio.ensure_future(worker.call("add", 1, seconds=0.1))
    await asyncio.sleep(1.0)
    assert not asking.done()
    os.kill(pid, signal.SIGCONT)
    assert await asking == 1


async def test_who_is_told_to_end_does_so_even_as_the_answer_comes(worker):
    asking = asyncio.ensure_future(worker.call("add", 1, seconds=HANG_SECONDS))
    await asyncio.sleep(0)
    ((future, _),) = worker._waiting.values()
    future.set_result(2)
    asking.cancel()
    with pytest.raises(asyncio.CancelledError):
        await asking


async def test_a_process_that_is_killed_fails_what_waits_and_nothing_else(worker):
    waiting = asyncio.ensure_future(worker.call("sleep", HANG_SECONDS))
    await asyncio.sleep(0)
    os.kill(worker.pid, signal.SIGKILL)
    with pytest.raises(UserError, match="has ended"):
        await waiting
    assert await worker.call("add", 2) == 2


async def test_what_a_process_is_asked_that_has_just_ended_fails_likewise(worker):
    await worker.call("add", 1)
    process = psutil.Process(worker.pid)
    process.kill()
    wait_for(lambda: process.status() == psutil.STATUS_ZOMBIE, "a process to end")
    with pytest.raises(UserError, match="has ended"):
        await worker.call("add", 1)
    assert await worker.call("add", 2) == 2


async def test_a_process_that_is_ended_leaves_nothing_on_the_disk(worker):
    is_initialised, directory = await worker.call("directory")
    assert is_initialised and f".{worker.pid}." in directory
    Path(directory).mkdir(exist_ok=True)  # whichever MPI it is
    worker.end()
    assert not Path(directory).exists()


async def test_ctrl_c_is_for_the_server(worker):
    pid = await worker.call("pid")
    os.kill(pid, signal.SIGINT)
    assert await worker.call("pid") == pid
