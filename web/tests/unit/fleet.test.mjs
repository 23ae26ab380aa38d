// The list of rigs without its page: health, events, search and order.
import assert from "node:assert/strict";
import { test } from "node:test";
import { afterEvent, healthOf, withLine } from "../../src/pages/fleet/fleet-state.ts";
import { groupsByTag, tagged, tagsOf } from "../../src/pages/fleet/tags.ts";
import { chosenRows, countRows, nameRanks, rowOf } from "../../src/pages/fleet/rows.ts";

const NOW = Date.parse("2026-01-01T12:00:00Z");
const ago = (seconds) => new Date(NOW - seconds * 1000).toISOString();

const rig = (asset, more = {}) => ({
  asset,
  faults: [],
  tags: [],
  warnings: [],
  session_id: "1",
  session: "run",
  last_seen: ago(1),
  silent: false,
  calibrated: true,
  ...more,
});

const fault = (status, code = "x_servo", failing = true) => ({ code, status, failing, acknowledged: false });
const line = (status, more = {}) => ({
  asset: "a",
  code: "x_servo",
  session: "run",
  status,
  status_byte: "2F",
  onset_s: 1,
  ...more,
});

test("a rig's health is its worst fault, then drift, then silence", () => {
  assert.equal(healthOf(rig("a", { faults: [fault("pending"), fault("confirmed")] })), "fault");
  assert.equal(healthOf(rig("a", { faults: [fault("pending")], warnings: [{}] })), "suspect");
  assert.equal(healthOf(rig("a", { warnings: [{}] })), "drift");
  assert.equal(healthOf(rig("a")), "ok");
  assert.equal(healthOf(rig("a", { silent: true })), "silent");
  assert.equal(healthOf(rig("a", { unjudged: { samples: 10, reason: "late" } })), "untested");
  assert.equal(healthOf(rig("a", { session_id: null })), "idle");
  assert.equal(healthOf(rig("a", { calibrated: false })), "unlearnt");
  assert.equal(healthOf(rig("a", { faults: [fault("confirmed", "sensor", false)] })), "recorded");
});

test("a rig that the service saw a moment ago stays as it is, however long ago the page looked", () => {
  const seen = rig("a", { last_seen: ago(3600) });
  assert.equal(healthOf(seen), "ok");
});

test("a repair leaves the fault on record, and a new failure begins again", () => {
  const failed = { ...fault("confirmed"), failed_at: ago(60), acknowledged: true };
  const repaired = afterEvent(rig("a", { faults: [failed] }), line("confirmed", { status_byte: "2E" }));
  assert.equal(healthOf(repaired), "recorded");
  assert.equal(repaired.faults[0].failed_at, failed.failed_at);
  const again = afterEvent(repaired, line("confirmed"), new Date(NOW));
  assert.equal(healthOf(again), "fault");
  assert.equal(again.faults[0].failed_at, new Date(NOW).toISOString());
  assert.equal(again.faults[0].acknowledged, false, "another occurrence");
});

test("newest faults come first if asked for", () => {
  const at = (seconds) => [{ ...fault("confirmed"), failed_at: ago(seconds) }];
  const some = [rig("old", { faults: at(60) }), rig("none"), rig("new", { faults: at(1) })];
  const order = chosenRows(
    some.map((entry) => rowOf(entry, new Map())),
    "all",
    "",
    "newest",
  );
  assert.deepEqual(
    order.map(({ entry }) => entry.asset),
    ["new", "old", "none"],
  );
});

test("an event changes only its fault, and keeps the acknowledgement", () => {
  const known = { ...fault("pending"), acknowledged: true };
  const before = rig("a", { faults: [known, fault("confirmed", "sensor")] });
  const confirmed = afterEvent(before, line("confirmed"), new Date(NOW));
  assert.deepEqual(
    confirmed.faults.map(({ code, status, acknowledged }) => [code, status, acknowledged]),
    [
      ["sensor", "confirmed", false],
      ["x_servo", "confirmed", true],
    ],
  );
  const healed = afterEvent(before, line("healed"));
  assert.deepEqual(
    healed.faults.map(({ code }) => code),
    ["sensor"],
  );
  assert.equal(before.faults.length, 2, "unchanged");
});

