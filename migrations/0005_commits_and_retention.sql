-- Every transaction of the writer counts itself: after a lost connection it is
-- known whether the last one came through.
INSERT INTO counter (name, value) VALUES ('commit', 0);

-- Bytes of an ended session's chunks, so that retention need not read them.
ALTER TABLE session ADD COLUMN n_bytes BIGINT NOT NULL DEFAULT 0;
UPDATE session SET n_bytes =
    (SELECT CAST(COALESCE(SUM(LENGTH(data)), 0) AS BIGINT) FROM chunk
     WHERE chunk.session = session.id)
    WHERE state = 'ended';

-- When retention has given a session up: it is deleted piece by piece, and no
-- longer seen.
ALTER TABLE session ADD COLUMN expired_at BIGINT;
