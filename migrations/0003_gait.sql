-- Steps and contacts of an assessment of a walk, as JSON; null for other pipelines.
ALTER TABLE assessments ADD COLUMN gait TEXT;
