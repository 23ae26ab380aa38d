-- Every asset belongs to a partition, by a hash of its name. A node of a cluster owns
-- partitions; without a cluster there is one, and one process owns it.
-- `epoch` counts the owners; `n_commits` counts the transactions that changed the partition.
-- A transaction that finds another epoch or count than its writer knows is rolled back.
CREATE TABLE partition (
    id        BIGINT PRIMARY KEY,
    epoch     BIGINT NOT NULL,
    n_commits BIGINT NOT NULL,
    owner     TEXT                       -- id of a row of `node`
);
INSERT INTO partition (id, epoch, n_commits)
    SELECT 0, 0, value FROM counter WHERE name = 'commit';
DELETE FROM counter WHERE name = 'commit';

ALTER TABLE asset ADD COLUMN partition BIGINT NOT NULL DEFAULT 0;
CREATE INDEX asset_by_partition ON asset (partition, name);

-- The processes of a cluster. `pid` and `started` name the connection with which a node
-- writes: as long as the server has it, the node is alive.
CREATE TABLE node (
    id        TEXT   PRIMARY KEY,        -- UUID v7 of the process
    name      TEXT   NOT NULL,
    address   TEXT   NOT NULL,           -- where other nodes reach it, HOST:PORT
    version   TEXT   NOT NULL,
    leaving   BIGINT NOT NULL,           -- 1 once it hands its partitions over
    pid       BIGINT NOT NULL,
    started   TEXT   NOT NULL
);

-- What all nodes of a cluster share.
CREATE TABLE cluster (
    secret TEXT NOT NULL                 -- by which nodes know each other
);
