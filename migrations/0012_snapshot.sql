-- The state of the engine of a session after its first `n_samples` samples, so that the
-- engine need not judge them again. Only a copy: the recording is what counts. A snapshot
-- of another `version` of the engine is not used. The last one of an open session is
-- replaced by the next, except the few with `kept` = 1.
CREATE TABLE snapshot (
    session   TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    n_samples BIGINT NOT NULL,
    kept      BIGINT NOT NULL,
    version   TEXT   NOT NULL,
    data      BYTEA  NOT NULL,           -- checksum and state (`src/store/snapshot.rs`)
    PRIMARY KEY (session, n_samples)
);
