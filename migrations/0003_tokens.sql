-- Who may do what, and who did what.

-- A token that the service gave out. The secret itself is nowhere: it is 256
-- random bits, so its SHA-256 cannot be turned back by trying.
CREATE TABLE token (
    id           TEXT   PRIMARY KEY,     -- UUID v7
    hash         TEXT   NOT NULL UNIQUE, -- SHA-256 of the secret, hexadecimal
    name         TEXT   NOT NULL,
    role         TEXT   NOT NULL CHECK (role IN ('device', 'viewer', 'operator', 'admin')),
    asset        TEXT,                   -- the one asset of a device
    created_at   BIGINT NOT NULL,
    created_by   TEXT   NOT NULL,
    expires_at   BIGINT,
    last_used_at BIGINT,                 -- to the hour
    revoked_at   BIGINT,
    CHECK ((role = 'device') = (asset IS NOT NULL))
);
CREATE UNIQUE INDEX token_one_name ON token (name) WHERE revoked_at IS NULL;

-- A browser that was shown a token, and what its cookie's SHA-256 is.
CREATE TABLE login (
    hash       TEXT   PRIMARY KEY,
    token      TEXT   NOT NULL REFERENCES token (id) ON DELETE CASCADE,
    expires_at BIGINT NOT NULL
);
CREATE INDEX login_by_token ON login (token, expires_at);

-- What was done to the service by whom; rows are added and never changed.
CREATE TABLE audit (
    id      TEXT   PRIMARY KEY,          -- UUID v7, rises with time
    at      BIGINT NOT NULL,
    actor   TEXT   NOT NULL,             -- name of the token
    token   TEXT,                        -- its id
    act     TEXT   NOT NULL,             -- the operation of the interface
    target  TEXT   NOT NULL,             -- what it was done to
    address TEXT                         -- from where; none at the machine itself
);
