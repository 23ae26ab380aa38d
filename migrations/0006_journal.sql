-- What was committed of recordings and is not in their chunks yet: one row for
-- all sessions of a commit, in MessagePack (`src/store/journal.rs`). A session's
-- row and chunks tell of it up to where it was folded last, the journal what
-- came after that.
CREATE TABLE journal (
    id   BIGINT PRIMARY KEY,             -- the number of the commit
    data BYTEA  NOT NULL
);
