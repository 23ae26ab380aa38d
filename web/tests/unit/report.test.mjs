// Which calibration a report speaks of.
import assert from "node:assert/strict";
import { test } from "node:test";
import { certificateNote } from "../../src/pages/report/certificate-note.ts";

const PRESENT = { id: "c2", made_at: "2026-01-02T00:00:00Z" };

test("the certificate is shown only with what it belongs to", () => {
  const note = (judged, present = PRESENT) => certificateNote(present, judged);
  assert.equal(note({ calibration: "c2" }).applies, true);
  assert.deepEqual(note({ calibration: null }), { text: "Judged without a calibration.", applies: false });
  assert.equal(note({ calibration: "c1" }).applies, false);
  assert.match(note({ calibration: "c1" }).text, /c1, which is not the present one/);
  assert.equal(note({ opened: "2026-01-03T00:00:00Z" }).applies, true);
  assert.equal(note({ opened: "2026-01-01T00:00:00Z" }).applies, false);
  assert.equal(note({ opened: "2026-01-01T00:00:00Z" }, null).text, "The rig has no calibration.");
});
