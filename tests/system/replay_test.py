"""`vantage replay` on a short log of simulated frames. usage: replay_test.py FOLDER_OF_PROGRAMS

All four nodes run; the output is the same, byte for byte, on all cores, on one core, and on one core shared with another replay; and
it says what replay_expected.json says.
"""
import csv
import hashlib
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from short_run import FRAMES, configs, make_log, replay

BIN = Path(sys.argv[1]).resolve()
EXPECTED = json.loads((Path(__file__).parent / "replay_expected.json").read_text())


def check(name, value, good):
    print(f"{name}: {value}", flush=True)
    if not good:
        sys.exit(f"replay: {name} is {value}; see {Path(__file__).name}")


def command(folder, out):
    return replay(BIN, folder, folder / "log.lcm", folder / out)


def on_core(core, words):
    return ["taskset", "-c", str(core), *words]


def digest(file):
    return hashlib.sha256(file.read_bytes()).hexdigest()


def rows(folder, channel):
    with open(folder / "tables" / f"{channel}.csv", newline="") as file:
        return list(csv.DictReader(file))


def compare(folder):
    vantage = BIN / "vantage"
    subprocess.run([vantage, "log", "verify", folder / "0.lcm"], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([vantage, "log", "export", folder / "0.lcm", "--csv", folder / "tables"], check=True, stdout=subprocess.DEVNULL)
    tracks, detections = rows(folder, "LEARNER_TRACK"), rows(folder, "RECOGNISER_DETECTIONS")
    check("frames the learner looked at", len(tracks), len(tracks) == FRAMES)
    tracked = sum(int(row["tracked"]) for row in tracks)
    check("tracked", tracked, tracked >= EXPECTED["tracked"])
    views = int(tracks[-1]["views"])
    check("views", views, views == EXPECTED["views"])
    detected = sum(float(row["probability"]) >= 0.5 for row in detections)
    check("detections with p(o|c) 0.5", detected, abs(detected - EXPECTED["detected"]) <= 3)
    place = [float(tracks[-1][f"T_world_object_{axis}"]) for axis in "xyz"]
    moved_mm = 1000.0 * math.dist(place, EXPECTED["T_world_object_xyz"])
    check("the object's place, mm from where it is expected", round(moved_mm, 2), moved_mm < 3.0)
    drift_mm = max(1000.0 * math.dist(place, [float(row[f"T_world_object_{axis}"]) for axis in "xyz"]) for row in tracks[1:])
    check("the object's motion in the world, mm", round(drift_mm, 2), drift_mm < 5.0)
    measures = rows(folder, "ASSESSOR_MEASURES")
    completeness = float(measures[-1]["completeness"])
    check("views measured", measures[-1]["views"], int(measures[-1]["views"]) == EXPECTED["measured_views"])
    check("completeness", completeness, abs(completeness - EXPECTED["completeness"]) < 0.1)
    check("decisions", rows(folder, "PLANNER_PLAN")[-1]["decision"], int(rows(folder, "PLANNER_PLAN")[-1]["decision"]) >= 1)


def main():
    cores = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory(prefix="vantage-") as name:
        folder = Path(name)
        configs(folder)
        make_log(BIN, folder / "log.lcm")
        subprocess.run(command(folder, "0.lcm"), check=True, stdout=subprocess.DEVNULL)
        first = digest(folder / "0.lcm")
        compare(folder)
        at_once = [subprocess.Popen(on_core(cores[0], command(folder, f"{i}.lcm")), stdout=subprocess.DEVNULL) for i in (1, 2)]
        codes = [process.wait() for process in at_once]
        check("exit codes", codes, codes == [0, 0])
        for i in (1, 2):
            check(f"replay {i} on one core", digest(folder / f"{i}.lcm")[:12], digest(folder / f"{i}.lcm") == first)


main()
