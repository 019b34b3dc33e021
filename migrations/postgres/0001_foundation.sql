-- The same tables as SQLite's, as they were when PostgreSQL came: ids are UUID, truth values BOOLEAN, integers BIGINT. The other
-- conventions stand at the head of SQLite's first migration.

CREATE TABLE organisations (
    id UUID NOT NULL PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    created_at BIGINT NOT NULL
);

CREATE TABLE clients (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    role TEXT NOT NULL CHECK (role IN ('device', 'clinician', 'admin')),
    label TEXT NOT NULL,
    key_sha256 BYTEA NOT NULL UNIQUE CHECK (length(key_sha256) = 32),
    created_at BIGINT NOT NULL,
    revoked_at BIGINT,
    last_used_at BIGINT
);
CREATE INDEX clients_of_organisation ON clients (organisation_id, id);

CREATE TABLE patients (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    pseudonym TEXT NOT NULL,
    birth_year BIGINT,
    sex TEXT CHECK (sex IN ('female', 'male', 'other')),
    height_m DOUBLE PRECISION,
    uses_walking_aid BOOLEAN,
    created_at BIGINT NOT NULL,
    UNIQUE (organisation_id, pseudonym)
);
CREATE INDEX patients_of_organisation ON patients (organisation_id, id);

CREATE TABLE sessions (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    started_at BIGINT NOT NULL,
    protocol TEXT,
    notes TEXT,
    created_at BIGINT NOT NULL
);
CREATE INDEX sessions_of_organisation ON sessions (organisation_id, id);
CREATE INDEX sessions_of_patient ON sessions (patient_id, id);
CREATE INDEX sessions_of_client ON sessions (created_by, id);

