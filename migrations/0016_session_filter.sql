-- Whether the verdict of an ended session has a confirmed fault, 0 or 1; null while it is open.
ALTER TABLE session ADD COLUMN found_fault BIGINT;
UPDATE session SET found_fault = CASE WHEN verdict LIKE '%"faults":[]%' THEN 0 ELSE 1 END
    WHERE verdict IS NOT NULL;
CREATE INDEX session_with_fault ON session (opened_at, id) WHERE found_fault = 1;
