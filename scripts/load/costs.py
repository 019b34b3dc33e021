"""What a session of each kind costs: CPU time of upload and assessment, bytes of the recording, bytes of rows.

    python3 scripts/load/costs.py BINARY [SECONDS]        default: recordings of 60 s

CPU time is that of the whole process, so it does not depend on what else the machine does, but for caches.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from service import Service  # noqa: E402

KINDS = [
    ("joint angles, 30 frames/s", ["back_knee"]),
    ("camera and nine units, 256 Hz", ["kick", "--imu"]),
    ("walker, depth 640 x 480", ["walker"]),
]


def main():
    binary = sys.argv[1]
    seconds = sys.argv[2] if len(sys.argv) > 2 else "60"
    print("| session | CPU of the upload, s | CPU of the assessment, s | recording, MB | rows, MB |")
    print("|---|---|---|---|---|")
    for name, what in KINDS:
        with tempfile.TemporaryDirectory() as work:
            work = pathlib.Path(work)
            path = work / "recording.mcap"
            simulate = [binary, "simulate", *what, "--seconds", seconds, "--out", path]
            subprocess.run(simulate, check=True, stdout=subprocess.DEVNULL)
            # No worker at first, so that upload and assessment can be told apart.
            service = Service(binary, work / "data", flags=("--workers", "0"))
            (_, session), key = service.new_session("P-1"), service.key
            began = cpu_s(service)
            service.post(f"/v1/sessions/{session}/recordings", path.read_bytes(), "application/mcap")
            upload_s = cpu_s(service) - began
            service.stop()
            rows = database_bytes(work / "data")
            worker = Service(binary, work / "data", key=key, environment={"SUREFOOT_CANARY": "false"})
            began = cpu_s(worker)
            job = worker.get("/v1/jobs?limit=1")["items"][0]["id"]
            while worker.get(f"/v1/jobs/{job}")["state"] in ("queued", "running"):
                time.sleep(0.2)
            assessment_s = cpu_s(worker) - began
            assert worker.get(f"/v1/jobs/{job}")["state"] == "done"
            worker.stop()
            rows = database_bytes(work / "data") - rows
            print(f"| {name} | {upload_s:.2f} | {assessment_s:.2f} | {path.stat().st_size / 1e6:.1f} | {rows / 1e6:.1f} |", flush=True)


def cpu_s(service):
    """CPU time of a process so far, seconds."""
    fields = pathlib.Path(f"/proc/{service.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def database_bytes(data):
    """Bytes of the database and its log."""
    return sum(path.stat().st_size for path in data.glob("surefoot.sqlite*"))


if __name__ == "__main__":
    main()
