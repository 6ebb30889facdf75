"""An interrupted command ends with its code and one line, leaves no process and no part of a file, and keeps what was.

No time is asserted: how long it took is in docs/soundness.md, where ``python -m tests.interruption`` was run.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from interruption import COMMANDS, RESULTS, ROOT, TOKEN, Running, arguments_of, interrupted, marked, until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")

EXAMPLE = ROOT / "examples" / "first_order.toml"  # the quickest with a search in processes
SIGNALS = (signal.SIGINT, signal.SIGTERM)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from reports.command_line import main

    path = tmp_path_factory.mktemp("certificate") / "certificate.json"
    assert main(["gains", str(EXAMPLE), "-o", str(path)]) == 0
    return path


@pytest.mark.parametrize(
    ("number", "moment"), [(SIGNALS[0], 0.0), (SIGNALS[1], 0.05), (SIGNALS[0], 0.3), (SIGNALS[1], 0.6)]
)
def test_interruption_while_it_imports(tmp_path: Path, number: signal.Signals, moment: float) -> None:
    found = interrupted(tmp_path, ("run", str(EXAMPLE), "-o", str(tmp_path / "out")), number, moment)
    assert (found.code, found.faults) == (128 + number, ())


@pytest.mark.parametrize(("command", "number"), [("run", SIGNALS[0]), ("gains", SIGNALS[1]), ("falsify", SIGNALS[0])])
def test_interruption_of_workers(tmp_path: Path, certificate: Path, command: str, number: signal.Signals) -> None:
    """After the fork of the workers, wherever they are then."""
    running = Running(tmp_path, *arguments_of(command, EXAMPLE, certificate, tmp_path))
    until(lambda: len(running.processes()) >= 4)
    running.interrupt(number)
    assert running.processes() == []
    _, said = running.process.communicate()
    assert running.process.returncode == 128 + number
    assert said.splitlines()[-1] == f"certify: interrupted by {number.name}; nothing was left half done"
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
@pytest.mark.parametrize("command", COMMANDS)
def test_interruption_at_any_moment(tmp_path: Path, certificate: Path, command: str, number: signal.Signals) -> None:
    arguments = arguments_of(command, EXAMPLE, certificate, tmp_path)
    found = [interrupted(tmp_path, arguments, number, 0.15 * step) for step in range(30)]
    assert [one.faults for one in found] == [()] * 30
    assert any(not one.finished for one in found)


@pytest.mark.parametrize("whom", ["supervisor", "child"])
def test_no_process_survives_its_parent(tmp_path: Path, whom: str) -> None:
    """Killed without a chance to say anything to anyone."""
    running = Running(tmp_path, "gains", str(EXAMPLE), "-o", str(tmp_path / "c.json"), "--json")
    until(lambda: len(running.processes()) >= 4)
    supervisor = running.process.pid
    child = next(pid for pid in running.processes() if pid != supervisor and _parent(pid) == supervisor)
    os.kill(supervisor if whom == "supervisor" else child, signal.SIGKILL)
    output, said = running.process.communicate()
    until(lambda: running.processes() == [])
    assert not (tmp_path / "c.json").exists() and os.listdir(running.temporary) == []
    if whom == "child":
        assert running.process.returncode == 3
        assert json.loads(output)["status"] == "inconclusive"
        assert said.splitlines()[-1].startswith("certify: the computation was ended by SIGKILL")


def test_a_lost_worker_is_said(tmp_path: Path) -> None:
    running = Running(tmp_path, "gains", str(EXAMPLE), "-o", str(tmp_path / "c.json"), "--json")
    until(lambda: len(running.processes()) >= 4)
    workers = [pid for pid in running.processes() if _parent(_parent(pid)) == running.process.pid]
    os.kill(workers[0], signal.SIGKILL)
    output, said = running.process.communicate()
    assert (running.process.returncode, json.loads(output)["status"]) == (3, "inconclusive")
    assert "a worker process was lost (SIGKILL" in json.loads(output)["reason"]
    assert "Traceback" not in said
    assert running.processes() == []


def test_what_is_being_written_is_written(tmp_path: Path) -> None:
    """A signal between the first file and the last waits for the last; one that waits too long is not waited for."""
    script = (
        "import os, sys, time; from pathlib import Path\n"
        "import certify.files as files; import reports.supervisor as s\n"
        "slow = os.fsync\n"
        "def fsync(descriptor):\n    print('writing', flush=True); time.sleep(float(sys.argv[1])); slow(descriptor)\n"
        "os.fsync = fsync\n"
        "names = [f'{k}.json' for k in range(3)]\n"
        "s._command = lambda: files.write_together(Path('out'), {name: b'new' for name in names}) or time.sleep(60)\n"
        "sys.exit(s.main())"
    )
    (tmp_path / "out").mkdir()
    for name in ("0.json", "1.json", "2.json"):
        (tmp_path / "out" / name).write_text("old")
    for pause, left in (("30", "old"), ("0.05", "new")):
        process = subprocess.Popen(
            [sys.executable, "-c", script, pause],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert process.stdout is not None and process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGTERM)
        process.communicate()
        assert process.returncode == 143
        assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == dict.fromkeys(
            ("0.json", "1.json", "2.json"), left
        )


def test_nothing_that_was_started_outlives_the_command(tmp_path: Path) -> None:
    """Neither a compiler at work nor the folder it works in, also where they know nothing of who started them."""
    script = (
        "import subprocess, sys, time; import reports.supervisor as s; from certify.files import temporary_folder\n"
        "def work():\n    with temporary_folder() as folder:\n"
        "        inner = subprocess.Popen(['sh', '-c', 'sleep 300 & sleep 300'], stdout=subprocess.DEVNULL)\n"
        "        (folder / 'file').write_text('x'); print(folder, flush=True); time.sleep(300)\n"
        "s._command = work; sys.exit(s.main())"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": str(ROOT), TOKEN: str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout is not None
    folder = Path(process.stdout.readline().strip())
    until(lambda: len(marked(str(tmp_path))) >= 5 and folder.is_dir())
    process.send_signal(signal.SIGINT)
    assert process.wait() == 130
    assert marked(str(tmp_path)) == [] and not folder.exists()


def test_an_interruption_before_the_supervisor_listens_waits_for_it(tmp_path: Path) -> None:
    """Held back from the first line of the entry on, however slowly the rest is loaded; the child hears them again."""
    script = (
        "import os, signal, sys; import reports.entry\n"
        "os.kill(os.getpid(), signal.{name}); print('still here', flush=True)\n"
        "sys.argv = ['certify', 'check', '{plant}']; sys.exit(reports.entry.main())"
    )
    for number in (*SIGNALS, signal.SIGHUP):
        code = script.format(name=number.name, plant=EXAMPLE)
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (128 + number, "still here\n")
        assert done.stderr == f"certify: interrupted by {number.name}; nothing was left half done\n"


def test_an_ignored_interruption_stays_ignored(tmp_path: Path) -> None:
    """As in a script's background job, where the shell ignores SIGINT for its children."""
    script = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    command = [sys.executable, "-c", script + "from reports.entry import main; sys.exit(main())"]
    process = subprocess.Popen([*command, "check", str(EXAMPLE)], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    until(lambda: process.poll() is not None or _children(process.pid))
    process.send_signal(signal.SIGINT)
    assert process.communicate()[0].endswith("assumptions: holds\n") and process.returncode == 0


def test_results_are_all_known_to_the_test() -> None:
    from reports.command_line import run

    assert {run.CERTIFICATE, run.REPORT, run.SUMMARY, run.WITNESS, run.PICTURE} <= set(RESULTS)


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def _children(pid: int) -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdigit() and _parent(int(name)) == pid]
