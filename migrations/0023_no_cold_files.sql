-- Samples are in the database only. One that has samples in files is not migrated: with the
-- version before, make a backup, which has them all, and restore it; then migrate.
CREATE TABLE cold_data (
    n BIGINT NOT NULL CONSTRAINT back_up_and_restore_with_the_version_before CHECK (n = 0)
);
INSERT INTO cold_data (n) SELECT COUNT(*) FROM cold_file WHERE moved_at IS NOT NULL;
DROP TABLE cold_data;
DROP TABLE cold_chunk;
DROP TABLE cold_file;
