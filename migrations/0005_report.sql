-- How the exercise or test of a recording was performed, as JSON; null in assessments that were made before it was measured.
ALTER TABLE assessments ADD COLUMN performance TEXT;

-- Where joints were: names as JSON, times as differences and positions frame by frame, both as zstd.
CREATE TABLE joint_tracks (
    assessment_id BLOB NOT NULL PRIMARY KEY REFERENCES assessments (id),
    joints TEXT NOT NULL,
    n_frames INTEGER NOT NULL CHECK (n_frames >= 0),
    time BLOB NOT NULL,
    positions BLOB NOT NULL
) STRICT;

-- Every value that was ever measured of a patient, whether by an assessment or entered by a person. `side` is empty for the
-- whole body, `definition` where a measure has one definition. Rows are only ever added; of a recording's assessments the newest counts.
CREATE TABLE measures (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    name TEXT NOT NULL,
    side TEXT NOT NULL DEFAULT '' CHECK (side IN ('', 'left', 'right')),
    value REAL NOT NULL,
    standard_error REAL,
    n_observations INTEGER,
    error_sd REAL,
    definition TEXT NOT NULL DEFAULT '',
    protocol TEXT,
    reason TEXT NOT NULL DEFAULT '',
    assessment_id BLOB REFERENCES assessments (id),
    recording_id BLOB REFERENCES recordings (id),
    session_id BLOB REFERENCES sessions (id),
    measurement_id BLOB REFERENCES measurements (id),
    measured_at INTEGER NOT NULL,
    created_at INTEGER NOT NULL,
    CHECK ((assessment_id IS NULL) <> (measurement_id IS NULL))
) STRICT;
CREATE INDEX measures_of_patient ON measures (patient_id, id);
CREATE INDEX measures_by_name ON measures (patient_id, name, side, definition, measured_at, id);

-- What had been entered before: ids after those of the measurements, so that their order stays.
INSERT INTO measures (id, organisation_id, patient_id, name, value, standard_error, n_observations, error_sd,
                      measurement_id, measured_at, created_at)
SELECT CAST(substr(m.id, 1, 8) || randomblob(8) AS BLOB), m.organisation_id, m.patient_id, one.key, one.value ->> '$.value',
       one.value ->> '$.standard_error', one.value ->> '$.n_observations', one.value ->> '$.error_sd',
       m.id, m.measured_at, m.created_at
FROM measurements m, json_each(m.measures) one;

-- What a patient is to train at home; the newest plan counts.
CREATE TABLE training_plans (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    plan TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX training_plans_of_patient ON training_plans (patient_id, id);

-- The report looks at what a patient did last by the time it was done.
CREATE INDEX sessions_of_patient_by_time ON sessions (patient_id, started_at);
