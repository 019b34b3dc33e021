"""Fills a data directory, then times backup while the service is read and written, restore, and doctor.

    python3 scripts/load/backup.py BINARY [GIGABYTES]        default: 1; recordings of 100 MB
"""

import pathlib
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from measure import padded  # noqa: E402
from service import Service, simulate  # noqa: E402

RECORDING_BYTES = 100_000_000


def main():
    binary, gigabytes = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        small = work / "small.mcap"
        simulate(binary, small, 10)
        service = Service(binary, work / "data")
        _, session = service.new_session("P-1")
        n = max(1, round(gigabytes * 1e9 / RECORDING_BYTES))
        for i in range(n):
            large = work / "large.mcap"
            padded(small, large, RECORDING_BYTES)
            service.post(f"/v1/sessions/{session}/recordings", large.read_bytes(), "application/mcap")
        print(f"{n} recordings of {RECORDING_BYTES // 1_000_000} MB are stored", flush=True)

        took, over = [], threading.Event()
        reader = threading.Thread(target=read, args=(service, over, took))
        reader.start()
        backup_s = timed(binary, "backup", work / "backup", "--data-dir", work / "data")
        over.set()
        reader.join()
        took.sort()
        print(f"backup: {backup_s:.1f} s; {len(took)} reads meanwhile, p99 {1e3 * took[int(0.99 * (len(took) - 1))]:.1f} ms")
        service.stop()
        restore_s = timed(binary, "restore", work / "backup", "--data-dir", work / "again", "--without-erasures")
        print(f"restore: {restore_s:.1f} s")
        print(f"doctor, every digest: {timed(binary, 'doctor', '--data-dir', work / 'again'):.1f} s")


def timed(binary, *arguments):
    began = time.monotonic()
    subprocess.run([binary, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began


def read(service, over, took):
    """Reads a list as an app does, until it is over."""
    while not over.is_set():
        began = time.monotonic()
        service.get("/v1/jobs?limit=20")
        took.append(time.monotonic() - began)
        time.sleep(0.01)


if __name__ == "__main__":
    main()
