-- Where and when a fault came up and what people did about it (JSON).
ALTER TABLE fault ADD COLUMN provenance TEXT NOT NULL DEFAULT '{}';

-- The event of an act that changed a code while no session was open (JSON): no
-- session has a transition of it.
ALTER TABLE action ADD COLUMN event TEXT;
