-- Conventions: ids are UUID v7 as 16-byte BLOB (they sort by time); wall-clock times are integer milliseconds since
-- 1970 UTC and end in `_at`; times on a recording's own clock are integer nanoseconds and end in `_ns`; structured
-- values that are never searched are JSON in TEXT. Every row that a client can list carries its organisation, so that a
-- page is read off one index, however many organisations there are.

CREATE TABLE organisations (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    name TEXT NOT NULL UNIQUE,
    created_at INTEGER NOT NULL
) STRICT;

CREATE TABLE clients (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    role TEXT NOT NULL CHECK (role IN ('device', 'clinician', 'admin')),
    label TEXT NOT NULL,
    key_sha256 BLOB NOT NULL UNIQUE CHECK (length(key_sha256) = 32),
    created_at INTEGER NOT NULL,
    revoked_at INTEGER,
    last_used_at INTEGER
) STRICT;
CREATE INDEX clients_of_organisation ON clients (organisation_id, id);

CREATE TABLE patients (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    pseudonym TEXT NOT NULL,
    birth_year INTEGER,
    sex TEXT CHECK (sex IN ('female', 'male', 'other')),
    height_m REAL,
    uses_walking_aid INTEGER CHECK (uses_walking_aid IN (0, 1)),
    created_at INTEGER NOT NULL,
    UNIQUE (organisation_id, pseudonym)
) STRICT;
CREATE INDEX patients_of_organisation ON patients (organisation_id, id);

CREATE TABLE sessions (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    started_at INTEGER NOT NULL,
    protocol TEXT,
    notes TEXT,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX sessions_of_organisation ON sessions (organisation_id, id);
CREATE INDEX sessions_of_patient ON sessions (patient_id, id);
CREATE INDEX sessions_of_client ON sessions (created_by, id);

CREATE TABLE recordings (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    session_id BLOB NOT NULL REFERENCES sessions (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    size_bytes INTEGER NOT NULL CHECK (size_bytes >= 0),
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    blob_key TEXT NOT NULL,
    inspection TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX recordings_of_organisation ON recordings (organisation_id, id);
CREATE INDEX recordings_of_session ON recordings (session_id, id);

-- `due_at` is when a claim may take the job: the end of the back-off while it is queued, the end of the lease while it
-- runs, null once it is over. One column and one index serve the claim, whatever the job waits for.
CREATE TABLE jobs (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    recording_id BLOB NOT NULL REFERENCES recordings (id),
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    attempt INTEGER NOT NULL DEFAULT 0 CHECK (attempt >= 0),
    max_attempts INTEGER NOT NULL CHECK (max_attempts > 0),
    due_at INTEGER CHECK ((due_at IS NULL) = (state IN ('done', 'failed', 'cancelled'))),
    worker TEXT,
    cancel_requested INTEGER NOT NULL DEFAULT 0 CHECK (cancel_requested IN (0, 1)),
    progress_step TEXT NOT NULL DEFAULT 'waiting',
    progress_done INTEGER NOT NULL DEFAULT 0,
    progress_total INTEGER NOT NULL DEFAULT 0,
    settings TEXT NOT NULL,
    error TEXT,
    queued_at INTEGER NOT NULL,
    started_at INTEGER,
    finished_at INTEGER
) STRICT;
CREATE INDEX jobs_due ON jobs (due_at, id) WHERE due_at IS NOT NULL;
CREATE INDEX jobs_leased ON jobs (due_at) WHERE state = 'running';
CREATE INDEX jobs_of_organisation ON jobs (organisation_id, id);
CREATE INDEX jobs_of_recording ON jobs (recording_id, id);

CREATE TABLE assessments (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    recording_id BLOB NOT NULL REFERENCES recordings (id),
    job_id BLOB NOT NULL UNIQUE REFERENCES jobs (id),
    pipeline TEXT NOT NULL,
    method TEXT NOT NULL,
    channels TEXT NOT NULL,
    summary TEXT NOT NULL,
    quality TEXT NOT NULL,
    provenance TEXT NOT NULL,
    n_samples INTEGER NOT NULL,
    start_time_ns INTEGER,
    end_time_ns INTEGER,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX assessments_of_organisation ON assessments (organisation_id, id);
CREATE INDEX assessments_of_recording ON assessments (recording_id, id);

-- Sample times, in chunks of 4096: differences as zstd.
CREATE TABLE time_chunks (
    assessment_id BLOB NOT NULL REFERENCES assessments (id),
    chunk INTEGER NOT NULL,
    n_samples INTEGER NOT NULL,
    first_ns INTEGER NOT NULL,
    last_ns INTEGER NOT NULL,
    time BLOB NOT NULL,
    PRIMARY KEY (assessment_id, chunk)
) STRICT;

-- One row per channel and chunk of 4096 samples. The parts stand in one row so that a read of many channels takes few
-- rows; a part that was not asked for is not read.
CREATE TABLE series_chunks (
    assessment_id BLOB NOT NULL REFERENCES assessments (id),
    channel INTEGER NOT NULL,
    chunk INTEGER NOT NULL,
    value_min REAL,
    value_max REAL,
    value BLOB NOT NULL,
    low BLOB NOT NULL,
    high BLOB NOT NULL,
    flags BLOB NOT NULL,
    PRIMARY KEY (assessment_id, channel, chunk)
) STRICT;

-- The answers to requests that may be sent twice, kept until `expires_at`.
CREATE TABLE idempotency_keys (
    client_id BLOB NOT NULL REFERENCES clients (id),
    key TEXT NOT NULL,
    fingerprint TEXT NOT NULL,
    status INTEGER NOT NULL,
    headers TEXT NOT NULL,
    body BLOB NOT NULL,
    created_at INTEGER NOT NULL,
    expires_at INTEGER NOT NULL,
    PRIMARY KEY (client_id, key)
) STRICT;
CREATE INDEX idempotency_keys_expiring ON idempotency_keys (expires_at);
