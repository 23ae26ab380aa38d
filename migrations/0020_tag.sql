-- The tags of rigs: plain words by which people group them.
CREATE TABLE tag (
    asset TEXT NOT NULL REFERENCES asset (name) ON DELETE CASCADE,
    name  TEXT NOT NULL,
    PRIMARY KEY (asset, name)
);
CREATE INDEX tag_by_name ON tag (name, asset);
