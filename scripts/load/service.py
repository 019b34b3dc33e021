"""A service of its own for a script: a process on a free loopback port and its REST API."""

import http.client
import json
import os
import subprocess
import time


class Service:
    """One process of `surefoot serve` on a data directory."""

    def __init__(self, binary, data_dir, key=None, log=None, flags=(), environment=None):
        command = [binary, "serve", "--json", "--data-dir", data_dir, "--listen", "127.0.0.1:0", *flags]
        self.data_dir = data_dir
        self.log = open(log or os.devnull, "ab")
        # What is measured is the service and not its limits.
        unlimited = {"SUREFOOT_REQUESTS_PER_MINUTE": "0", "SUREFOOT_ANONYMOUS_REQUESTS_PER_MINUTE": "0"}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self.log, env={**os.environ, **unlimited, **(environment or {})}
        )
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the service did not start; its log is {log}")
        started = json.loads(line)
        self.address = started["address"]
        self.key = started["admin_key"] or key
        self.port = int(self.address.rsplit(":", 1)[1])

    def request(self, method, path, body=None, content_type="application/json", timeout=120, headers=None):
        """Status and body; JSON is parsed."""
        headers = {"Authorization": f"Bearer {self.key}", **(headers or {})}
        if body is not None:
            headers.setdefault("Content-Type", content_type)
        if isinstance(body, (dict, list)):
            body = json.dumps(body)
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        try:
            connection.request(method, path, body=body, headers=headers)
            answer = connection.getresponse()
            content = answer.read()
        finally:
            connection.close()
        is_json = "json" in (answer.getheader("content-type") or "")
        return answer.status, json.loads(content) if is_json else content

    def get(self, path):
        """The answer to a GET that must succeed."""
        return self._succeed("GET", path)

    def post(self, path, body, content_type="application/json"):
        """The answer to a POST that must succeed."""
        return self._succeed("POST", path, body, content_type)

    def _succeed(self, method, path, *rest):
        status, content = self.request(method, path, *rest)
        if status >= 300:
            raise SystemExit(f"{method} {path} was answered {status}: {content}")
        return content

    def new_session(self, pseudonym):
        """A new patient who consents, and a session of theirs; both ids."""
        patient = self.post("/v1/patients", {"pseudonym": pseudonym})["id"]
        self.post(f"/v1/patients/{patient}/consents", {"scope": "assessment", "text_version": "load"})
        return patient, self.post("/v1/sessions", {"patient_id": patient})["id"]

    def finished(self, job_id, timeout_s=600, pause_s=0.005):
        """The job once it is over."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            job = self.get(f"/v1/jobs/{job_id}")
            if job["state"] in ("done", "failed", "cancelled"):
                return job
            time.sleep(pause_s)
        raise SystemExit(f"job {job_id} was not over after {timeout_s} s")

    def memory_mb(self, field="VmRSS"):
        """Resident memory: VmRSS as it is, VmHWM at its highest. 1 MB is 10^6 bytes."""
        with open(f"/proc/{self.process.pid}/status") as status:
            line = next(line for line in status if line.startswith(field))
        return int(line.split()[1]) * 1024 / 1e6

    def kill(self):
        """Ends the process without warning, as a power cut would."""
        self.process.kill()
        self._gone()

    def stop(self):
        """Ends the process in order."""
        self.process.terminate()
        self._gone()

    def _gone(self):
        self.process.wait(timeout=60)
        self.process.stdout.close()
        self.log.close()


def simulate(binary, path, seconds, *flags):
    """A synthetic recording, written to `path`."""
    command = [binary, "simulate", "back_knee", "--seconds", str(seconds), "--out", path, *flags]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return path
