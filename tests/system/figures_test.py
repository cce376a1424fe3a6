"""What the command line must reach on the real recordings. usage: figures_test.py FOLDER_OF_PROGRAMS

Exit code 77 (skipped) where the recordings are absent, unless VANTAGE_REQUIRE_DATA=1.
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VANTAGE = Path(sys.argv[1]).resolve() / "vantage"
DATA = Path(os.environ.get("VANTAGE_DATA", ROOT / ".." / "shared" / "data"))


def vantage(*arguments):
    result = subprocess.run([str(VANTAGE), *map(str, arguments), "--json", "-"], check=True, capture_output=True, text=True)
    return json.loads(result.stdout)


def check(figures, name, good):
    print(f"{name}: {figures[name]}", flush=True)
    if not good:
        sys.exit(f"figures: {name} is {figures[name]}, which is not good enough")


def tracking(folder):
    """A hand-held sweep before the carton, tracked without known poses."""
    figures = vantage("learn", "--sequence", DATA / "shelf_box", "--store", folder / "shelf.db")
    check(figures, "tracked", figures["tracked"] >= 49)
    check(figures, "translation_error_mm_median", figures["translation_error_mm_median"] <= 4)
    check(figures, "rotation_error_deg_median", figures["rotation_error_deg_median"] < 1)


def recognition(folder):
    """The cracker box of `board`: learned on the even frames at known poses, recognised on the odd ones without their depth."""
    store, board = folder / "board.db", DATA / "board"
    vantage("learn", "--sequence", board, "--store", store, "--object-id", 3, "--frames", "even", "--use-known-poses")
    truth = vantage("recognise", "--store", store, "--sequence", board, "--frames", "odd", "--no-query-depth", "--truth-object-id", 3)["truth"]
    check(truth, "frames", truth["frames"] >= 40)
    check(truth, "right", truth["right"] >= 0.92 * truth["frames"])
    check(truth, "right_10mm", truth["right_10mm"] >= 0.7 * truth["frames"])
    check(truth, "wrong", truth["wrong"] == 0)


def completeness():
    """How views combine, on the photographs of `board`: the default rule says how often models of 1 to 16 views are detected.

    Six splits do not tell max from common_cause (errors of a split have an SD of .05 to .1), but the others from both.
    """
    figures = vantage("evaluate", "completeness", "--sequence", DATA / "board", "--object-id", 3, "--quick")
    rules = ("max", "common_cause", "noisy_or", "clipped_sum")
    for of in figures["views"]:
        default = of["common_cause"]
        print(of["views"], "views:", of["detection_rate"], {rule: round(of[rule]["difference"], 3) for rule in rules}, flush=True)
        check(default, "difference", abs(default["difference"]) <= 0.08)
    check(figures, "views", len(figures["views"]) == 5)
    brier = {rule: sum(of[rule]["brier_score"] for of in figures["views"]) / 5 for rule in rules}
    print("Brier score of single looks:", brier, flush=True)
    if brier["common_cause"] > min(brier.values()) + 0.005 or brier["common_cause"] > min(brier["noisy_or"], brier["clipped_sum"]):
        sys.exit("figures: another rule foretells single looks better than the default one")


def main():
    if not (DATA / "board").is_dir() or not (DATA / "shelf_box").is_dir():
        print(f"no board and shelf_box in {DATA}: set VANTAGE_DATA")
        sys.exit(1 if os.environ.get("VANTAGE_REQUIRE_DATA") == "1" else 77)
    with tempfile.TemporaryDirectory() as folder:
        tracking(Path(folder))
        recognition(Path(folder))
    completeness()


main()
