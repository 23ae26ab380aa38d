// Saved views, and the filter of the alarms in the address.
import assert from "node:assert/strict";
import { test } from "node:test";
import { alarmFilter } from "../../src/pages/alarms/alarm-filter.ts";
import { parseViews, renamed, withoutView, withView } from "../../src/parts/saved-views/views.ts";

const VIEWS = [
  { name: "hall 1", query: "tag=hall-1" },
  { name: "all", query: "" },
];

test("a view of the same name is replaced, and one without a name is not kept", () => {
  assert.deepEqual(withView(VIEWS, " all ", "tag=x"), [VIEWS[0], { name: "all", query: "tag=x" }]);
  assert.deepEqual(withView(VIEWS, "  ", "tag=x"), VIEWS);
  assert.equal(withView([], "x".repeat(100), "")[0].name.length, 60);
  let many = [];
  for (let i = 0; i < 60; i++) many = withView(many, `v${i}`, "");
  assert.deepEqual([many.length, many[0].name], [50, "v10"]);
});

test("a name that is taken stays with its view", () => {
  assert.equal(renamed(VIEWS, "all", "every rig")[1].name, "every rig");
  assert.deepEqual(renamed(VIEWS, "all", "hall 1"), VIEWS);
  assert.deepEqual(renamed(VIEWS, "all", " "), VIEWS);
  assert.deepEqual(withoutView(VIEWS, "all"), [VIEWS[0]]);
});

test("what is not a view is left out", () => {
  assert.deepEqual(parseViews(JSON.stringify([...VIEWS, null, 7, { name: "a" }])), VIEWS);
  for (const wrong of [null, "", "{", "7", "{}"]) assert.deepEqual(parseViews(wrong), [], wrong);
});

test("the address of the alarms has their filter", () => {
  const now = Date.parse("2026-01-02T12:00:30Z");
  const of = (text) => JSON.parse(JSON.stringify(alarmFilter(new URLSearchParams(text), now)));
  assert.deepEqual(of(""), { state: "active" });
  assert.deepEqual(of("state=all&tag=hall-1&hours=24&acknowledged=false"), {
    state: "all",
    tag: "hall-1",
    from: "2026-01-01T12:00:00.000Z",
    acknowledged: false,
  });
  for (const wrong of ["hours=soon", "hours=-1", "hours=Infinity"])
    assert.deepEqual(of(wrong), { state: "active" });
});
