-- What a rig that learns by itself has gathered, what it offers, and which sessions
-- taught it; JSON. None before the first session that brought motion.
ALTER TABLE asset ADD COLUMN learning TEXT;
