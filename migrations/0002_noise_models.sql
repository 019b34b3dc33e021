-- Trained noise models. A job makes at most one; `document` is the model as JSON and `sha256` the digest of exactly these
-- bytes. A name gets a further version with every training; a row never changes.
CREATE TABLE noise_models (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    job_id BLOB NOT NULL UNIQUE REFERENCES jobs (id),
    name TEXT NOT NULL,
    version INTEGER NOT NULL CHECK (version > 0),
    sha256 TEXT NOT NULL CHECK (length(sha256) = 64),
    document TEXT NOT NULL,
    created_at INTEGER NOT NULL,
    UNIQUE (organisation_id, name, version)
) STRICT;
CREATE INDEX noise_models_of_organisation ON noise_models (organisation_id, id);

-- The noise model of the sensor that a session is recorded with, as settings name it; the first assessment of each of its
-- recordings takes it.
ALTER TABLE sessions ADD COLUMN noise_model TEXT;
