"""vantage explore --compare: every strategy runs, runs are kept and not made twice, other parameters are refused."""
import json
import pathlib
import subprocess
import sys
import tempfile

BIN, SOURCE = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])


def compare(folder, *more):
    command = [BIN / "vantage", "explore", "--compare", folder, "--quick", "--world", SOURCE / "config/worlds/table.yaml"]
    return subprocess.run([str(part) for part in [*command, *more]], capture_output=True, text=True, check=False)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name) / "runs"
    first = compare(folder, "--strategies", "planner,sweep")
    assert first.returncode == 0, first.stderr
    runs = sorted(path.name for path in folder.glob("run-*.json"))
    assert runs == ["run-table-planner-0.json", "run-table-sweep-0.json"], runs
    stamps = {run: (folder / run).stat().st_mtime_ns for run in runs}

    everything = compare(folder)
    assert everything.returncode == 0, everything.stderr
    for run, stamp in stamps.items():
        assert (folder / run).stat().st_mtime_ns == stamp, f"{run} was made again"
    group = json.loads((folder / "compare.json").read_text())["groups"][0]
    assert set(group["strategies"]) == {"planner", "random", "nearest", "sweep", "coverage", "oracle"}, group
    assert group["touching"] == 0 and group["paths"] >= 12, group
    for figures in group["strategies"].values():
        assert figures["runs"] == 1 and sum(figures["stopped"].values()) == 1, figures
        assert figures["looks"] is None or figures["looks"] >= figures["views"], figures
    assert "planner / strategy" in (folder / "table.txt").read_text()

    other = compare(folder, "--judge-views", "3")
    assert other.returncode == 1 and "another folder" in other.stderr, other.stderr
print("ok")
