-- What is asked again and again must not cost more the longer the history is.

-- The last session of an asset, and its sessions from the newest on.
CREATE INDEX session_by_asset ON session (asset, opened_at, id);

-- The last estimate of an axis.
CREATE INDEX trend_by_axis ON trend (asset, axis, ended_at, session);
DROP INDEX trend_with_warnings;

-- What retention looks for: the oldest, what an asset holds (all that is asked, so
-- that no session is read), what was given up.
CREATE INDEX session_by_ending ON session (ended_at)
    WHERE state = 'ended' AND expired_at IS NULL;
CREATE INDEX session_held ON session (asset, n_bytes, state, expired_at)
    WHERE state = 'ended' AND expired_at IS NULL;
CREATE INDEX session_expired ON session (expired_at) WHERE expired_at IS NOT NULL;
