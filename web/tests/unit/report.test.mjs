// Which calibration a report speaks of.
import assert from "node:assert/strict";
import { test } from "node:test";
import { certificateNote } from "../../src/pages/report/certificate-note.ts";

const JUDGED = { id: "c1", made_at: "2026-01-02T00:00:00Z" };

test("the calibration is that in force when the session began, whatever is present", () => {
  assert.doesNotMatch(certificateNote(JUDGED, undefined, JUDGED), /which/);
  assert.match(certificateNote(JUDGED, undefined, JUDGED), /^Judged with calibration c1, of .*2026.*\.$/);
  assert.match(
    certificateNote(JUDGED, "c1", { ...JUDGED, id: "c2" }),
    /c1, of .*, which is not the present one/,
  );
  assert.match(certificateNote(JUDGED, "c1", null), /which is not the present one/);
  assert.equal(certificateNote(null, null, JUDGED), "Judged without a calibration.");
});

test("a session that was deleted leaves the id of its calibration", () => {
  assert.match(certificateNote(undefined, "c1", JUDGED), /c1, whose session is not stored any more/);
  assert.equal(certificateNote(undefined, null, JUDGED), "Judged without a calibration.");
});
