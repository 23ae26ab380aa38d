-- Notifications, mutes, lost communication, and the owner's notes.

-- Where notifications go. `position` is the id of the last event of which the deliveries are
-- planned. `document` has the settings with their secrets (JSON).
CREATE TABLE channel (
    id         TEXT   PRIMARY KEY,       -- UUID v7
    name       TEXT   NOT NULL UNIQUE,
    document   TEXT   NOT NULL,
    position   BIGINT NOT NULL,
    created_at BIGINT NOT NULL
);

-- Which changes of which faults are sent to a channel (JSON).
CREATE TABLE rule (
    id         TEXT   PRIMARY KEY,       -- UUID v7
    channel    TEXT   NOT NULL REFERENCES channel (id),
    document   TEXT   NOT NULL,
    created_at BIGINT NOT NULL
);
CREATE INDEX rule_by_channel ON rule (channel);

-- A message to a channel. `event` is the id of its event, 0 for a test; `n` numbers the
-- messages of one event: 0 for the event itself, reminders from 1 on.
CREATE TABLE delivery (
    id          TEXT   PRIMARY KEY,      -- UUID v7
    channel     TEXT   NOT NULL REFERENCES channel (id) ON DELETE CASCADE,
    event       BIGINT NOT NULL,
    n           BIGINT NOT NULL,
    asset       TEXT   NOT NULL,
    message     TEXT   NOT NULL,         -- id of the message, the same in every attempt
    state       TEXT   NOT NULL CHECK (state IN ('pending', 'delivered', 'given_up')),
    body        TEXT   NOT NULL,         -- the message, JSON
    attempts    BIGINT NOT NULL,
    created_at  BIGINT NOT NULL,
    due_at      BIGINT NOT NULL,         -- of the next attempt
    finished_at BIGINT,
    error       TEXT,                    -- of the last attempt
    UNIQUE (channel, event, n)
);
CREATE INDEX delivery_waiting ON delivery (channel, asset, event, n) WHERE state = 'pending';
CREATE INDEX delivery_by_channel ON delivery (channel, state, id);

-- A fault of which a rule reminds as long as it fails and nobody has acknowledged it.
CREATE TABLE reminder (
    rule   TEXT   NOT NULL REFERENCES rule (id) ON DELETE CASCADE,
    asset  TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    code   TEXT   NOT NULL,
    event  BIGINT NOT NULL,
    n      BIGINT NOT NULL,
    body   TEXT   NOT NULL,              -- the message of the event, JSON
    due_at BIGINT NOT NULL,
    PRIMARY KEY (rule, asset, code)
);
CREATE INDEX reminder_due ON reminder (due_at);

-- A monitor that a person has muted.
CREATE TABLE mute (
    asset   TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    code    TEXT   NOT NULL,
    actor   TEXT   NOT NULL,
    reason  TEXT   NOT NULL,
    at      BIGINT NOT NULL,
    until   BIGINT NOT NULL,
    PRIMARY KEY (asset, code)
);

-- Rigs of which no data arrives, or whose data have stayed away at some time.
CREATE TABLE communication (
    asset           TEXT   PRIMARY KEY REFERENCES asset (name) ON DELETE CASCADE,
    lost            BIGINT NOT NULL,     -- 1 while no data arrive
    since           BIGINT NOT NULL,     -- when the last sample before the loss arrived
    changed_at      BIGINT NOT NULL,
    occurrences     BIGINT NOT NULL,
    session         TEXT,
    acknowledged_by TEXT,
    acknowledged_at BIGINT
);

-- The changes of it; `id` is the id of the event.
CREATE TABLE communication_change (
    id       BIGINT PRIMARY KEY,
    asset    TEXT   NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    session  TEXT,
    at       BIGINT NOT NULL,
    document TEXT   NOT NULL             -- the event, JSON
);
CREATE INDEX communication_change_by_asset ON communication_change (asset, id);

-- What the owner adds to the advice on a fault.
CREATE TABLE note (
    code  TEXT   PRIMARY KEY,
    text  TEXT   NOT NULL,
    actor TEXT   NOT NULL,
    at    BIGINT NOT NULL
);
