"""A log played into a live recogniser: it says of every frame it looks at what it says in lock step.

usage: live_test.py FOLDER_OF_PROGRAMS [LOG STORE], in a network of its own (in_network); without LOG on a short one of our own.
"""
import csv
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.argv[1]).resolve()
os.environ["VANTAGE_BIN"] = str(BIN)


def check(condition, text):
    if not condition:
        sys.exit(f"live: {text}")


def looked_at(log):
    """utime of every message of a log of RECOGNISER_DETECTIONS, in order."""
    data, position, times = log.read_bytes(), 0, []
    while position + 28 <= len(data):
        channel_size, size = struct.unpack_from(">II", data, position + 20)
        channel = data[position + 28:position + 28 + channel_size]
        position += 28 + channel_size
        if channel == b"RECOGNISER_DETECTIONS":
            times.append(struct.unpack_from(">q", data, position + 8)[0])
        position += size
    return times


def detections(log, folder):
    """{utime: [what was detected, every number of it but when it was logged and how long it took]}."""
    subprocess.run([BIN / "vantage", "log", "export", log, "--csv", folder], check=True, stdout=subprocess.DEVNULL)
    found = {}
    with open(folder / "RECOGNISER_DETECTIONS.csv", newline="") as file:
        for row in csv.DictReader(file):
            if row.get("object"):
                found.setdefault(int(row["utime"]), []).append(tuple(value for key, value in row.items() if key not in ("log_time_us", "process_ms")))
    return found


def in_lock_step(log, store, folder):
    subprocess.run([BIN / "vantage", "replay", log, "--processes", "recogniser", "--every-frame", "--from-store", store, "--out",
                    folder / "replayed.lcm"], check=True, stdout=subprocess.DEVNULL)
    return folder / "replayed.lcm"


def live(log, store, folder):
    heard = folder / "live.lcm"
    recorder = subprocess.Popen([ROOT / "scripts" / "record", heard, "--channels", "RECOGNISER_.*"], stdout=subprocess.DEVNULL)
    recogniser = subprocess.Popen([BIN / "recogniser", "--store", store])
    try:
        time.sleep(3.0)
        subprocess.run([ROOT / "scripts" / "replay", log, "--channels", "SENSOR_.*"], check=True, stdout=subprocess.DEVNULL)
        time.sleep(3.0)
    finally:
        recogniser.terminate()
        recogniser.wait(20)
        recorder.send_signal(signal.SIGINT)
        recorder.wait(20)
    return heard


def main():
    with tempfile.TemporaryDirectory(prefix="vantage-") as name:
        folder = Path(name)
        if len(sys.argv) > 3:
            log, store = Path(sys.argv[2]), Path(sys.argv[3])
        else:
            log, store = folder / "log.lcm", folder / "models.db"
            subprocess.run([BIN / "make_log", log, "30", "5", "9"], check=True)
            subprocess.run([BIN / "vantage", "replay", log, "--processes", "learner", "--object", "box", "--every-frame", "--store", store,
                            "--out", folder / "learned.lcm"], check=True, stdout=subprocess.DEVNULL)
        replayed, heard = in_lock_step(log, store, folder), live(log, store, folder)
        wanted, found = detections(replayed, folder / "a"), detections(heard, folder / "b")
        every, frames = set(looked_at(replayed)), looked_at(heard)
        check(frames, "the live recogniser said nothing")
        check(set(frames) <= every, "it looked at frames that are not in the log")
        differ = [utime for utime in frames if sorted(wanted.get(utime, [])) != sorted(found.get(utime, []))]
        count = sum(len(found.get(utime, [])) for utime in frames)
        print(f"live: {len(frames)} of {len(every)} frames looked at, {count} detections, {len(differ)} frames differ from lock step")
        for utime in differ[:3]:
            print(f"{utime}:\n  lock step {wanted.get(utime)}\n  live      {found.get(utime)}")
        check(count > 0, "nothing was detected: this says nothing")
        check(not differ, f"{len(differ)} frames differ")


main()
