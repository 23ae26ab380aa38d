-- What people did outlives the recording: `session` becomes null when that is deleted.
CREATE TABLE action_kept (
    id          BIGINT PRIMARY KEY,
    asset       TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    session     TEXT   REFERENCES session (id) ON DELETE SET NULL,
    after_index BIGINT NOT NULL,
    kind        TEXT   NOT NULL CHECK (kind IN ('clear', 'acknowledge')),
    code        TEXT   NOT NULL,
    actor       TEXT   NOT NULL,
    at          BIGINT NOT NULL,
    event       TEXT
);
INSERT INTO action_kept
    SELECT id, asset, session, after_index, kind, code, actor, at, event FROM action;
DROP TABLE action;
ALTER TABLE action_kept RENAME TO action;
CREATE INDEX action_by_session ON action (session, after_index, id);
CREATE INDEX action_by_asset ON action (asset, code, id);
