-- What a patient has consented to. Rows are added; the one change is a withdrawal, which is for good.
CREATE TABLE consents (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    scope TEXT NOT NULL CHECK (scope IN ('assessment', 'research')),
    text_version TEXT NOT NULL,
    given_at INTEGER NOT NULL,
    expires_at INTEGER,
    withdrawn_at INTEGER,
    withdrawn_by BLOB REFERENCES clients (id),
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX consents_of_patient ON consents (patient_id, scope, id);

-- Who did or read what. Things are named by a keyed hash of their id, because an entry outlives what it is about: `audit_things`
-- says which id a hash stands for as long as the thing may be known. Each entry carries the hash of the one before.
CREATE TABLE audit_entries (
    sequence INTEGER NOT NULL PRIMARY KEY CHECK (sequence > 0),
    happened_at INTEGER NOT NULL,
    organisation_id BLOB,
    actor_kind TEXT NOT NULL,
    actor_id BLOB,
    actor_role TEXT NOT NULL,
    action TEXT NOT NULL,
    thing_kind TEXT NOT NULL,
    thing BLOB,
    made_kind TEXT NOT NULL,
    made BLOB,
    patient BLOB,
    status INTEGER NOT NULL,
    request_id TEXT NOT NULL,
    detail TEXT NOT NULL,
    previous_hash BLOB NOT NULL CHECK (length(previous_hash) = 32),
    hash BLOB NOT NULL CHECK (length(hash) = 32)
) STRICT;
CREATE INDEX audit_entries_of_organisation ON audit_entries (organisation_id, sequence);
CREATE INDEX audit_entries_of_patient ON audit_entries (patient, sequence);
CREATE INDEX audit_entries_by_time ON audit_entries (happened_at);

CREATE TABLE audit_things (
    hash BLOB NOT NULL PRIMARY KEY CHECK (length(hash) = 32),
    organisation_id BLOB NOT NULL,
    kind TEXT NOT NULL,
    id BLOB NOT NULL,
    patient BLOB
) STRICT;
CREATE INDEX audit_things_of_patient ON audit_things (patient);

-- The one row: the key of the hashes, and where the chain ends.
CREATE TABLE audit_state (
    id INTEGER NOT NULL PRIMARY KEY CHECK (id = 1),
    secret BLOB NOT NULL CHECK (length(secret) = 32),
    sequence INTEGER NOT NULL,
    hash BLOB NOT NULL CHECK (length(hash) = 32)
) STRICT;

-- Where the chain begins after retention has removed its oldest entries: sequence and hash of the last one removed.
CREATE TABLE audit_anchors (
    sequence INTEGER NOT NULL PRIMARY KEY,
    hash BLOB NOT NULL CHECK (length(hash) = 32),
    n_entries INTEGER NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;

CREATE TRIGGER audit_entries_do_not_change BEFORE UPDATE ON audit_entries
BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TRIGGER audit_entries_stay BEFORE DELETE ON audit_entries
WHEN NOT EXISTS (SELECT 1 FROM audit_anchors WHERE sequence >= OLD.sequence)
BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TRIGGER audit_anchors_do_not_change BEFORE UPDATE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;
CREATE TRIGGER audit_anchors_stay BEFORE DELETE ON audit_anchors
BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;

-- Patients that were erased, by the keyed hash of their id. `blobs` is what is still to be removed or was removed, as JSON;
-- `done_at` is null until nothing of the patient is left, and the next start goes on with those that are not done.
CREATE TABLE erasures (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient BLOB NOT NULL UNIQUE CHECK (length(patient) = 32),
    reason TEXT NOT NULL CHECK (reason IN ('request', 'retention', 'restore')),
    requested_by BLOB,
    removed TEXT NOT NULL,
    blobs TEXT NOT NULL,
    begun_at INTEGER NOT NULL,
    done_at INTEGER
) STRICT;

-- Since when the uploaded bytes are gone while the results stay; null while the bytes are there.
ALTER TABLE recordings ADD COLUMN content_removed_at INTEGER;
CREATE INDEX recordings_by_blob ON recordings (blob_key);
