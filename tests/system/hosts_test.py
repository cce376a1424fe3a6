"""A group on two hosts, two networks joined by a cable: the link is cut and mended. usage: hosts_test.py FOLDER_OF_PROGRAMS, as root
of a network of its own (in_network)."""
import os
import re
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
os.environ["VANTAGE_BIN"] = str(Path(sys.argv[1]).resolve())
os.environ["VANTAGE_OWN_NETWORK"] = "1"
LAUNCH = ROOT / "scripts" / "launch"
URL = "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=2097152"


def check(condition, text):
    if not condition:
        raise AssertionError(text)


def ip(*words, host=()):
    subprocess.run([*host, "ip", *words], check=True)


def wait_for(condition, what, timeout_s):
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if condition():
            return
        time.sleep(0.5)
    raise AssertionError(f"waited {timeout_s:.0f} s for {what}")


def views(store):
    """Of all objects of a model store."""
    if not store.is_file():
        return 0
    try:
        with sqlite3.connect(f"file:{store}?mode=ro", uri=True) as database:
            return database.execute("SELECT COUNT(*) FROM view").fetchone()[0]
    except sqlite3.Error:
        return 0


def messages_since(log, position):
    """{channel: messages} after a byte of an LCM log, and where it ends."""
    data = log.read_bytes()
    counts = {}
    while position + 28 <= len(data):
        channel_size, size = (int.from_bytes(data[position + at:position + at + 4], "big") for at in (20, 24))
        if position + 28 + channel_size + size > len(data):
            break
        channel = data[position + 28:position + 28 + channel_size].decode()
        counts[channel] = counts.get(channel, 0) + 1
        position += 28 + channel_size + size
    return counts, position


def two_hosts():
    """The command prefix of either host. The robot is a network of its own; the desk is the one this test runs in."""
    other = subprocess.Popen(["unshare", "-n", "sleep", "1000"])
    robot = ["nsenter", "-t", str(other.pid), "-n"]
    wait_for(lambda: os.readlink(f"/proc/{other.pid}/ns/net") != os.readlink("/proc/self/ns/net"), "the other network", 10.0)
    ip("route", "del", "224.0.0.0/4", "dev", "lo")
    ip("link", "add", "desk0", "type", "veth", "peer", "name", "robot0")
    ip("link", "set", "robot0", "netns", str(other.pid))
    for host, device, address in (((), "desk0", "10.0.0.1/24"), (robot, "robot0", "10.0.0.2/24")):
        ip("address", "add", address, "dev", device, host=host)
        ip("link", "set", "lo", "up", host=host)
        ip("link", "set", device, "up", host=host)
        ip("route", "add", "224.0.0.0/4", "dev", device, host=host)
    return other, robot


def test(folder):
    library = folder / "library.yaml"
    text = (ROOT / "config" / "library.yaml").read_text()
    for key, value in (("trials_per_view", 6), ("negatives_per_view", 2), ("max_attempts", 50)):
        text = re.sub(rf"^  {key}: \S+", f"  {key}: {value}", text, flags=re.MULTILINE)
    library.write_text(text)
    other, robot = two_hosts()
    hosts = {"desk": [], "robot": robot}
    recorder = None
    try:
        log = folder / "desk.lcm"
        recorder = subprocess.Popen([ROOT / "scripts" / "record", log, "--url", URL], stdout=subprocess.DEVNULL)
        for host, prefix in hosts.items():
            subprocess.run([*prefix, LAUNCH, "up", "two_hosts", "--host", host, "--library", library, "--dir", folder / host], check=True)
        status = subprocess.run([*robot, LAUNCH, "status", "two_hosts", "--dir", folder / "robot"], text=True, stdout=subprocess.PIPE, check=True)
        check(sorted(line.split()[0] for line in status.stdout.splitlines()) == ["link_robot", "mount", "recogniser", "sensor"], status.stdout)

        original, copy = folder / "desk" / "models.db", folder / "robot" / "copy.db"
        wait_for(lambda: views(original) >= 2, "two views on the desk", 120.0)
        wait_for(lambda: views(copy) >= 2, "their copies on the robot", 60.0)

        ip("link", "set", "desk0", "down")
        time.sleep(1.0)
        _, cut = messages_since(log, 0)
        time.sleep(4.0)
        lost, mended = messages_since(log, cut)
        check("SENSOR_DEPTH" not in lost, f"frames came through a cut link: {lost}")
        ip("link", "set", "desk0", "up")
        ip("route", "replace", "224.0.0.0/4", "dev", "desk0")
        before = views(original)
        wanted = ("SENSOR_COLOR", "SENSOR_DEPTH", "LEARNER_TRACK", "RECOGNISER_DETECTIONS", "LINK_CLOCK")
        wait_for(lambda: all(messages_since(log, mended)[0].get(channel, 0) >= 3 for channel in wanted), f"{wanted} after the cut", 60.0)
        wait_for(lambda: views(original) > before, "a view learned after the cut", 120.0)
        now = views(original)
        wait_for(lambda: views(copy) >= now, "its copy", 60.0)

        # One machine: the clocks are the same, and that is what must be found.
        said = re.findall(rb"robot ([+-][0-9.]+) ms \(([0-9.]+) ms on the way\)", log.read_bytes()[mended:])
        check(said, "the desk does not say how far the robot's clock is off")
        offset_ms, delay_ms = (float(word) for word in said[-1])
        check(abs(offset_ms) <= 0.5 * delay_ms + 0.1, f"an offset of {offset_ms} ms, {delay_ms} ms on the way")
        print(f"clock offset {offset_ms} ms, {delay_ms} ms on the way; {now} views on the desk, {views(copy)} on the robot")
        for host in hosts:
            for file in (folder / host / "logs").glob("*.log"):
                check("terminate" not in file.read_text(errors="replace"), f"{file.name} of {host} died")
    finally:
        for host, prefix in hosts.items():
            subprocess.run([*prefix, LAUNCH, "down", "two_hosts", "--dir", folder / host], check=False)
        if recorder:
            recorder.send_signal(signal.SIGINT)
            recorder.wait(20)
        other.terminate()
        other.wait(20)


def main():
    with tempfile.TemporaryDirectory(prefix="vantage-") as folder:
        try:
            test(Path(folder))
        except AssertionError as error:
            for file in sorted(Path(folder).glob("*/logs/*.log")):
                print(f"== {file.parent.parent.name} {file.name}\n{file.read_text(errors='replace')[-1000:]}")
            print(f"FAILED: {error}")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
