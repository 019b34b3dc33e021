"""Measures the service and prints Markdown; started by scripts/measure-service.sh, which says more."""

import datetime
import json
import os
import platform
import re
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import threading

from send import Load
from service import Service, simulate

BINARY = os.path.abspath(sys.argv[1])
HERE = os.path.dirname(os.path.abspath(__file__))
UNIQUE_GET, UNIQUE_POST = os.path.join(HERE, "unique_get.lua"), os.path.join(HERE, "unique_post.lua")
SECONDS_PER_ROW = int(os.environ.get("SECONDS_PER_ROW", "8"))
PICK_UPS = 60
# The text that makes uploads of one file differ: a field of a JSON recording, the library's name in an MCAP header.
JSON_MARK = "mark0000000000"


def main():
    work = tempfile.mkdtemp(prefix="surefoot-measure-")
    try:
        files = Files(work)
        print(f"Measured {datetime.datetime.now(datetime.timezone.utc):%Y-%m-%d %H:%M} UTC on {machine(work)}.\n")
        requests_per_second(work, files)
        memory(work, files)
        pick_up(work, files)
    finally:
        shutil.rmtree(work)


class Files:
    """The recordings that are sent."""

    def __init__(self, work):
        path = lambda name: os.path.join(work, name)
        self.small_json = json_recording(path("frames-600.json"), 600)
        self.ten_minutes = simulate(BINARY, path("ten-minutes.mcap"), 600, "--rate", "30")
        probe = os.path.getsize(self.ten_minutes) / 600
        self.mcap_10_mb = simulate(BINARY, path("10mb.mcap"), round(10e6 / probe))
        self.mcap_100_mb = simulate(BINARY, path("100mb.mcap"), round(100e6 / probe))
        ten_seconds = simulate(BINARY, path("ten-seconds.mcap"), 10)
        self.images_10_mb = padded(ten_seconds, path("images.mcap"), 10_000_000)
        self.mcap_mark = library(self.mcap_10_mb)
        for file in (self.mcap_10_mb, self.images_10_mb):
            drop_data_checksum(file)


def requests_per_second(work, files):
    print(f"Requests per second: wrk (for 10 MB: scripts/load/send.py) on the same machine, one thread, {SECONDS_PER_ROW} s")
    print("a row, every answer 2xx. No two uploads are alike, so each one is digested, inspected, written and synced;")
    print("without workers (0) its job only queues.\n")
    print("| request | connections | workers | requests/s | median latency, ms | p99, ms |")
    print("|---|---|---|---|---|---|")
    service = Service(BINARY, os.path.join(work, "rps"), log=os.path.join(work, "rps.log"))
    patient, session = service.new_session("P-001")
    uploaded = service.post(f"/v1/sessions/{session}/recordings", read(files.ten_minutes), "application/mcap")
    assessment = service.finished(uploaded["job"]["id"])["assessment_id"]
    channels = ",".join(service.get(f"/v1/assessments/{assessment}")["channels"][:19])
    series = f"/v1/assessments/{assessment}/series?channels={channels}"
    values = f"{series}&interval=false&flags=false"
    n, size = (lambda body: (json.loads(body)["n_in_range"], len(body)))(raw(service, values))
    full = len(raw(service, series))
    row("small GET: a patient", service, f"/v1/patients/{patient}", 16)
    for name, path in (
        (f"GET series: {n} x 19 values, JSON, {size / 1e6:.1f} MB", values),
        (f"GET series: {n} x 19 values, intervals and flags, JSON, {full / 1e6:.1f} MB", series),
    ):
        row(f"{name}; asked for before", service, path, 4)
        # A time range that begins before the recording does holds all of it, and makes the question a new one.
        row(f"{name}; each time another question", service, f"{path}&from_s=-1", 4, script=(UNIQUE_GET, service.key))
    service.stop()

    json_size = os.path.getsize(files.small_json) / 1e3
    uploads = [
        (f"POST 600-frame JSON recording, {json_size:.0f} kB", files.small_json, "application/json", JSON_MARK, 8),
        ("upload 10 MB MCAP, frames and references only", files.mcap_10_mb, "application/mcap", files.mcap_mark, 4),
        ("upload 10 MB MCAP, 10 s of frames and attachments", files.images_10_mb, "application/mcap", files.mcap_mark, 4),
    ]
    for name, file, content_type, mark, connections in uploads:
        for workers in (0, 2):
            data_dir = os.path.join(work, "upload")
            flags = ("--workers", str(workers))
            service = Service(BINARY, data_dir, log=os.path.join(work, "upload.log"), flags=flags)
            _, session = service.new_session("P-001")
            path = f"/v1/sessions/{session}/recordings"
            if os.path.getsize(file) < 1e6:
                script = (UNIQUE_POST, file, content_type, service.key, mark)
                row(name, service, path, connections, workers, script)
            else:
                load = Load(service, path, content_type, read(file), mark.encode(), connections, SECONDS_PER_ROW)
                print_row(name, connections, workers, load.rate, load.percentile(50), load.percentile(99))
            service.kill()
            shutil.rmtree(data_dir)


