-- A session that has become too long continues in another one, its next part.
ALTER TABLE session ADD COLUMN part BIGINT NOT NULL DEFAULT 1;  -- number of the part
ALTER TABLE session ADD COLUMN first_part TEXT;  -- id of the first part; none in that itself
CREATE INDEX session_by_part ON session (first_part, part) WHERE first_part IS NOT NULL;
