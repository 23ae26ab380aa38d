-- Whether the session is a recording that is being imported. If the service stops before
-- the import is complete, the session is discarded at the next start.
ALTER TABLE session ADD COLUMN importing BIGINT NOT NULL DEFAULT 0;
