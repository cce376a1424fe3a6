"""A log played live with lcm-logplayer: what is said of its frames, beside what is said in lock step.

usage: live_test.py FOLDER_OF_PROGRAMS [LOG STORE]       a recogniser with a fixed store: it says the same of every frame it looks at
       live_test.py FOLDER_OF_PROGRAMS --group [SPEED [LOG]]   the whole group, which learns while the log plays: frames that differ are
                                                         counted by what differed before them
In a network of its own (in_network); without LOG on a short one of our own.
"""
import csv
import math
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from short_run import configs, make_log, replay

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.argv[1]).resolve()
os.environ["VANTAGE_BIN"] = str(BIN)


def check(condition, text):
    if not condition:
        sys.exit(f"live: {text}")


def messages(log):
    """(channel, utime) of every message of a log, in order."""
    data, position = log.read_bytes(), 0
    while position + 28 <= len(data):
        channel_size, size = struct.unpack_from(">II", data, position + 20)
        channel = data[position + 28:position + 28 + channel_size].decode()
        position += 28 + channel_size
        yield channel, struct.unpack_from(">q", data, position + 8)[0]
        position += size


def looked_at(log, channel="RECOGNISER_DETECTIONS"):
    return [utime for name, utime in messages(log) if name == channel]


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


def live(log, heard, channels, processes, speed=1.0):
    """Plays the log to the processes (commands); what they say is in `heard`."""
    recorder = subprocess.Popen([ROOT / "scripts" / "record", heard, "--channels", "(LEARNER|RECOGNISER|ASSESSOR|PLANNER)_.*"],
                                stdout=subprocess.DEVNULL)
    running = [subprocess.Popen([str(word) for word in command]) for command in processes]
    try:
        time.sleep(3.0)
        subprocess.run([ROOT / "scripts" / "replay", log, "--channels", channels, "--speed", str(speed)], check=True,
                       stdout=subprocess.DEVNULL)
        time.sleep(3.0)
        for process in running:
            check(process.poll() is None, f"{process.args[0]} has ended with {process.returncode}")
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait(90)  # The assessor first ends the trial it is at.
        recorder.send_signal(signal.SIGINT)
        recorder.wait(20)


def at_hand(log):
    """{utime of a frame: the views that had been told when the recogniser spoke of it}, by their utimes."""
    views, result = [], {}
    for channel, utime in messages(log):
        if channel == "LEARNER_VIEW":
            views.append(utime)
        elif channel == "RECOGNISER_DETECTIONS":
            result[utime] = tuple(views)
    return result


def without_measures(found):
    """Detections but for probability and source: what is in the model decides, not the measures."""
    return sorted(row[:3] + row[4:9] + row[10:] for row in found)


def cause(utime, replayed, heard, dropped, a, b):
    """What was not the same before this frame, of which lock step says `a` and the live group `b`. With a fixed store the recogniser
    says the same (see `fixed`): so where nothing else differs, it is what the store held when it was read."""
    if without_measures(a) == without_measures(b):
        return "in p(o|c) alone: measures arrived at another frame"
    if at_hand(replayed)[utime] != at_hand(heard)[utime]:
        told = [set(view for view in looked_at(log, "LEARNER_VIEW") if view <= utime) for log in (replayed, heard)]
        return "a view reached the recogniser at another frame" if told[0] == told[1] else "the learner, slower, took other views"
    if any(frame <= utime for frame in dropped):
        return "the learner dropped a frame before, so its views are linked and refined otherwise"
    return "the store was read at another moment"


def place(found):
    return [float(value) for value in found[-7:-4]]


def group(folder, speed, log):
    if log is None:
        log = folder / "log.lcm"
        make_log(BIN, log)
    configs(folder, max_rate_hz=1000)
    replayed, heard, store, library = folder / "replayed.lcm", folder / "live.lcm", folder / "models.db", folder / "library.yaml"
    subprocess.run(replay(BIN, folder, log, replayed), check=True, stdout=subprocess.DEVNULL)
    config = {name: ["--config", folder / "config" / f"{name}.yaml", "--library", library]
              for name in ("learner", "recogniser", "assessor", "planner")}
    live(log, heard, "(SENSOR|MOUNT)_.*",
         [[BIN / "learner", *config["learner"], "--store", store, "--object", "box"],
          [BIN / "recogniser", *config["recogniser"], "--store", store],
          [BIN / "assessor", *config["assessor"], "--store", store],
          [BIN / "planner", *config["planner"]]], speed)
    for channel in ("LEARNER_TRACK", "LEARNER_VIEW", "RECOGNISER_DETECTIONS", "ASSESSOR_MEASURES", "PLANNER_PLAN"):
        check(looked_at(heard, channel), f"nothing live on {channel}")
    wanted, found = detections(replayed, folder / "a"), detections(heard, folder / "b")
    every, frames = looked_at(replayed), looked_at(heard)
    learned_from = looked_at(replayed, "LEARNER_TRACK")
    dropped = sorted(set(learned_from) - set(looked_at(heard, "LEARNER_TRACK")))
    print(f"live group: the recogniser looked at {len(frames)} of {len(every)} frames, the learner at "
          f"{len(learned_from) - len(dropped)} of {len(learned_from)} (the others were dropped: a slow consumer takes the newest)")
    check(set(frames) <= set(every), "it looked at frames that are not in the log")
    causes, apart_m, one_sided = {}, [], 0
    for utime in frames:
        a, b = sorted(wanted.get(utime, [])), sorted(found.get(utime, []))
        if len(a) == len(b) == 1:
            apart_m.append(math.dist(place(a[0]), place(b[0])))
        one_sided += len(a) != len(b)
        if a != b:
            causes.setdefault(cause(utime, replayed, heard, dropped, a, b), []).append(utime)
    same = len(frames) - sum(map(len, causes.values()))
    print(f"  {same} frames: the same detections, every number of them")
    for text, times in sorted(causes.items()):
        print(f"  {len(times)} frames differ: {text}")
    check(apart_m, "nothing was detected in both: this says nothing")
    print(f"  detected in both {len(apart_m)}, in one only {one_sided}; furthest apart {1000 * max(apart_m):.1f} mm")
    check(max(apart_m) < 0.03, "the same object is found elsewhere")


def fixed(folder, log, store):
    if log is None:
        log, store = folder / "log.lcm", folder / "models.db"
        make_log(BIN, log)
        subprocess.run([BIN / "vantage", "replay", log, "--processes", "learner", "--object", "box", "--every-frame", "--store", store,
                        "--out", folder / "learned.lcm"], check=True, stdout=subprocess.DEVNULL)
    replayed, heard = in_lock_step(log, store, folder), folder / "live.lcm"
    live(log, heard, "SENSOR_.*", [[BIN / "recogniser", "--store", store]])
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


def main():
    with tempfile.TemporaryDirectory(prefix="vantage-") as name:
        folder = Path(name)
        words = sys.argv[2:]
        if words[:1] == ["--group"]:
            group(folder, float(words[1]) if len(words) > 1 else 1.0, Path(words[2]).resolve() if len(words) > 2 else None)
        else:
            fixed(folder, *(map(Path, words) if words else (None, None)))


main()
