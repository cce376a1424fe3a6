"""Tests of scripts/doctor, spy, record and replay, and of `vantage log` and `replay` on logs that are none. usage: tools_test.py TEST FOLDER_OF_PROGRAMS; runs in a network of its own (in_network)."""
import os
import random
import re
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.argv[2]).resolve()
os.environ["VANTAGE_BIN"] = str(BIN)


def check(condition, text):
    if not condition:
        raise AssertionError(text)


def doctor(*before):
    done = subprocess.run([*before, ROOT / "scripts" / "doctor"], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    print(done.stdout)
    return done.returncode, done.stdout


def line_of(report, what):
    return next((line for line in report.splitlines() if line[5:].startswith(what)), "")


def test_doctor(_):
    """Where all is there it finds nothing bad; without a route it says so, and what it says to do mends it."""
    _, report = doctor()
    for what in ("multicast route", "loopback", "OpenNI2", "disk"):
        check(line_of(report, what).startswith("ok"), f"{what}: {line_of(report, what)}")
    for what in ("packages", "socket buffer", "lcm-spy", "programs"):
        check(line_of(report, what), f"nothing is said of {what}")

    subprocess.run(["ip", "route", "del", "224.0.0.0/4", "dev", "lo"], check=True)
    code, report = doctor()
    check(code == 1 and line_of(report, "multicast route").startswith("BAD"), "a missing route is not found")
    mend = re.search(r"mend: (.*?)   \(", report[report.index("multicast route"):]).group(1)
    subprocess.run(["sh", "-c", mend], check=True)
    _, report = doctor()
    check(line_of(report, "multicast route").startswith("ok"), "what it said did not mend it")
    check(line_of(report, "loopback").startswith("ok"), "what it said did not mend the loopback")


def read_xwd(file):
    """(width, height, rows of 32-bit pixels) of the picture that Xvfb keeps in a file."""
    data = file.read_bytes()
    header = struct.unpack(">25I", data[:100])
    width, height, line, colors = header[4], header[5], header[12], header[19]
    begin = header[0] + 12 * colors
    return width, height, [data[begin + y * line:begin + y * line + 4 * width] for y in range(height)]


def lines_of_text(rows, left, right):
    """How many lines of text there are between two columns: bands of rows with dark pixels. An underscore a little below its line
    belongs to it."""
    def dark(row):
        return sum(row[4 * x] < 100 and row[4 * x + 1] < 100 and row[4 * x + 2] < 100 for x in range(left, right)) >= 4
    lines, last = 0, -10
    for y, row in enumerate(rows):
        if dark(row):
            lines += y - last > 4
            last = y
    return lines


def types_shown(picture):
    """How many channels of known type lcm-spy shows. LCM's own LCM_SELF_TEST may be heard too, depending on who is faster; in place
    of a type it has "?? 6c636d2073656c66", which reaches further right than any of ours."""
    rows = read_xwd(picture)[2][20:560]
    return lines_of_text(rows, 165, 320) - lines_of_text(rows, 255, 320)


def wait_for(condition, what, timeout_s=60.0):
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(0.5)
    raise AssertionError(f"waited {timeout_s:.0f} s for {what}")


def test_spy(folder):
    """lcm-spy starts on today's Java, knows every type of ours and shows the channels of a running sensor."""
    os.environ["DISPLAY"] = ":77"
    os.environ["VANTAGE_SPY_FOLDER"] = str(folder / "types")
    world = ROOT / "config" / "worlds" / "table.yaml"
    picture = folder / "Xvfb_screen0"
    words = folder / "spy.log"
    running = []
    try:
        running.append(subprocess.Popen(["Xvfb", ":77", "-screen", "0", "1000x700x24", "-fbdir", folder, "-nolisten", "tcp"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        wait_for(picture.is_file, "the display")
        with open(words, "w") as log:
            running.append(subprocess.Popen([ROOT / "scripts" / "spy"], stdout=log, stderr=subprocess.STDOUT))
        wait_for(lambda: "plugins" in words.read_text() or running[-1].poll() is not None, "lcm-spy")
        types = len(list((ROOT / "lcmtypes").glob("vantage_*.lcm")))
        check(f"Found {types} LCM types" in words.read_text(), f"not {types} types: {words.read_text()}")
        time.sleep(3.0)
        quiet = types_shown(picture)
        for name in ("sensor", "mount"):
            running.append(subprocess.Popen([BIN / name, "--world", world]))
        # Type names of SENSOR_COLOR, SENSOR_DEPTH, SENSOR_STATUS, MOUNT_STATE, MOUNT_STATUS.
        wait_for(lambda: types_shown(picture) == 5, "five channels on the screen")
        check(quiet == 0, f"{quiet} lines before anybody spoke")
        save = os.environ.get("VANTAGE_SAVE")
        if save:
            Path(save).write_bytes(picture.read_bytes())
    finally:
        print(words.read_text() if words.is_file() else "")
        for process in reversed(running):
            process.terminate()
            process.wait(20)


def colours(rows, left, right):
    """How many different colours, of 16 grades a channel, and how many pixels that are no grey."""
    seen, vivid = set(), 0
    for row in rows:
        for x in range(left, right):
            blue, green, red = row[4 * x:4 * x + 3]
            seen.add((blue >> 4, green >> 4, red >> 4))
            vivid += max(blue, green, red) - min(blue, green, red) > 80
    return len(seen), vivid


def test_view(folder):
    """scripts/spy --view shows colour, depth and, once something was learned, the view sphere."""
    os.environ["DISPLAY"] = ":78"
    os.environ["VANTAGE_SPY_FOLDER"] = str(folder / "types")
    os.environ["VANTAGE_OWN_NETWORK"] = "1"
    picture = folder / "Xvfb_screen0"
    library = folder / "library.yaml"
    text = (ROOT / "config" / "library.yaml").read_text()
    for key, value in (("trials_per_view", 6), ("negatives_per_view", 2)):
        text = re.sub(rf"^  {key}: \S+", f"  {key}: {value}", text, flags=re.MULTILINE)
    library.write_text(text)
    launch = [ROOT / "scripts" / "launch"]
    running = []
    try:
        running.append(subprocess.Popen(["Xvfb", ":78", "-screen", "0", "1020x710x24", "-fbdir", folder, "-nolisten", "tcp"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        wait_for(picture.is_file, "the display")
        running.append(subprocess.Popen([ROOT / "scripts" / "spy", "--view"], stdout=subprocess.DEVNULL))
        subprocess.run([*launch, "up", "explore", "--library", library, "--dir", folder / "run"], check=True)
        # The window is at the lower edge: three panels beside each other.
        rows = lambda: read_xwd(picture)[2][380:620]
        wait_for(lambda: colours(rows(), 10, 320)[0] > 150, "a colour image")
        wait_for(lambda: colours(rows(), 350, 640)[1] > 20000, "a depth image in colours")
        wait_for(lambda: colours(rows(), 680, 990)[1] > 20000, "a view sphere", 150.0)
    finally:
        save = os.environ.get("VANTAGE_SAVE")
        if save and picture.is_file():
            Path(save).write_bytes(picture.read_bytes())
        subprocess.run([*launch, "down", "explore", "--dir", folder / "run"], check=False)
        for process in reversed(running):
            process.terminate()
            process.wait(20)


def event(number, channel, data):
    return struct.pack(">IqqII", 0xEDA1DA01, number, 1700000000000000 + 100000 * number, len(channel), len(data)) + channel + data


# A user who is nobody special, also where the test is run by root.
NOBODY_SPECIAL = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"]
VERBS = {"info": ["log", "info"], "verify": ["log", "verify"], "cut": ["log", "cut", "--out", "OUT"],
         "filter": ["log", "filter", "--out", "OUT"], "csv": ["log", "export", "--csv", "OUT"], "bop": ["log", "export", "--bop", "OUT"],
         "replay": ["replay", "--processes", "recogniser", "--out", "OUT"]}


def tell(words, out):
    """(exit code, standard output, standard error) of a command that must end by itself; what it wrote is removed."""
    done = subprocess.run([*NOBODY_SPECIAL, *[str(out) if word == "OUT" else word for word in words]], text=True, check=False, timeout=60,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    subprocess.run(["rm", "-rf", out], check=True)
    return done.returncode, done.stdout, done.stderr


def check_one_line(words, out, *wanted):
    """It ends with 1 and one line that says all that is wanted."""
    code, _, said = tell(words, out)
    check(code == 1 and said.count("\n") == 1 and all(word in said for word in wanted), f"{words}: {code}, {said}, not {wanted}")


def test_logs(folder):
    """Logs that are cut off, empty or none, and disks that are full: one clear line each, and no crash."""
    vantage, out = BIN / "vantage", folder / "out"
    record, play = ROOT / "scripts" / "record", ROOT / "scripts" / "replay"
    good = folder / "good.lcm"
    subprocess.run([BIN / "make_log", good, "6", "2", "9"], check=True)
    logs = {name: folder / f"{name}.lcm" for name in ("cut_off", "empty", "folder", "text", "random", "pipe", "forbidden", "missing", "others")}
    logs["cut_off"].write_bytes(good.read_bytes()[:-1000])
    logs["empty"].write_bytes(b"")
    logs["folder"].mkdir()
    logs["text"].write_text("This is a text, and longer than the head of an event would be, if there was one.\n")
    logs["random"].write_bytes(random.Random(7).randbytes(300000))
    os.mkfifo(logs["pipe"])
    logs["forbidden"].write_bytes(good.read_bytes())
    logs["forbidden"].chmod(0)
    logs["others"].write_bytes(b"".join(event(i, b"OTHER_CHANNEL", b"x" * 40) for i in range(20)))

    none = {"folder": "cannot be read", "text": "is no LCM log", "random": "is no LCM log", "pipe": "cannot be read",
            "forbidden": "cannot be read", "missing": "no such log"}
    for name, wanted in none.items():
        for words in VERBS.values():
            check_one_line([vantage, *words, logs[name]], out, logs[name].name, wanted)
        check_one_line([play, logs[name]], out, logs[name].name, wanted)

    for verb, words in VERBS.items():
        if verb != "info":
            check_one_line([vantage, *words, logs["empty"]], out, "empty.lcm", "there is nothing in this log")
        code, said, wrong = tell([vantage, *words, logs["cut_off"]], out)
        check(code == (verb == "verify") and "damaged place" in said, f"{verb} of a log that is cut off: {code}, {said}{wrong}")
        wanted = {"verify": "none of its 20 messages is on a channel of ours", "csv": "of other types", "bop": "no whole frame",
                  "replay": "nothing in it to replay"}
        if verb in wanted:
            check_one_line([vantage, *words, logs["others"]], out, "others.lcm", wanted[verb])
    check("there is nothing" in tell([vantage, "log", "info", logs["empty"]], out)[1], "info does not say that a log is empty")
    check_one_line([play, logs["empty"]], out, "empty.lcm", "there is nothing in this log")
    check_one_line([play, good, "--speed", "fast"], out, "--speed", "fast")
    for script in (play, record):
        check_one_line([script, good if script == play else folder / "new.lcm", "--channels", "["], out, "regular expression")
    check_one_line([record, good], out, "exists")
    closed = folder / "closed"
    closed.mkdir(mode=0o500)
    check_one_line([record, closed / "new.lcm"], out, "cannot write", "closed")
    check_one_line([record, logs["text"] / "new.lcm"], out, "cannot write", "text.lcm")

    disk = folder / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=100k", "none", disk], check=True)
    try:
        for verb in ("cut", "filter", "bop", "replay"):
            words = [*VERBS[verb], *(["--keep-inputs"] if verb == "replay" else [])]
            check_one_line([vantage, *words, good], disk / "out", "is the disk full?")
        recorder = subprocess.Popen([record, disk / "new.lcm"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for _ in range(30):
            if recorder.poll() is None:
                subprocess.run([play, good], check=True, stdout=subprocess.DEVNULL)
        check(recorder.wait(20) != 0, "a recorder on a full disk ends well")
        said = recorder.stderr.read()
        check("No space left" in said and said.count("\n") == 1, f"a recorder on a full disk says: {said}")
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def main():
    with tempfile.TemporaryDirectory(prefix="vantage-") as folder:
        globals()[f"test_{sys.argv[1]}"](Path(folder))


main()
