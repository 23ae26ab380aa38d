-- When an asset was deleted: from then on it is no longer seen, nor are its
-- sessions, while what is stored of it goes piece by piece. Its name is taken until
-- all of it is gone.
ALTER TABLE asset ADD COLUMN deleted_at BIGINT;
CREATE INDEX asset_deleted ON asset (name) WHERE deleted_at IS NOT NULL;

-- Counted up by a writer that connects anew, to see whether the database takes a
-- change.
INSERT INTO counter (name, value) VALUES ('probe', 0);
