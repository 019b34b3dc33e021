-- Who may do what: keys that end and are replaced, people with passwords or tokens, failed sign-ins, shared patients.

-- A client is whoever may act: the holder of a key, or a user. The key digest of a user is that of random bits that nobody
-- was ever told. After a rotation the key before opens until `previous_key_until`.
ALTER TABLE clients ADD COLUMN kind TEXT NOT NULL DEFAULT 'key' CHECK (kind IN ('key', 'user'));
ALTER TABLE clients ADD COLUMN expires_at INTEGER;
ALTER TABLE clients ADD COLUMN previous_key_sha256 BLOB;
ALTER TABLE clients ADD COLUMN previous_key_until INTEGER;
CREATE INDEX clients_by_previous_key ON clients (previous_key_sha256) WHERE previous_key_sha256 IS NOT NULL;

-- People. A local user has a name, unique in the installation, and a password (argon2id, PHC string); a user of an identity
-- provider is who a subject of an issuer is in an organisation. Role, label and end of use stand in the client's row.
CREATE TABLE users (
    id BLOB NOT NULL PRIMARY KEY REFERENCES clients (id),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    name TEXT UNIQUE,
    password_hash TEXT,
    must_change_password INTEGER NOT NULL DEFAULT 0 CHECK (must_change_password IN (0, 1)),
    password_changed_at INTEGER,
    issuer TEXT,
    subject TEXT,
    created_at INTEGER NOT NULL,
    UNIQUE (issuer, subject, organisation_id),
    CHECK ((name IS NULL) = (password_hash IS NULL)),
    CHECK ((issuer IS NULL) = (subject IS NULL)),
    CHECK ((name IS NULL) <> (issuer IS NULL))
) STRICT;
CREATE INDEX users_of_organisation ON users (organisation_id, id);

-- Failed sign-ins in a row, by the SHA-256 of whom they concern: a name, whether it is somebody's or not, or an address.
CREATE TABLE sign_in_failures (
    concerned_sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(concerned_sha256) = 32),
    failures INTEGER NOT NULL CHECK (failures > 0),
    last_at INTEGER NOT NULL,
    wait_until INTEGER NOT NULL
) STRICT;
CREATE INDEX sign_in_failures_by_time ON sign_in_failures (last_at);

-- One patient, readable to one clinician of another organisation until a time.
CREATE TABLE shares (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    receiver_id BLOB NOT NULL REFERENCES clients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    created_at INTEGER NOT NULL,
    expires_at INTEGER NOT NULL,
    revoked_at INTEGER
) STRICT;
CREATE INDEX shares_of_receiver ON shares (receiver_id, patient_id);
CREATE INDEX shares_of_patient ON shares (patient_id, id);
