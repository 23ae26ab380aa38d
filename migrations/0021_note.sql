-- What people note on a moment or a stretch of a session; deleted with it. (`note` has the
-- owner's notes on the advice on a fault.)
CREATE TABLE remark (
    id      TEXT   PRIMARY KEY,          -- UUID v7
    session TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    from_s  DOUBLE PRECISION NOT NULL,   -- on the device's clock
    to_s    DOUBLE PRECISION NOT NULL,   -- equal to from_s for a moment
    text    TEXT   NOT NULL,
    actor   TEXT   NOT NULL,
    at      BIGINT NOT NULL
);
CREATE INDEX remark_by_session ON remark (session, from_s, id);
