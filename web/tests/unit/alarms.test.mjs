// The order and the groups of the list of alarms.
import assert from "node:assert/strict";
import { test } from "node:test";
import { GROUPS, grouped } from "../../src/pages/alarms/arranged.ts";

const alarm = (asset, code) => ({ asset, code, since: null });

test("alarms are grouped by the tags of their rigs, under each of them", () => {
  const alarms = [alarm("a", "x_servo"), alarm("b", "sensor"), alarm("c", "x_servo")];
  const tags = new Map([
    ["a", ["hall 1", "spare"]],
    ["c", ["hall 1"]],
  ]);
  assert.ok(GROUPS.tag);
  assert.deepEqual(
    grouped(alarms, "tag", tags).map(({ heading, alarms }) => [heading, ...alarms.map(({ asset }) => asset)]),
    [
      ["hall 1", "a", "c"],
      ["spare", "a"],
      ["Without a tag", "b"],
    ],
  );
  assert.equal(grouped(alarms, "").length, 1);
});

test("a group tells the number of all its alarms, of which some are shown", () => {
  const all = Array.from({ length: 130 }, (_, i) => alarm(`rig-${i}`, i < 120 ? "x_servo" : "sensor"));
  const groups = grouped(all, "fault", new Map(), 100);
  assert.deepEqual(
    groups.map(({ alarms, total }) => [alarms.length, total]),
    [[100, 120]],
  );
});
