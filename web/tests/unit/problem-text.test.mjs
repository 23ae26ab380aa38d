// The refusals of a description, in the words and units of the form.
import assert from "node:assert/strict";
import { test } from "node:test";
import { problemText } from "../../src/pages/set-up/problem-text.ts";
import { ProblemError } from "../../src/api/request.ts";

test("a refused description names the field of the form, and values in its unit", () => {
  const refused = (pointer, detail) => problemText(new ProblemError(422, { detail, pointer }));
  const text = refused("/ball/radius_m", "/ball/radius_m: -0.003 is not above 0 and at most 1");
  assert.equal(text, "Radius: −3\u202fmm is not above 0\u202fmm and at most 1000\u202fmm");
  const large = refused(
    "/ball/radius_m",
    "/ball/radius_m: a ball of 1.424 m does not fit on a plate that is 0.38 m x 0.24 m large",
  );
  assert.equal(
    large,
    "Radius: a ball of 1424\u202fmm does not fit on a plate that is 380\u202fmm x 240\u202fmm large",
  );
  assert.equal(refused("/name", "/name: is taken"), "Name: is taken");
  assert.equal(refused(undefined, "no element"), "no element");
  const type = "urn:offbd:problem:asset-exists";
  const detail = "asset `bench` already exists; replace it with PUT /api/v1/assets/bench";
  assert.match(problemText(new ProblemError(409, { type, detail })), /^There is a rig of this name already/);
});
