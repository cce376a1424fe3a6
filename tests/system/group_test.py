"""System tests: groups of the real processes. usage: group_test.py TEST FOLDER_OF_PROGRAMS"""
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = ROOT / "scripts" / "launch"
RUN = ROOT / "scripts" / "run"
BIN = Path(sys.argv[2]).resolve()
os.environ["VANTAGE_BIN"] = str(BIN)
os.environ["VANTAGE_OWN_NETWORK"] = "1"


def check(condition, text):
    if not condition:
        raise AssertionError(text)


def short_library(folder, attempts):
    """The shipped parameters with few trials and attempts."""
    text = (ROOT / "config" / "library.yaml").read_text()
    for key, value in (("trials_per_view", 6), ("negatives_per_view", 2), ("max_attempts", attempts)):
        text, count = re.subn(rf"^  {key}: \S+", f"  {key}: {value}", text, flags=re.MULTILINE)
        check(count == 1, f"{key} is not in library.yaml")
    file = folder / "library.yaml"
    file.write_text(text)
    return file


def pids_of(folder):
    """Processes that carry the group's token."""
    token = f"VANTAGE_GROUP_FOLDER={folder}".encode()
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and token in (entry / "environ").read_bytes().split(b"\0"):
                found.append(int(entry.name))
        except OSError:
            pass
    return found


def wait_for(condition, what, timeout_s=120.0):
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(0.2)
    raise AssertionError(f"waited {timeout_s:.0f} s for {what}")


def messages(log):
    """(channel, bytes) of every message of an LCM log."""
    data = log.read_bytes()
    position = 0
    while position + 28 <= len(data):
        sync, _, _, channel_size, size = struct.unpack_from(">IqqII", data, position)
        check(sync == 0xEDA1DA01, f"{log} is damaged at {position}")
        position += 28
        yield data[position:position + channel_size].decode(), size
        position += channel_size + size


def logger(folder):
    return subprocess.Popen([ROOT / "scripts" / "record", folder / "log.lcm"], stdout=subprocess.DEVNULL)


def end(process, number=signal.SIGTERM):
    process.send_signal(number)
    try:
        return process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        raise


def test_explore(folder):
    """One command explores, ends by itself and says how it went; a logger beside it hears everything."""
    library = short_library(folder, attempts=3)
    recorder = logger(folder)
    done = subprocess.run([RUN, "explore", "--headless", "--no-build", "--library", library, "--dir", folder / "run"], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=240, check=False)
    end(recorder, signal.SIGINT)
    print(done.stdout)
    check(done.returncode == 0, f"exit code {done.returncode}")
    summary = json.loads((folder / "run" / "summary.json").read_text())
    check(summary["views"] >= 2, f"{summary['views']} views")
    check(summary["stop_reason"] == "max_attempts", summary["stop_reason"])
    check(0.0 < summary["completeness"] <= 1.0, "completeness")
    for word in ("views", "completeness", "time", "stopped", "models.db"):
        check(word in done.stdout, f"the summary does not say {word}")
    check((folder / "run" / "models.db").is_file(), "no model store")
    check(not pids_of(folder / "run"), "processes are left")

    sizes = {}
    for channel, size in messages(folder / "log.lcm"):
        sizes.setdefault(channel, []).append(size)
    for channel in ("SENSOR_COLOR", "SENSOR_DEPTH", "MOUNT_STATE", "MOUNT_COMMAND", "LEARNER_TRACK", "LEARNER_SCENE", "LEARNER_VIEW",
                    "RECOGNISER_DETECTIONS", "ASSESSOR_MEASURES", "ASSESSOR_COMPLETENESS", "PLANNER_PLAN", "PLANNER_REACH",
                    "SENSOR_STATUS", "MOUNT_STATUS", "LEARNER_STATUS", "RECOGNISER_STATUS", "ASSESSOR_STATUS", "PLANNER_STATUS"):
        check(channel in sizes, f"nothing was heard on {channel}; heard: {sorted(sizes)}")
    largest = max(max(of_channel) for of_channel in sizes.values())
    check(largest <= 190000, f"a message of {largest} bytes")


def test_interrupt(folder):
    """Ctrl-C ends every process that was started, and only those."""
    bystander = subprocess.Popen([BIN / "mount"], stdout=subprocess.DEVNULL)
    library = short_library(folder, attempts=50)
    run = subprocess.Popen([RUN, "explore", "--no-build", "--library", library, "--dir", folder / "run"], stdout=subprocess.DEVNULL)
    wait_for(lambda: len(pids_of(folder / "run")) >= 7 or run.poll() is not None, "the group to be up")
    check(run.poll() is None, "the run ended at once")
    time.sleep(2.0)
    status = subprocess.run([LAUNCH, "status", "explore", "--dir", folder / "run"], text=True, stdout=subprocess.PIPE, check=False)
    check(status.returncode == 0 and status.stdout.count("RUNNING") == 6, f"status says: {status.stdout}")
    code = end(run, signal.SIGINT)
    check(code == 130, f"exit code {code}")
    check(not pids_of(folder / "run"), f"left: {pids_of(folder / 'run')}")
    check(bystander.poll() is None, "it ended a process that it had not started")
    check(end(bystander) == 0, "a process ends with 0 after SIGTERM")


