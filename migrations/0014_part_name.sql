-- A device names all parts of a session like the first, which may have been deleted.
CREATE INDEX session_part_by_asset ON session (asset) WHERE first_part IS NOT NULL;
