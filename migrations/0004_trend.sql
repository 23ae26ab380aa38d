-- What a session estimated of the servo behind an axis, against its twin, with
-- standard errors; none where too little motion was seen.
CREATE TABLE trend (
    session           TEXT   NOT NULL REFERENCES session (id) ON DELETE CASCADE,
    axis              TEXT   NOT NULL CHECK (axis IN ('x', 'y')),
    asset             TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    ended_at          BIGINT NOT NULL,
    n_samples         BIGINT NOT NULL,
    calibration_id    TEXT,              -- none on a rig not learnt
    gain              DOUBLE PRECISION NOT NULL,
    gain_error        DOUBLE PRECISION NOT NULL,
    offset_m_s2       DOUBLE PRECISION NOT NULL,
    offset_error_m_s2 DOUBLE PRECISION NOT NULL,
    delay_s           DOUBLE PRECISION NOT NULL,
    delay_error_s     DOUBLE PRECISION NOT NULL,
    motion_s          DOUBLE PRECISION NOT NULL,
    warnings          TEXT,              -- JSON, what the session led to; none without any
    PRIMARY KEY (session, axis)
);
CREATE INDEX trend_by_asset ON trend (asset, ended_at, session);
CREATE INDEX trend_with_warnings ON trend (asset) WHERE warnings IS NOT NULL;
