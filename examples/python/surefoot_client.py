# SPDX-License-Identifier: MIT OR Apache-2.0
"""A client of the Surefoot API, made from its OpenAPI document: every operation is a method of its name.

    client = Client("http://127.0.0.1:8080", key)
    patient = client.create_patient(body={"pseudonym": "P-023"})
    client.record_consent(id=patient["id"], body={"scope": "assessment", "text_version": "2026-1"})
    client.read_report(id=patient["id"])

Parameters of path, query and header are given by their names (`-` as `_`). Needs nothing but Python.
"""

import json
import time
import urllib.error
import urllib.parse
import urllib.request

METHODS = ("get", "post", "put", "patch", "delete")


class Problem(Exception):
    """A refusal of the service: what was wrong, where, and what to do."""

    def __init__(self, document):
        super().__init__(f"{document['code']}: {document['detail']}")
        self.status = document["status"]
        self.code = document["code"]
        self.errors = document.get("errors", [])


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
            raise Problem(json.loads(error.read())) from None
        return json.loads(content) if kind.endswith("json") else content

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
