-- What a patient has consented to. Rows are added; the one change is a withdrawal, which is for good.
CREATE TABLE consents (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient_id UUID NOT NULL REFERENCES patients (id),
    created_by UUID NOT NULL REFERENCES clients (id),
    scope TEXT NOT NULL CHECK (scope IN ('assessment', 'research')),
    text_version TEXT NOT NULL,
    given_at BIGINT NOT NULL,
    expires_at BIGINT,
    withdrawn_at BIGINT,
    withdrawn_by UUID REFERENCES clients (id),
    created_at BIGINT NOT NULL
);
CREATE INDEX consents_of_patient ON consents (patient_id, scope, id);

-- Who did or read what. Things are named by a keyed hash of their id, because an entry outlives what it is about: `audit_things`
-- says which id a hash stands for as long as the thing may be known. Each entry carries the hash of the one before.
CREATE TABLE audit_entries (
    sequence BIGINT NOT NULL PRIMARY KEY CHECK (sequence > 0),
    happened_at BIGINT NOT NULL,
    organisation_id UUID,
    actor_kind TEXT NOT NULL,
    actor_id UUID,
    actor_role TEXT NOT NULL,
    action TEXT NOT NULL,
    thing_kind TEXT NOT NULL,
    thing BYTEA,
    made_kind TEXT NOT NULL,
    made BYTEA,
    patient BYTEA,
    status BIGINT NOT NULL,
    request_id TEXT NOT NULL,
    detail TEXT NOT NULL,
    previous_hash BYTEA NOT NULL CHECK (length(previous_hash) = 32),
    hash BYTEA NOT NULL CHECK (length(hash) = 32)
);
CREATE INDEX audit_entries_of_organisation ON audit_entries (organisation_id, sequence);
CREATE INDEX audit_entries_of_patient ON audit_entries (patient, sequence);
CREATE INDEX audit_entries_by_time ON audit_entries (happened_at);

CREATE TABLE audit_things (
    hash BYTEA NOT NULL PRIMARY KEY CHECK (length(hash) = 32),
    organisation_id UUID NOT NULL,
    kind TEXT NOT NULL,
    id UUID NOT NULL,
    patient BYTEA
);
CREATE INDEX audit_things_of_patient ON audit_things (patient);

-- The one row: the key of the hashes, and where the chain ends.
CREATE TABLE audit_state (
    id BIGINT NOT NULL PRIMARY KEY CHECK (id = 1),
    secret BYTEA NOT NULL CHECK (length(secret) = 32),
    sequence BIGINT NOT NULL,
    hash BYTEA NOT NULL CHECK (length(hash) = 32)
);

-- Where the chain begins after retention has removed its oldest entries: sequence and hash of the last one removed.
CREATE TABLE audit_anchors (
    sequence BIGINT NOT NULL PRIMARY KEY,
    hash BYTEA NOT NULL CHECK (length(hash) = 32),
    n_entries BIGINT NOT NULL,
    created_at BIGINT NOT NULL
);

CREATE FUNCTION audit_is_append_only() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'the audit log is append-only';
END $$;
CREATE FUNCTION audit_entry_stays() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF NOT EXISTS (SELECT 1 FROM audit_anchors WHERE sequence >= OLD.sequence) THEN
        RAISE EXCEPTION 'the audit log is append-only';
    END IF;
    RETURN OLD;
END $$;
CREATE TRIGGER audit_entries_do_not_change BEFORE UPDATE ON audit_entries
FOR EACH ROW EXECUTE FUNCTION audit_is_append_only();
CREATE TRIGGER audit_entries_stay BEFORE DELETE ON audit_entries FOR EACH ROW EXECUTE FUNCTION audit_entry_stays();
CREATE TRIGGER audit_anchors_do_not_change BEFORE UPDATE ON audit_anchors
FOR EACH ROW EXECUTE FUNCTION audit_is_append_only();
CREATE TRIGGER audit_anchors_stay BEFORE DELETE ON audit_anchors FOR EACH ROW EXECUTE FUNCTION audit_is_append_only();

-- Patients that were erased, by the keyed hash of their id. `blobs` is what is still to be removed or was removed, as JSON;
-- `done_at` is null until nothing of the patient is left, and the next start goes on with those that are not done.
CREATE TABLE erasures (
    id UUID NOT NULL PRIMARY KEY,
    organisation_id UUID NOT NULL REFERENCES organisations (id),
    patient BYTEA NOT NULL UNIQUE CHECK (length(patient) = 32),
    reason TEXT NOT NULL CHECK (reason IN ('request', 'retention', 'restore')),
    requested_by UUID,
    removed TEXT NOT NULL,
    blobs TEXT NOT NULL,
    begun_at BIGINT NOT NULL,
    done_at BIGINT
);

-- Since when the uploaded bytes are gone while the results stay; null while the bytes are there.
ALTER TABLE recordings ADD COLUMN content_removed_at BIGINT;
CREATE INDEX recordings_by_blob ON recordings (blob_key);