test("an event about the same change replaces the previous one, and at most fifty are kept", () => {
  const first = line("pending", { event: 1 });
  const repeated = line("pending", { event: 2, kind: "gain" });
  assert.deepEqual(withLine([first], repeated), [repeated]);
  const passed = line("pending", { event: 2, status_byte: "2E" });
  assert.deepEqual(withLine([repeated], passed), [passed, repeated], "a repair is another change");
  const other = line("confirmed", { event: 3 });
  assert.deepEqual(withLine([repeated], other), [other, repeated]);
  let lines = [];
  for (let event = 0; event < 80; event++)
    lines = withLine(lines, line("pending", { event, onset_s: event }));
  assert.deepEqual([lines.length, lines[0].event], [50, 79]);
});

const fleet = [
  rig("bench-10", { lag_s: 3, last_seen: ago(1) }),
  rig("bench-2", { lag_s: 1, last_seen: ago(3) }),
  rig("lab", { faults: [fault("confirmed", "sensor")], last_seen: ago(2) }),
  rig("attic", { session_id: null, last_seen: null }),
];
const ranks = nameRanks(fleet.map(({ asset }) => asset));
const rows = fleet.map((entry) => rowOf(entry, ranks));
const names = (...choice) => chosenRows(rows, ...choice).map(({ entry }) => entry.asset);

test("rigs are sorted as selected, equal ones by name in natural order", () => {
  assert.deepEqual(names("all", "", "name"), ["attic", "bench-2", "bench-10", "lab"]);
  assert.deepEqual(names("all", "", "severity"), ["lab", "bench-2", "bench-10", "attic"]);
  assert.deepEqual(names("all", "", "lag"), ["bench-10", "bench-2", "attic", "lab"]);
  assert.deepEqual(names("all", "", "seen"), ["bench-10", "lab", "bench-2", "attic"]);
  assert.deepEqual(names("all", "", "nonsense"), names("all", "", "severity"));
});

test("every word of a search must occur in the name, session or faults", () => {
  assert.deepEqual(names("all", "bench", "name"), ["bench-2", "bench-10"]);
  assert.deepEqual(names("all", "SENSOR position", "name"), ["lab"]);
  assert.deepEqual(names("all", "bench no-such", "name"), []);
});

test("a filter selects and counts the rigs of one health", () => {
  assert.deepEqual(names("fault", "", "name"), ["lab"]);
  assert.deepEqual([countRows(rows, "all"), countRows(rows, "ok"), countRows(rows, "drift")], [4, 2, 0]);
});

test("a rig that fell silent while it failed is counted as both", () => {
  const lost = { silent: true, communication_lost_since: ago(5) };
  const entries = [
    rig("failing", { faults: [fault("confirmed", "sensor")] }),
    rig("both", { faults: [fault("confirmed", "sensor")], ...lost }),
    rig("ended", { session_id: null, ...lost }),
  ];
  const found = entries.map((entry) => rowOf(entry, nameRanks([])));
  assert.deepEqual([countRows(found, "fault"), countRows(found, "silent")], [2, 1]);
  assert.equal(chosenRows(found, "silent", "", "name")[0].entry.asset, "both");
});

test("a tag selects its rigs, and the group with the worst rig is the first", () => {
  const rigs = [
    rig("well", { tags: ["hall-1", "spare"] }),
    rig("plain"),
    rig("sick", { tags: ["hall-2"], faults: [fault("confirmed")] }),
  ];
  assert.deepEqual(tagsOf(rigs), ["hall-1", "hall-2", "spare"]);
  assert.deepEqual(
    tagged(rigs, "spare").map(({ asset }) => asset),
    ["well"],
  );
  assert.equal(tagged(rigs, "").length, 3);
  assert.equal(tagged(rigs, "hall").length, 0, "only whole tags");
  const rows = rigs.map((entry) => rowOf(entry, nameRanks(rigs.map(({ asset }) => asset))));
  const groups = groupsByTag(chosenRows(rows, "all", "", "severity"));
  assert.deepEqual(
    groups.map((group) => [group.tag, ...group.rows.map(({ entry }) => entry.asset)]),
    [
      ["hall-2", "sick"],
      [undefined, "plain"],
      ["hall-1", "well"],
      ["spare", "well"],
    ],
  );
  assert.equal(chosenRows(rows, "all", "hall-2", "severity").length, 1, "the search finds tags");
});
