-- Whose turn a job is: `turn_at` is when it would be done if its organisation had the service to itself and let what costs less go
-- first. The claim takes what is due in this order. `expected_ms` is a guess of the computation, made when the job was asked for.
ALTER TABLE jobs ADD COLUMN expected_ms BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN turn_at BIGINT NOT NULL DEFAULT 0;
UPDATE jobs SET turn_at = queued_at;
DROP INDEX jobs_due;
CREATE INDEX jobs_by_turn ON jobs (turn_at, id) WHERE due_at IS NOT NULL;
CREATE INDEX jobs_waiting ON jobs (organisation_id, expected_ms) WHERE state = 'queued';