def row(name, service, path, connections, workers=2, script=None):
    command = ["wrk", "-t1", f"-c{connections}", f"-d{SECONDS_PER_ROW}s", "--timeout", "60s", "--latency"]
    if script is None:
        command += ["-H", f"Authorization: Bearer {service.key}", service.address + path]
    else:
        command += ["-s", script[0], service.address + path, "--", *script[1:]]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rate = float(re.search(r"Requests/sec:\s+([\d.]+)", said)[1])
    refused = re.search(r"Non-2xx or 3xx responses: (\d+)", said) or re.search(r"Socket errors: .*", said)
    if refused:
        raise SystemExit(f"{name}: {refused[0]}\n{said}")
    p50, p99 = (milliseconds(re.search(rf"\s{p}%\s+([\d.]+)(us|ms|s)", said)) for p in (50, 99))
    print_row(name, connections, workers, rate, p50, p99)


def print_row(name, connections, workers, rate, p50, p99):
    digits = 0 if rate >= 100 else 1
    print(f"| {name} | {connections} | {workers} | {rate:.{digits}f} | {p50:.1f} | {p99:.1f} |", flush=True)


def milliseconds(found):
    return float(found[1]) * {"us": 1e-3, "ms": 1, "s": 1e3}[found[2]]


def memory(work, files):
    size = os.path.getsize(files.mcap_100_mb)
    print(f"\nResident memory of the server around one upload of {size / 1e6:.0f} MB MCAP, MB.\n")
    print("| workers | idle | highest during the upload | difference | highest while the job ran |")
    print("|---|---|---|---|---|")
    for workers in (0, 2):
        data_dir = os.path.join(work, f"memory-{workers}")
        service = Service(BINARY, data_dir, log=os.path.join(work, "memory.log"), flags=("--workers", str(workers)))
        _, session = service.new_session("P-001")
        idle = service.memory_mb()
        # The answer comes before a worker has more than begun, but the peak is read only after it.
        highest = Highest(service)
        with open(files.mcap_100_mb, "rb") as body:
            uploaded = service.post(f"/v1/sessions/{session}/recordings", body, "application/mcap")
        peak = highest.end()
        after = "-"
        if workers:
            job = service.finished(uploaded["job"]["id"], pause_s=0.2)
            after = f"{service.memory_mb('VmHWM'):.0f} ({job['state']})"
        print(f"| {workers} | {idle:.0f} | {peak:.0f} | {peak - idle:.0f} | {after} |", flush=True)
        service.stop()
        shutil.rmtree(data_dir)


class Highest:
    """Watches the resident memory."""

    def __init__(self, service):
        self.service, self.highest, self.over = service, 0.0, threading.Event()
        self.thread = threading.Thread(target=self._watch)
        self.thread.start()

    def _watch(self):
        while not self.over.wait(0.005):
            self.highest = max(self.highest, self.service.memory_mb())

    def end(self):
        """The highest so far."""
        self.over.set()
        self.thread.join()
        return self.highest


