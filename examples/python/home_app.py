#!/usr/bin/env python3
# SPDX-License-Identifier: MIT OR Apache-2.0
"""What a home app does: record, upload, wait, show the report.

    pip install mcap
    surefoot serve &                       # prints an address and a key
    python3 home_app.py http://127.0.0.1:8080 surefoot_…

The recording is the one of `write_recording.py`: a stick figure that does three squats. The key is a clinician's or an
administrator's here, because a device's may not read reports.
"""

import os
import sys
import tempfile
import time

import write_recording
from surefoot_client import Client, Problem


def record(path):
    """Writes a recording; put your sensor here."""
    write_recording.main(path)


def ask_for_consent():
    """What the patient has agreed to; put your text and your signature pad here. Without it the service takes no recording."""
    return {"scope": "assessment", "text_version": "example 1"}


def show(report):
    """Prints what a clinician looks at first."""
    counts = report["counts"]
    print(f"\nReport of {report['patient']['pseudonym']} as of {report['as_of']}")
    print("  rules: " + ", ".join(f"{number} {status.replace('_', ' ')}" for status, number in counts.items()))
    for finding in report["findings"]:
        if finding["status"] in ("positive", "indeterminate"):
            print(f"  {finding['status']:>13}: {finding['statement']} ({finding['citation']})")
    for measure in report["measures"]:
        side = f" ({measure['side']})" if measure["side"] else ""
        error = f" ± {1.96 * measure['standard_error']:.2g}" if measure["standard_error"] else ""
        print(f"  {measure['title']}{side}: {measure['value']:.3g}{error} {measure['unit']}")
    for needed in report["needed"][:3]:
        record_next = ", ".join(needed["record_protocols"])
        print(f"  {needed['rule_id']}: {needed['missing']}" + (f"; record {record_next}" if record_next else ""))
    print(f"  {report['caution']}")


def main(address, key):
    client = Client(address, key)
    patient = client.create_patient(
        body={"pseudonym": f"home-{time.time_ns()}", "birth_year": 1950, "uses_walking_aid": False, "height_m": 1.75}
    )
    consent = ask_for_consent()
    client.record_consent(id=patient["id"], body=consent)
    session = client.create_session(body={"patient_id": patient["id"], "protocol": "squat"})
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "squats.mcap")
        record(path)
        recording_id, job_id = client.upload_file(session["id"], path)
    print(f"uploaded: recording {recording_id}")
    progress = lambda job: print(f"  {job['state']}: {job['progress']['step']}", flush=True)
    assessment = client.read_assessment(id=client.follow(job_id, progress))
    performance = assessment["performance"]
    print(f"assessed: {performance['status']}, {len(performance['repetitions'])} repetitions {performance['reason']}")
    show(client.read_report(id=patient["id"]))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except Problem as problem:
        sys.exit(f"refused: {problem}")
