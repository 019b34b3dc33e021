# SPDX-License-Identifier: MIT OR Apache-2.0
"""A client of the Surefoot API, made from its OpenAPI document: every operation is a method of its name.

    client = Client("http://127.0.0.1:8080", key)
    patient = client.create_patient(body={"pseudonym": "P-023"})
    client.record_consent(id=patient["id"], body={"scope": "assessment", "text_version": "2026-1"})
    client.read_report(id=patient["id"])

`upload_file` brings a recording to a session, however bad the line is. Parameters of path, query and header are given by their names (`-` as `_`). Needs nothing but Python.
"""

import base64
import hashlib
import http.client
import json
import os
import time
import urllib.error
import urllib.parse
import urllib.request
import uuid

METHODS = ("get", "post", "put", "patch", "delete")
RESUME_ABOVE = 4 << 20
"""Recordings above this size, bytes, go in pieces that resume."""
PIECE_BYTES = 8 << 20
"""What one request carries at most, bytes."""
BROKEN = (urllib.error.URLError, http.client.HTTPException, ConnectionError, TimeoutError)
"""What a line that breaks raises."""


class Problem(Exception):
    """A refusal of the service: what was wrong, where, and what to do."""

    def __init__(self, document):
        super().__init__(f"{document['code']}: {document['detail']}")
        self.status = document["status"]
        self.code = document["code"]
        self.errors = document.get("errors", [])


def problem_of(error):
    """The problem that an answer holds; a proxy on the way may have written none."""
    content = error.read()
    try:
        return Problem(json.loads(content))
    except (ValueError, KeyError, TypeError):
        return Problem({"status": error.code, "code": "refused", "detail": str(error.reason)})


def persistently(request, attempts=10):
    """The answer to a request that may be sent again, also over a line that breaks."""
    for attempt in range(1, attempts + 1):
        try:
            return request()
        except BROKEN:
            if attempt == attempts:
                raise
            time.sleep(min(attempt, 5))


def digest_of(path):
    """SHA-256 of a file, hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


class Operation:
    """One operation of the document, ready to be called."""

    def __init__(self, client, method, path, description):
        self.client, self.method, self.path = client, method.upper(), path
        self.parameters = {p["name"].replace("-", "_"): p for p in description.get("parameters", [])}
        self.__doc__ = description.get("summary", "")

    def __call__(self, body=None, content_type="application/json", **arguments):
        path, query, headers = self.path, {}, {}
        for name, value in arguments.items():
            if name not in self.parameters:
                raise TypeError(f"{self.method} {self.path} has no parameter {name}; it has {sorted(self.parameters)}")
            parameter = self.parameters[name]
            if parameter["in"] == "path":
                path = path.replace("{%s}" % parameter["name"], urllib.parse.quote(str(value), safe=""))
            elif parameter["in"] == "header":
                headers[parameter["name"]] = str(value)
            else:
                query[parameter["name"]] = str(value).lower() if isinstance(value, bool) else value
        if query:
            path += "?" + urllib.parse.urlencode(query)
        if body is not None:
            headers["Content-Type"] = content_type
            body = body if isinstance(body, bytes) else json.dumps(body).encode()
        return self.client.request(self.method, path, body, headers)


class Client:
    """The service at an address, asked with a key."""

    def __init__(self, address, key, document=None):
        self.address, self.key = address.rstrip("/"), key
        self.document = document or self.request("GET", "/openapi.json")
        for path, item in self.document["paths"].items():
            for method in METHODS:
                if method in item:
                    setattr(self, item[method]["operationId"], Operation(self, method, path, item[method]))

    def request(self, method, path, body=None, headers=None):
        """Sends a request; the parsed answer, or bytes where the answer is no JSON."""
        request = urllib.request.Request(self.address + path, data=body, method=method, headers=headers or {})
        request.add_header("Authorization", f"Bearer {self.key}")
        try:
            with urllib.request.urlopen(request, timeout=300) as answer:
                content, kind = answer.read(), answer.headers.get_content_type()
        except urllib.error.HTTPError as error:
            raise problem_of(error) from None
        return json.loads(content) if kind.endswith("json") else content

    def upload_file(
        self, session_id, path, content_type="application/mcap", resume_above=RESUME_ABOVE, piece_bytes=PIECE_BYTES
    ):
        """Uploads a recording; the ids of the recording and of the job that assesses it.

        A small one is sent at once, and after a broken connection again under the same key; a large one goes on where it broke
        off. An app that may be killed itself keeps the id of `begin_upload` and goes on with `resume_upload`.
        """
        if os.path.getsize(path) > resume_above:
            return self.resume_upload(self.begin_upload(session_id, path, content_type), path, piece_bytes)
        with open(path, "rb") as file:
            content = file.read()
        key = str(uuid.uuid4())
        stored = persistently(
            lambda: self.upload_recording(
                id=session_id,
                body=content,
                content_type=content_type,
                X_Content_SHA256=hashlib.sha256(content).hexdigest(),
                Idempotency_Key=key,
            )
        )
        return stored["recording"]["id"], stored["job"]["id"]

    def begin_upload(self, session_id, path, content_type="application/mcap"):
        """Begins an upload that can resume; its id."""
        said = {"filetype": content_type, "sha256": digest_of(path)}
        said = ",".join(f"{key} {base64.b64encode(value.encode()).decode()}" for key, value in said.items())
        headers = {"Tus-Resumable": "1.0.0", "Upload-Length": str(os.path.getsize(path)), "Upload-Metadata": said}
        begin = lambda: self.request("POST", f"/v1/sessions/{session_id}/uploads", headers=headers)
        return persistently(begin)["id"]

    def resume_upload(self, upload_id, path, piece_bytes=PIECE_BYTES):
        """Goes on with an upload to its end; the ids of the recording and of the job that assesses it."""
        address, size = f"/v1/uploads/{upload_id}", os.path.getsize(path)
        with open(path, "rb") as file:
            while True:
                upload = persistently(lambda: self.request("GET", address))
                if upload["state"] == "refused":
                    raise Problem(upload["problem"])
                if upload["state"] == "stored":
                    return upload["recording_id"], upload["job_id"]
                at = upload["received_bytes"]
                if at < size:
                    file.seek(at)
                piece = file.read(piece_bytes) if at < size else b""
                headers = {"Content-Type": "application/offset+octet-stream", "Tus-Resumable": "1.0.0"}
                try:
                    self.request("PATCH", address, piece, headers | {"Upload-Offset": str(at)})
                except BROKEN:
                    time.sleep(1)
                except Problem as problem:
                    # Another number of bytes has arrived, or an earlier request is still being worked off: look again.
                    if problem.status not in (400, 408, 409, 423, 460, 503, 507):
                        raise
                    time.sleep(5 if problem.status in (503, 507) else 1)

    def follow(self, job_id, show=lambda job: None, every_s=0.5):
        """Waits for the end of a job; the id of its assessment.

        A job that failed raises its error: it says what to record differently.
        """
        while True:
            job = self.read_job(id=job_id)
            show(job)
            if job["state"] == "done":
                return job["assessment_id"]
            if job["state"] in ("failed", "cancelled"):
                error = job.get("error") or {"code": job["state"], "sentence": "the job was cancelled"}
                raise RuntimeError(f"{error['code']}: {error['sentence']}")
            time.sleep(every_s)
