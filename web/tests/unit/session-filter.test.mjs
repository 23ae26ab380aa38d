// The filter of the list of sessions in the address.
import assert from "node:assert/strict";
import { test } from "node:test";
import { isFiltered, sessionQuery } from "../../src/pages/sessions/session-filter.ts";

const asked = (address) => {
  const given = Object.entries(sessionQuery(new URLSearchParams(address)));
  return Object.fromEntries(given.filter(([, value]) => value !== undefined));
};

test("an address selects and orders sessions", () => {
  assert.deepEqual(asked(""), {});
  const { opened_from, opened_to, ...others } = asked(
    "asset=bench&tag=hall-1&name=mon&verdict=no_fault&sort=opened_at&from=2026-03-01&to=2026-03-01",
  );
  assert.deepEqual(others, {
    asset: "bench",
    tag: "hall-1",
    name: "mon",
    verdict: "no_fault",
    sort: "opened_at",
  });
  // The whole day at this place.
  assert.equal(opened_from, new Date(2026, 2, 1).toISOString());
  assert.equal(opened_to, new Date(2026, 2, 2).toISOString());
});

test("a day ends when the next one begins, also at the end of a month and when the clocks change", () => {
  assert.equal(asked("to=2026-12-31").opened_to, new Date(2027, 0, 1).toISOString());
  const { opened_from, opened_to } = asked("from=2026-03-29&to=2026-03-29");
  const hours = (Date.parse(opened_to) - Date.parse(opened_from)) / 3_600_000;
  const change = new Date(2026, 2, 30).getTimezoneOffset() - new Date(2026, 2, 29).getTimezoneOffset();
  assert.equal(hours, 24 + change / 60);
});

test("what the service would not understand is left out", () => {
  assert.deepEqual(asked("from=yesterday&to=2026-3-1&verdict=good&sort=name&colour=red&asset="), {});
});

test("an order alone selects nothing", () => {
  assert.ok(!isFiltered(sessionQuery(new URLSearchParams("sort=opened_at"))));
  assert.ok(isFiltered(sessionQuery(new URLSearchParams("sort=opened_at&name=a"))));
});
