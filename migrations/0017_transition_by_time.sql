-- For the marks of fault transitions on charts, which are asked for by time.
CREATE INDEX transition_by_time ON transition (at, id);
