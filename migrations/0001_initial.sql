-- The whole of what the service keeps. One dialect for SQLite and PostgreSQL:
-- TEXT, BIGINT, DOUBLE PRECISION and BYTEA only (SQLite stores a blob in a
-- BYTEA column as it is), `$n` placeholders, no generated keys: ids come from
-- the writer. Moments are BIGINT microseconds since 1970-01-01 UTC.

CREATE TABLE asset (
    name       TEXT   PRIMARY KEY,
    document   TEXT   NOT NULL,          -- the asset file, JSON
    revision   BIGINT NOT NULL,
    created_at BIGINT NOT NULL,
    updated_at BIGINT NOT NULL
);

CREATE TABLE session (
    id           TEXT   PRIMARY KEY,     -- UUID v7
    asset        TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    name         TEXT   NOT NULL,
    state        TEXT   NOT NULL CHECK (state IN ('open', 'ended')),
    opened_at    BIGINT NOT NULL,
    ended_at     BIGINT,
    setup        TEXT   NOT NULL,        -- the asset file as of opening, JSON
    baseline     TEXT   NOT NULL,        -- the fault memory as of opening, JSON
    n_samples    BIGINT NOT NULL,
    n_rejected   BIGINT NOT NULL,
    first_t_s    DOUBLE PRECISION,
    last_t_s     DOUBLE PRECISION,
    last_seq     BIGINT,
    verdict      TEXT,                   -- JSON, once ended
    verdict_hash TEXT,
    UNIQUE (asset, name)
);
CREATE UNIQUE INDEX session_one_open ON session (asset) WHERE state = 'open';
CREATE INDEX session_by_opening ON session (opened_at, id);

-- A run of samples in order of arrival, columns compressed.
CREATE TABLE chunk (
    session     TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    first_index BIGINT NOT NULL,
    n           BIGINT NOT NULL,
    min_t_s     DOUBLE PRECISION NOT NULL,
    max_t_s     DOUBLE PRECISION NOT NULL,
    data        BYTEA  NOT NULL,
    PRIMARY KEY (session, first_index)
);

-- What people did: cleared or acknowledged a code. `after_index` is how many
-- samples of the session had been recorded by then.
CREATE TABLE action (
    id          BIGINT PRIMARY KEY,
    asset       TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    session     TEXT   REFERENCES session (id) ON DELETE CASCADE,
    after_index BIGINT NOT NULL,
    kind        TEXT   NOT NULL CHECK (kind IN ('clear', 'acknowledge')),
    code        TEXT   NOT NULL,
    actor       TEXT   NOT NULL,
    at          BIGINT NOT NULL
);
CREATE INDEX action_by_session ON action (session, after_index, id);

-- Changes of a code's status, in the order of their commits; `id` is the id
-- of the event.
CREATE TABLE transition (
    id       BIGINT PRIMARY KEY,
    asset    TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    session  TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    ordinal  BIGINT NOT NULL,
    t_s      DOUBLE PRECISION NOT NULL,
    code     TEXT   NOT NULL,
    status   TEXT   NOT NULL,
    at       BIGINT NOT NULL,
    document TEXT   NOT NULL,            -- the fault line, JSON
    UNIQUE (session, ordinal)
);
CREATE INDEX transition_by_asset ON transition (asset, id);

-- The fault memory as it stands, one row per asset and code.
CREATE TABLE fault (
    asset        TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    code         TEXT   NOT NULL,
    status       TEXT   NOT NULL,
    acknowledged BIGINT NOT NULL,
    changed_at   BIGINT NOT NULL,
    record       TEXT   NOT NULL,        -- JSON
    PRIMARY KEY (asset, code)
);
CREATE INDEX fault_by_change ON fault (changed_at, asset, code);

CREATE TABLE replay (
    id          TEXT   PRIMARY KEY,      -- UUID v7
    session     TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    state       TEXT   NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed')),
    settings    TEXT   NOT NULL,         -- JSON
    created_at  BIGINT NOT NULL,
    finished_at BIGINT,
    result      TEXT,                    -- JSON, once done
    error       TEXT
);

CREATE TABLE calibration (
    id         TEXT   PRIMARY KEY,       -- UUID v7
    asset      TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    state      TEXT   NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed')),
    sessions   TEXT   NOT NULL,          -- JSON array of session ids
    made_at    BIGINT NOT NULL,
    active     BIGINT NOT NULL,
    document   TEXT,                     -- the calibration section, JSON, once done
    error      TEXT
);
CREATE INDEX calibration_by_asset ON calibration (asset, made_at);

-- The last id given to an action or a transition: ids are never given twice,
-- also when the newest rows are deleted.
CREATE TABLE counter (
    name  TEXT   PRIMARY KEY,
    value BIGINT NOT NULL
);
INSERT INTO counter (name, value) VALUES ('event', 0);
