// The description of a rig in the set-up.
import assert from "node:assert/strict";
import { test } from "node:test";
import { assetOf, describeAsset, isDefault } from "../../src/pages/set-up/description.ts";

test("a value that nobody has measured is marked as a default, and is sent all the same", () => {
  const description = describeAsset();
  for (const field of ["rate", "radius", "mass", "length", "width", "limit"])
    assert.ok(isDefault(description, field), field);
  const measured = { ...description, radius: 20 };
  assert.ok(!isDefault(measured, "radius"));
  assert.ok(isDefault(measured, "mass"));
  assert.equal(assetOf(measured).ball.mass_kg, 0.051);
});
