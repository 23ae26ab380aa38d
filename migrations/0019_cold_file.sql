-- Ended sessions whose samples have left the database for a Parquet file in a directory.
-- A row is made before the file is, and removed after it, so that every file is known here.
-- It does not refer to the session, which is deleted first and resets `moved_at`.
CREATE TABLE cold_file (
    session  TEXT   PRIMARY KEY,
    asset    TEXT   NOT NULL,
    attempt  BIGINT NOT NULL,            -- from 1; each attempt to write has a path of its own
    path     TEXT   NOT NULL,            -- below the directory
    bytes    BIGINT NOT NULL,
    checksum TEXT   NOT NULL,            -- SHA-256, hexadecimal
    moved_at BIGINT                      -- NULL unless the file is the recording of a session
);
CREATE INDEX cold_file_unused ON cold_file (session) WHERE moved_at IS NULL;

-- What the chunks of such a session were, without their samples.
CREATE TABLE cold_chunk (
    session     TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    first_index BIGINT NOT NULL,
    n           BIGINT NOT NULL,
    min_t_s     DOUBLE PRECISION NOT NULL,
    max_t_s     DOUBLE PRECISION NOT NULL,
    PRIMARY KEY (session, first_index)
);
