-- Who is signed in to the clinician's pages. Only the SHA-256 of the cookie's token is kept. A session is over at `expires_at`,
-- or an hour after it was last used, or when the client's key is revoked.
CREATE TABLE page_sessions (
    token_sha256 BLOB NOT NULL PRIMARY KEY CHECK (length(token_sha256) = 32),
    client_id BLOB NOT NULL REFERENCES clients (id),
    created_at INTEGER NOT NULL,
    last_used_at INTEGER NOT NULL,
    expires_at INTEGER NOT NULL
) STRICT;
CREATE INDEX page_sessions_expiring ON page_sessions (expires_at);