CREATE TABLE recordings (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    session_id UUID NOT NULL REFERENCES sessions (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    size_bytes BIGINT NOT NULL CHECK (size_bytes >= 0),
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    blob_key TEXT NOT NULL,
    inspection TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX recordings_of_organisation ON recordings (organisation_id, id);
CREATE INDEX recordings_of_session ON recordings (session_id, id);

-- `due_at` is when a claim may take the job: the end of the back-off while it is queued, the end of the lease while it
-- runs, null once it is over. One column and one index serve the claim, whatever the job waits for.
CREATE TABLE jobs (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    recording_id UUID NOT NULL REFERENCES recordings (id),
    state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed', 'cancelled')),
    attempt BIGINT NOT NULL DEFAULT 0 CHECK (attempt >= 0),
    max_attempts BIGINT NOT NULL CHECK (max_attempts > 0),
    due_at BIGINT CHECK ((due_at IS NULL) = (state IN ('done', 'failed', 'cancelled'))),
    worker TEXT,
    cancel_requested BOOLEAN NOT NULL DEFAULT FALSE,
    progress_step TEXT NOT NULL DEFAULT 'waiting',
    progress_done BIGINT NOT NULL DEFAULT 0,
    progress_total BIGINT NOT NULL DEFAULT 0,
    settings TEXT NOT NULL,
    error TEXT,
    queued_at BIGINT NOT NULL,
    started_at BIGINT,
    finished_at BIGINT
);
CREATE INDEX jobs_due ON jobs (due_at, id) WHERE due_at IS NOT NULL;
CREATE INDEX jobs_leased ON jobs (due_at) WHERE state = 'running';
CREATE INDEX jobs_of_organisation ON jobs (organisation_id, id);
CREATE INDEX jobs_of_recording ON jobs (recording_id, id);

CREATE TABLE assessments (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    recording_id UUID NOT NULL REFERENCES recordings (id),
    job_id UUID NOT NULL UNIQUE REFERENCES jobs (id),
    pipeline TEXT NOT NULL,
    method TEXT NOT NULL,
    channels TEXT NOT NULL,
    summary TEXT NOT NULL,
    quality TEXT NOT NULL,
    provenance TEXT NOT NULL,
    n_samples BIGINT NOT NULL,
    start_time_ns BIGINT,
    end_time_ns BIGINT,
    created_at BIGINT NOT NULL
);
CREATE INDEX assessments_of_organisation ON assessments (organisation_id, id);
CREATE INDEX assessments_of_recording ON assessments (recording_id, id);

-- Sample times, in chunks of 4096: differences as zstd.
CREATE TABLE time_chunks (
    assessment_id UUID NOT NULL REFERENCES assessments (id),
    chunk BIGINT NOT NULL,
    n_samples BIGINT NOT NULL,
    first_ns BIGINT NOT NULL,
    last_ns BIGINT NOT NULL,
    time BYTEA NOT NULL,
    PRIMARY KEY (assessment_id, chunk)
);

-- One row per channel and chunk of 4096 samples. The parts stand in one row so that a read of many channels takes few
-- rows; a part that was not asked for is not read.
CREATE TABLE series_chunks (
    assessment_id UUID NOT NULL REFERENCES assessments (id),
    channel BIGINT NOT NULL,
    chunk BIGINT NOT NULL,
    value_min DOUBLE PRECISION,
    value_max DOUBLE PRECISION,
    value BYTEA NOT NULL,
    low BYTEA NOT NULL,
    high BYTEA NOT NULL,
    flags BYTEA NOT NULL,
    PRIMARY KEY (assessment_id, channel, chunk)
);

-- The answers to requests that may be sent twice, kept until `expires_at`.
CREATE TABLE idempotency_keys (
    client_id UUID NOT NULL REFERENCES clients (id),
    key TEXT NOT NULL,
    fingerprint TEXT NOT NULL,
    status BIGINT NOT NULL,
    headers TEXT NOT NULL,
    body BYTEA NOT NULL,
    created_at BIGINT NOT NULL,
    expires_at BIGINT NOT NULL,
    PRIMARY KEY (client_id, key)
);
CREATE INDEX idempotency_keys_expiring ON idempotency_keys (expires_at);

-- Trained noise models. A job makes at most one; `document` is the model as JSON and `sha256` the digest of exactly these
-- bytes. A name gets a further version with every training; a row never changes.
CREATE TABLE noise_models (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    job_id UUID NOT NULL UNIQUE REFERENCES jobs (id),
    name TEXT NOT NULL,
    version BIGINT NOT NULL CHECK (version > 0),
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    document TEXT NOT NULL,
    created_at BIGINT NOT NULL,
    UNIQUE (organisation_id, name, version)
);
CREATE INDEX noise_models_of_organisation ON noise_models (organisation_id, id);

-- The noise model of the sensor that a session is recorded with, as settings name it; the first assessment of each of its
-- recordings takes it.
ALTER TABLE sessions ADD COLUMN noise_model TEXT;

-- Steps and contacts of an assessment of a walk, as JSON; null for other pipelines.
ALTER TABLE assessments ADD COLUMN gait TEXT;

-- What rules about falls rest on. Rows are only ever added: the newest answers count, and of each measure the newest
-- value, so that what was known at any time can be found again.

CREATE TABLE questionnaires (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    answers TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX questionnaires_of_patient ON questionnaires (patient_id, id);

CREATE TABLE measurements (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    measured_at BIGINT NOT NULL,
    measures TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX measurements_of_patient ON measurements (patient_id, measured_at, id);

-- How the exercise or test of a recording was performed, as JSON; null in assessments that were made before it was measured.
ALTER TABLE assessments ADD COLUMN performance TEXT;

-- Where joints were: names as JSON, times as differences and positions frame by frame, both as zstd.
CREATE TABLE joint_tracks (
    assessment_id UUID NOT NULL PRIMARY KEY REFERENCES assessments (id),
    joints TEXT NOT NULL,
    n_frames BIGINT NOT NULL CHECK (n_frames >= 0),
    time BYTEA NOT NULL,
    positions BYTEA NOT NULL
);

-- Every value that was ever measured of a patient, whether by an assessment or entered by a person. `side` is empty for the
-- whole body, `definition` where a measure has one definition. Rows are only ever added; of a recording's assessments the newest counts.
CREATE TABLE measures (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    name TEXT NOT NULL,
    side TEXT NOT NULL DEFAULT '' CHECK (side IN ('', 'left', 'right')),
    value DOUBLE PRECISION NOT NULL,
    standard_error DOUBLE PRECISION,
    n_observations BIGINT,
    error_sd DOUBLE PRECISION,
    definition TEXT NOT NULL DEFAULT '',
    protocol TEXT,
    reason TEXT NOT NULL DEFAULT '',
    assessment_id UUID REFERENCES assessments (id),
    recording_id UUID REFERENCES recordings (id),
    session_id UUID REFERENCES sessions (id),
    measurement_id UUID REFERENCES measurements (id),
    measured_at BIGINT NOT NULL,
    created_at BIGINT NOT NULL,
    CHECK ((assessment_id IS NULL) <> (measurement_id IS NULL))
);
CREATE INDEX measures_of_patient ON measures (patient_id, id);
CREATE INDEX measures_by_name ON measures (patient_id, name, side, definition, measured_at, id);

-- What a patient is to train at home; the newest plan counts.
CREATE TABLE training_plans (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    plan TEXT NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX training_plans_of_patient ON training_plans (patient_id, id);

-- The report looks at what a patient did last by the time it was done.
CREATE INDEX sessions_of_patient_by_time ON sessions (patient_id, started_at);

-- Who is signed in to the clinician's pages. Only the SHA-256 of the cookie's token is kept. A session is over at `expires_at`,
-- or an hour after it was last used, or when the client's key is revoked.
CREATE TABLE page_sessions (
    token_sha256 BYTEA NOT NULL PRIMARY KEY CHECK (length(token_sha256) = 32),
    client_id UUID NOT NULL REFERENCES clients (id),
    created_at BIGINT NOT NULL,
    last_used_at BIGINT NOT NULL,
    expires_at BIGINT NOT NULL
);
CREATE INDEX page_sessions_expiring ON page_sessions (expires_at);
