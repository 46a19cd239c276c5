"""A function over processes: what comes back, what a death costs, and that nothing is left running."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from tasks import work

from identify.batch.processes import THREADS, Done, Step, over_processes


def alive(pid: int) -> bool:
    """Whether the process runs; one that has ended and waits for its parent to hear of it does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_every_task_has_a_process_and_a_death_costs_its_own_task_alone(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in THREADS:
        monkeypatch.delenv(name, raising=False)
    words = ["a", "die", "b", "exit", "raise", "c"]
    told = list(over_processes(work, [(word,) for word in words], 2))
    done = {each.index: each for each in told if isinstance(each, Done)}
    assert sorted(done) == list(range(6))
    returned = [str(done[i].result).split() for i in (0, 2, 5)]
    assert [(word, threads) for word, _, threads in returned] == [("a", "1"), ("b", "1"), ("c", "1")]
    assert len({pid for _, pid, _ in returned} | {str(os.getpid())}) == 4
    assert "SIGKILL" in done[1].death
    assert "status 7" in done[3].death
    assert "status 1" in done[4].death
    assert "ValueError: raise" in capfd.readouterr().err
    steps = [each for each in told if isinstance(each, Step)]
    assert {(step.index, step.share, step.text) for step in steps} >= {(0, 0.5, "a"), (5, 0.5, "c")}
    assert not set(THREADS) & set(os.environ)


def test_no_more_than_jobs_run_at_once_and_none_after_the_caller_has_gone() -> None:
    stream = over_processes(work, [("slow",)] * 5, 2)
    assert {next(stream).index, next(stream).index} == {0, 1}
    running = [process.pid for process in multiprocessing.active_children()]
    assert len(running) == 2
    stream.close()  # type: ignore[attr-defined]
    assert not any(alive(pid) for pid in running)


def test_a_parent_that_is_killed_leaves_no_process() -> None:
    here = Path(__file__).parent
    code = (
        f"import sys; sys.path.insert(0, {str(here)!r})\n"
        "from tasks import work\nfrom identify.batch.processes import over_processes\n"
        "if __name__ == '__main__':\n"
        "    for step in over_processes(work, [('slow',)] * 2, 2):\n"
        "        import multiprocessing\n"
        "        print(*(p.pid for p in multiprocessing.active_children()), flush=True)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    parent.stdout.readline()
    running = [int(word) for word in parent.stdout.readline().split()]
    assert len(running) == 2
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    patience = time.monotonic() + 20
    while any(alive(pid) for pid in running) and time.monotonic() < patience:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in running)
