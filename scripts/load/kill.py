"""Kills the service in the midst of its work; started by scripts/kill-test.sh, which says more."""

import collections
import hashlib
import http.client
import os
import random
import shutil
import sys
import tempfile
import threading
import time

from service import Service, simulate

BINARY = os.path.abspath(sys.argv[1])
ROUNDS = int(sys.argv[2])
SEED = int(os.environ.get("SEED", "1"))
# Clients that upload at the same time.
CLIENTS = 3
# Longest life of a process before it is killed, seconds.
LONGEST_LIFE = 2.0
# Longest pause of a client between two uploads, seconds: the jobs must be done in bounded time.
LONGEST_PAUSE = 0.5
# After the last kill a job must end at least this often, seconds: a job of the longest recording takes a few.
PATIENCE = 30
# A kill counts as an attempt; with three a job that meets three kills would end as `worker_lost`, as it should.
ENVIRONMENT = {"SUREFOOT_LEASE_S": "1", "SUREFOOT_MAX_ATTEMPTS": "1000"}


def main():
    work = tempfile.mkdtemp(prefix="surefoot-kill-")
    try:
        failures = run(work)
    finally:
        shutil.rmtree(work)
    for failure in failures:
        print(f"FAILED: {failure}")
    raise SystemExit(1 if failures else 0)


def run(work):
    chance = random.Random(SEED)
    bodies = []
    for seed, seconds in ((1, 8), (2, 30), (3, 120)):
        path = simulate(BINARY, os.path.join(work, f"{seed}.mcap"), seconds, "--seed", str(seed))
        with open(path, "rb") as file:
            bodies.append(file.read())
    data_dir = os.path.join(work, "data")
    start = lambda key=None: Service(
        BINARY, data_dir, key=key, log=os.path.join(work, "service.log"), environment=ENVIRONMENT
    )
    service = start()
    key = service.key
    _, session = service.new_session("P-001")
    clients = [Client(session, bodies, chance.randrange(1 << 30)) for _ in range(CLIENTS)]
    for _ in range(ROUNDS):
        threads = [threading.Thread(target=client.upload_until_killed, args=(service,)) for client in clients]
        for thread in threads:
            thread.start()
        time.sleep(chance.uniform(0.0, LONGEST_LIFE))
        service.kill()
        for thread in threads:
            thread.join()
        service = start(key)
    left_over = os.listdir(os.path.join(data_dir, "parts"))
    acknowledged = {r: digest for client in clients for r, digest in client.acknowledged.items()}
    try:
        unknown = sum(client.broken + (client.unanswered is not None) for client in clients)
        return check(service, session, acknowledged, unknown, left_over)
    finally:
        service.stop()


class Client:
    """Uploads until its service dies; every second upload carries a key, with which it is repeated after the death."""

    def __init__(self, session, bodies, seed):
        self.session, self.bodies = session, bodies
        self.chance = random.Random(seed)
        self.acknowledged = {}
        self.unanswered = None
        # Uploads without a key that broke off; each may or may not be stored.
        self.broken = 0

    def upload_until_killed(self, service):
        while True:
            upload = self.unanswered or self.next_upload()
            self.unanswered = upload if upload[0] else None
            try:
                recording, digest = self.upload(service, *upload)
            except (OSError, http.client.HTTPException):
                self.broken += upload[0] is None
                return
            self.unanswered = None
            self.acknowledged[recording] = digest
            time.sleep(self.chance.uniform(0.0, LONGEST_PAUSE))

    def next_upload(self):
        key = f"{self.chance.getrandbits(64):016x}" if self.chance.random() < 0.5 else None
        return key, self.chance.choice(self.bodies)

    def upload(self, service, key, body):
        path = f"/v1/sessions/{self.session}/recordings"
        headers = {"Idempotency-Key": key} if key else {}
        status, answer = service.request("POST", path, body, "application/mcap", headers=headers)
        if status != 202:
            raise SystemExit(f"an upload was answered {status}: {answer}")
        return answer["recording"]["id"], hashlib.sha256(body).hexdigest()


def check(service, session, acknowledged, unknown, left_over):
    """What is wrong after the last start, in words."""
    failures = [f"part file {name} is left" for name in left_over]
    before, since = None, time.monotonic()
    while True:
        jobs = everything(service, "/v1/jobs?limit=200")
        unfinished = sum(job["state"] in ("queued", "running") for job in jobs)
        if unfinished != before:
            before, since = unfinished, time.monotonic()
        if not unfinished or time.monotonic() - since > PATIENCE:
            break
        time.sleep(0.2)
    failures += [f"job {job['id']} is {job['state']}" for job in jobs if job["state"] != "done"]

    recordings = {r["id"]: r for r in everything(service, f"/v1/sessions/{session}/recordings?limit=200")}
    jobs_of = collections.Counter(job["recording_id"] for job in jobs)
    assessments = everything(service, "/v1/assessments?limit=200")
    assessments_of = collections.Counter(assessment["job_id"] for assessment in assessments)
    failures += [f"recording {r} was acknowledged and is gone" for r in acknowledged if r not in recordings]
    failures += [f"recording {r} has {jobs_of[r]} jobs" for r in recordings if jobs_of[r] != 1]
    failures += [f"job {j['id']} has {assessments_of[j['id']]} assessments" for j in jobs if assessments_of[j["id"]] != 1]
    if len(recordings) > len(acknowledged) + unknown:
        failures.append(f"{len(recordings)} recordings of {len(acknowledged)} acknowledged and {unknown} broken uploads")
    for r, digest in acknowledged.items():
        if r in recordings and recordings[r]["sha256"] != digest:
            failures.append(f"recording {r} has other bytes than were sent")

    series = collections.defaultdict(set)
    for assessment in assessments:
        _, csv = service.request("GET", f"/v1/assessments/{assessment['id']}/series?format=csv")
        series[recordings[assessment["recording_id"]]["sha256"]].add(hashlib.sha256(csv).hexdigest())
    failures += [f"{digest} has {len(found)} different series" for digest, found in series.items() if len(found) != 1]
    for digest in series:
        stored = os.path.join(service.data_dir, "blobs", digest[:2], digest)
        with open(stored, "rb") as file:
            if hashlib.sha256(file.read()).hexdigest() != digest:
                failures.append(f"blob {digest} is damaged")

    again = sum(job["attempt"] > 1 for job in jobs)
    print(
        f"{ROUNDS} kills, seed {SEED}: {len(recordings)} recordings ({len(acknowledged)} acknowledged), {len(jobs)} jobs, "
        f"{again} of them begun more than once (at most {max((job['attempt'] for job in jobs), default=0)} times), "
        f"{len(assessments)} assessments, {len(series)} different series, {len(failures)} failures"
    )
    return failures


def everything(service, path):
    """All items of a list, page by page."""
    items = []
    while path:
        page = service.get(path)
        items += page["items"]
        path = page.get("next")
    return items


if __name__ == "__main__":
    main()
