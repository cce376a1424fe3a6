"""A short log of our own, and the shipped parameters with few trials: what tests of logs share."""
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FRAMES, STAND, STEP_DEG = 30, 5, 9


def changed(file, out, **values):
    """The shipped file with other values."""
    text = (ROOT / "config" / file).read_text()
    for key, value in values.items():
        text, count = re.subn(rf"^( *{key}:) \S+", rf"\1 {value}", text, flags=re.MULTILINE)
        if count != 1:
            sys.exit(f"{key} is not in {file}")
    out.write_text(text)


def configs(folder, **of_watchers):
    """FOLDER/library.yaml and FOLDER/config/PROCESS.yaml; `of_watchers`: values for learner and recogniser."""
    processes = folder / "config"
    processes.mkdir()
    for name in ("learner", "recogniser"):
        changed(f"{name}.yaml", processes / f"{name}.yaml", **of_watchers)
    changed("planner.yaml", processes / "planner.yaml")
    changed("assessor.yaml", processes / "assessor.yaml", job_frames=8)
    changed("library.yaml", folder / "library.yaml", trials_per_view=8, negatives_per_view=2)


def make_log(programs, log):
    subprocess.run([programs / "make_log", log, str(FRAMES), str(STAND), str(STEP_DEG)], check=True)


def replay(programs, folder, log, out):
    """The command that replays the whole group in lock step."""
    return [str(word) for word in (programs / "vantage", "replay", log, "--out", out, "--object", "box", "--config",
                                   folder / "library.yaml", "--process-configs", folder / "config", "--every-frame")]