def test_supervisor_killed(folder):
    """kill -9 of supervisor leaves the processes; down finds and ends them."""
    library = short_library(folder, attempts=50)
    run_folder = folder / "run"
    up = [LAUNCH, "up", "explore", "--library", library, "--dir", run_folder]
    subprocess.run(up, check=True)
    check(subprocess.run(up, stderr=subprocess.DEVNULL, check=False).returncode == 1, "up twice")
    supervisor = int((run_folder / "supervisord.pid").read_text())
    check(supervisor in pids_of(run_folder), "supervisor is not of its own group")
    os.kill(supervisor, signal.SIGKILL)
    wait_for(lambda: supervisor not in pids_of(run_folder), "supervisor's end")
    check(len(pids_of(run_folder)) >= 6, "the processes ended with supervisor: then this test tests nothing")
    status = subprocess.run([LAUNCH, "status", "explore", "--dir", run_folder], text=True, stderr=subprocess.PIPE, check=False)
    check(status.returncode == 1 and "supervisor of explore is gone" in status.stderr, status.stderr)
    subprocess.run([LAUNCH, "down", "explore", "--dir", run_folder], check=True)
    check(not pids_of(run_folder), f"left: {pids_of(run_folder)}")
    subprocess.run([LAUNCH, "down", "explore", "--dir", run_folder], check=True)  # Again is no error.


def test_start_order(folder):
    """Started in the wrong order, and with the learner killed and started again, the run still gets to its end."""
    library = short_library(folder, attempts=3)
    world = ROOT / "config" / "worlds" / "table.yaml"
    store = ["--library", library, "--store", folder / "models.db"]
    summary = folder / "summary.json"
    commands = {
        "planner": ["--library", library, "--summary", summary, "--exit-when-done"],
        "assessor": store, "recogniser": store, "learner": store, "sensor": ["--world", world], "mount": ["--world", world],
    }
    running = {}
    try:
        for name, options in commands.items():
            running[name] = subprocess.Popen([BIN / name, *options])
            time.sleep(1.0)
        wait_for(lambda: (folder / "models.db").is_file() and running["learner"].poll() is None, "the store")
        time.sleep(3.0)
        running["learner"].kill()
        running["learner"].wait()
        time.sleep(1.0)
        running["learner"] = subprocess.Popen([BIN / "learner", *store])
        wait_for(summary.is_file, "the summary", 200.0)
        check(running["planner"].wait(20) == 0, "the planner's exit code")
        result = json.loads(summary.read_text())
        check(result["attempts"] >= 1 and result["views"] >= 2, f"{result}")
        for name in ("assessor", "recogniser", "learner", "sensor", "mount"):
            check(running[name].poll() is None, f"{name} did not live to the end")
    finally:
        for process in running.values():
            if process.poll() is None:
                end(process)


def test_replay(folder):
    """What was recorded can be played: a recogniser sees the frames of a log."""
    world = ROOT / "config" / "worlds" / "table.yaml"
    recorder = logger(folder)
    time.sleep(0.5)
    sensor = subprocess.Popen([BIN / "sensor", "--world", world])
    log = folder / "log.lcm"
    wait_for(lambda: log.is_file() and log.stat().st_size > 1000000, "frames in the log", 60.0)
    end(sensor)
    end(recorder, signal.SIGINT)
    frames = sum(1 for channel, _ in messages(log) if channel == "SENSOR_DEPTH")
    check(frames > 0, "no frames")
    second = folder / "second"
    second.mkdir()
    recorder = logger(second)
    recogniser = subprocess.Popen([BIN / "recogniser", "--store", folder / "none.db"])
    time.sleep(1.0)
    subprocess.run([ROOT / "scripts" / "replay", log, "--speed", "1", "--channels", "SENSOR_.*"], check=True,
                   stdout=subprocess.DEVNULL, timeout=60)
    time.sleep(1.5)
    end(recogniser)
    end(recorder, signal.SIGINT)
    heard = [channel for channel, _ in messages(second / "log.lcm")]
    check("RECOGNISER_DETECTIONS" in heard, f"heard only {sorted(set(heard))}")


def main():
    with tempfile.TemporaryDirectory(prefix="vantage-") as folder:
        try:
            globals()[f"test_{sys.argv[1]}"](Path(folder))
        except AssertionError as error:
            for log in Path(folder).glob("run/logs/*.log"):
                print(f"== {log.name}\n{log.read_text(errors='replace')[-2000:]}")
            print(f"FAILED: {error}")
            return 1
        finally:
            subprocess.run([LAUNCH, "down", "explore", "--dir", Path(folder) / "run"], stdout=subprocess.DEVNULL, check=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