def pick_up(work, files):
    data_dir = os.path.join(work, "pick-up")
    service = Service(BINARY, data_dir, log=os.path.join(work, "pick-up.log"))
    _, session = service.new_session("P-001")
    template = read(files.small_json)
    waits = []
    for i in range(PICK_UPS):
        body = template.replace(JSON_MARK.encode(), f"mark{i:010d}".encode())
        job = service.post(f"/v1/sessions/{session}/recordings", body)["job"]
        over = service.finished(job["id"])
        waits.append((moment(over["started_at"]) - moment(over["queued_at"])).total_seconds() * 1e3)
    service.stop()
    waits.sort()
    p95 = waits[int(0.95 * (len(waits) - 1))]
    print(f"\nJob pick-up, {PICK_UPS} uploads one after another (600 frames each), from `queued_at`, which lies before")
    print("the upload's commit, to `started_at`, in whole milliseconds.\n")
    print("| p50, ms | p95, ms | longest, ms |")
    print("|---|---|---|")
    print(f"| {statistics.median(waits):.1f} | {p95:.1f} | {waits[-1]:.1f} |")


def moment(text):
    # Python 3.10 wants exactly three or six decimals.
    whole, _, fraction = text.rstrip("Z").partition(".")
    return datetime.datetime.fromisoformat(f"{whole}.{fraction.ljust(6, '0')}")


def raw(service, path):
    _, content = service.request("GET", path)
    return json.dumps(content, separators=(",", ":")).encode()


def read(path):
    with open(path, "rb") as file:
        return file.read()


def json_recording(path, frames):
    """What an app would send: positions in millimetres and confidence, nothing else."""
    simulate(BINARY, path, frames / 30, "--rate", "30")
    with open(path, encoding="utf-8") as file:
        document = json.load(file)
    document.pop("references", None)
    document["header"]["protocol"] = JSON_MARK
    for frame in document["frames"]:
        frame.pop("orientations", None)
        frame["positions"] = [p and [round(x, 3) for x in p] for p in frame["positions"]]
    with open(path, "w", encoding="utf-8") as file:
        json.dump(document, file, separators=(",", ":"))
    return path


def records(content):
    """Opcode, place and length of each top-level record of an MCAP file."""
    place = 8
    while place < len(content) - 8:
        opcode, length = struct.unpack_from("<BQ", content, place)
        yield opcode, place + 9, length
        place += 9 + length


def library(path):
    """The name of the writing library, the second text of the header."""
    content = read(path)
    _, place, _ = next(records(content))
    profile = struct.unpack_from("<I", content, place)[0]
    place += 4 + profile
    length = struct.unpack_from("<I", content, place)[0]
    return content[place + 4 : place + 4 + length].decode()


def drop_data_checksum(path):
    """Sets the checksum over the data section to "none": the mark in the header lies within it."""
    content = bytearray(read(path))
    for opcode, place, length in records(bytes(content)):
        if opcode == 0x0F:
            content[place : place + length] = bytes(length)
    with open(path, "wb") as file:
        file.write(content)


def padded(source, path, size):
    """A recording that is mostly data of the client's own: attachments of 256 KiB fill it up to about `size` bytes."""
    content = read(source)
    data_end = next(place - 9 for opcode, place, _ in records(content) if opcode == 0x0F)
    texts = b"".join(struct.pack("<I", len(text)) + text for text in (b"image", b"application/octet-stream"))
    attachments = bytearray()
    while len(content) + len(attachments) < size:
        fill = os.urandom(256 << 10)
        body = struct.pack("<QQ", 0, 0) + texts + struct.pack("<Q", len(fill)) + fill + struct.pack("<I", 0)
        attachments += struct.pack("<BQ", 0x09, len(body)) + body
    with open(path, "wb") as file:
        # The check sum of the data section would be another; 0 says that there is none.
        file.write(content[:data_end] + attachments + content[data_end : data_end + 9] + bytes(4) + content[data_end + 13 :])
    return path


def machine(work):
    with open("/proc/cpuinfo") as cpuinfo:
        model = next((line.split(":", 1)[1].strip() for line in cpuinfo if line.startswith("model name")), "unknown")
    disk = subprocess.run(["stat", "-f", "-c", "%T", work], capture_output=True, text=True).stdout.strip()
    load = os.getloadavg()[0]
    return (
        f"{os.cpu_count()} cores {model}, {platform.system()} {platform.release()}, "
        f"data on {disk}, load before {load:.1f}"
    )


if __name__ == "__main__":
    main()
