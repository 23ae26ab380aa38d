// The calibrations of a rig: their order, their fit and what they leave open.
import assert from "node:assert/strict";
import { test } from "node:test";
import { actWords, numbered, previous, undetermined, useWords } from "../../src/pages/calibrations/history";
import { fitSentence, residualRms } from "../../src/pages/calibrations/residual";

const jobs = [
  { id: "c", calibration: {} },
  { id: "b", calibration: null, error: "too little motion" },
  { id: "a", calibration: {} },
];

test("calibrations are numbered from the oldest, and failed ones are not counted", () => {
  assert.deepEqual(
    numbered(jobs).map(({ job, n }) => [job.id, n]),
    [
      ["c", 2],
      ["a", 1],
    ],
  );
  assert.equal(previous(jobs, "c"), "a");
  assert.equal(previous(jobs, "a"), "none");
});

test("a calibration says who made and who activated it, as far as it is known", () => {
  const activated = { active: true, activated_at: "2026-01-02T00:00:00Z", activated_by: "ann" };
  assert.match(useWords(activated), /^in use since .*2026.* by ann$/);
  assert.match(useWords({ ...activated, active: false }), /^not in use; last activated .* by ann$/);
  assert.equal(useWords({ active: true }), "in use");
  assert.equal(useWords({ active: false }), "not in use");
  assert.doesNotMatch(actWords("2026-01-02T00:00:00Z", null), / by /);
});

test("only judged moments count for the size of the residual", () => {
  const x = {
    measured_m_s2: [3, -4, 100, null],
    twin_m_s2: [0, 0, 0, 0],
    enabled: [true, true, false, true],
  };
  const y = { measured_m_s2: [null], twin_m_s2: [0], enabled: [true] };
  assert.equal(residualRms({ x, y }, "x"), Math.sqrt(12.5));
  assert.equal(residualRms({ x, y }, "y"), null);
});

test("the change of the residual is said in words", () => {
  assert.match(fitSentence("x", 0.2, 0.05), /^Along x the residual is 0\.050.*75 % less than the 0\.200/);
  assert.match(fitSentence("y", 0.1, 0.2), /100 % more/);
  assert.match(fitSentence("y", null, 0.2), /with the other calibration it could not be judged/);
  assert.equal(fitSentence("y", 0.1, null), "Along y the residual could not be judged.");
});

test("what a calibration leaves open is named", () => {
  const open = undetermined({ x: { rest_s: 0 }, y: null, certificate: [], prospects: null });
  assert.deepEqual(open, [
    "the y servo",
    "the tilt at which a resting ball starts along x",
    "the expected false alarms",
    "the detection times",
  ]);
});
