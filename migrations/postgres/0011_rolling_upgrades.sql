-- While a service is upgraded, processes of the version before run beside the new ones. `oldest_migration` is the newest migration
-- that a process must know to use this schema: a migration that takes away or changes what older processes use raises it. `format` of
-- a job is what a worker must understand to do it.
CREATE TABLE schema_reach (
    id BIGINT NOT NULL PRIMARY KEY CHECK (id = 1),
    oldest_migration BIGINT NOT NULL
);
INSERT INTO schema_reach (id, oldest_migration) VALUES (1, 11);
ALTER TABLE jobs ADD COLUMN format BIGINT NOT NULL DEFAULT 1;
