-- Uploads that go on where they broke off. `id` is text because the protocol names uploads by text; `protocol_state` is what the
-- protocol knows of an upload while it is received, and goes with the last byte: it holds what the client calls its file.
-- `problem` says why a recording was refused. A row stays for a while after the upload is over, so that its client can ask.
CREATE TABLE resumable_uploads (
    id TEXT NOT NULL PRIMARY KEY,
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    session_id BLOB NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
    created_by BLOB NOT NULL REFERENCES clients (id),
    state TEXT NOT NULL CHECK (state IN ('receiving', 'stored', 'refused', 'expired')),
    length_bytes INTEGER,
    received_bytes INTEGER NOT NULL CHECK (received_bytes >= 0),
    protocol_state TEXT,
    recording_id BLOB REFERENCES recordings (id) ON DELETE CASCADE,
    job_id BLOB REFERENCES jobs (id) ON DELETE CASCADE,
    problem TEXT,
    created_at INTEGER NOT NULL,
    expires_at INTEGER NOT NULL,
    CHECK ((protocol_state IS NOT NULL) = (state = 'receiving')),
    CHECK ((job_id IS NOT NULL) = (state = 'stored')),
    CHECK ((problem IS NOT NULL) = (state = 'refused'))
) STRICT;
CREATE INDEX resumable_uploads_expiring ON resumable_uploads (expires_at);
CREATE INDEX resumable_uploads_of_session ON resumable_uploads (session_id);
CREATE INDEX resumable_uploads_of_recording ON resumable_uploads (recording_id) WHERE recording_id IS NOT NULL;
CREATE INDEX resumable_uploads_of_job ON resumable_uploads (job_id) WHERE job_id IS NOT NULL;
