-- What rules about falls rest on. Rows are only ever added: the newest answers count, and of each measure the newest
-- value, so that what was known at any time can be found again.

CREATE TABLE questionnaires (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    answers TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX questionnaires_of_patient ON questionnaires (patient_id, id);

CREATE TABLE measurements (
    id BLOB NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    organisation_id BLOB NOT NULL REFERENCES organisations (id),
    patient_id BLOB NOT NULL REFERENCES patients (id),
    created_by BLOB NOT NULL REFERENCES clients (id),
    measured_at INTEGER NOT NULL,
    measures TEXT NOT NULL,
    created_at INTEGER NOT NULL
) STRICT;
CREATE INDEX measurements_of_patient ON measurements (patient_id, measured_at, id);
