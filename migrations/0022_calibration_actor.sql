-- Who made a calibration, and who put it into use last; NULL if nobody is known.
ALTER TABLE calibration ADD COLUMN made_by TEXT;
ALTER TABLE calibration ADD COLUMN activated_by TEXT;
ALTER TABLE calibration ADD COLUMN activated_at BIGINT;
