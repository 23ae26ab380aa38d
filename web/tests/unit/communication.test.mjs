// Events about data of a rig that stay away, in the fleet.
import assert from "node:assert/strict";
import { test } from "node:test";
import { afterEvent, healthOf, withLine } from "../../src/pages/fleet/fleet-state.ts";
import { healthOf as healthOnRigPage } from "../../src/pages/asset/health.ts";
import { alarmState } from "../../src/words/alarm.ts";
import { communicationText } from "../../src/words/communication.ts";

const SINCE = "2026-01-01T11:59:51Z";

const communication = (status, more = {}) => ({
  type: "communication",
  code: "communication_lost",
  asset: "a",
  session: "run",
  status,
  since: SINCE,
  ...more,
});

const rig = {
  asset: "a",
  faults: [],
  tags: [],
  warnings: [],
  session_id: "1",
  silent: false,
  calibrated: true,
};

test("a rig whose data stay away is silent since its last data, until they are back", () => {
  const recorded = { code: "sensor", status: "pending", failing: false, acknowledged: false };
  const lost = afterEvent({ ...rig, faults: [recorded] }, communication("confirmed"));
  assert.deepEqual([lost.silent, lost.communication_lost_since, lost.faults], [true, SINCE, [recorded]]);
  assert.equal(healthOf({ ...lost, faults: [] }), "silent");
  const back = afterEvent(lost, communication("passed"));
  assert.deepEqual([back.silent, back.communication_lost_since], [false, null]);
});

test("each loss of communication is a separate event", () => {
  const first = communication("confirmed", { event: 1, since: "2026-01-01T11:00:00Z" });
  const again = communication("confirmed", { event: 3 });
  assert.deepEqual(withLine([first], again), [again, first]);
  assert.deepEqual(withLine([first], { ...first, event: 2 }), [{ ...first, event: 2 }], "received twice");
});

test("an event of lost communication says whether data are awaited", () => {
  const words = (status, more) => communicationText(communication(status, more));
  assert.match(words("confirmed").sentence, /^No data since .*, though a session is open\.$/);
  assert.equal(words("passed").text, "back");
  assert.equal(words("passed", { session: null }).text, "no longer expected");
});

test("a rig is tested while only its lost communication is muted", () => {
  const mute = (code) => ({ asset: "a", code, by: "ada", reason: "moves", at: SINCE, until: SINCE });
  assert.equal(healthOf({ ...rig, muted: [mute("communication_lost")] }), "ok");
  assert.equal(healthOf({ ...rig, muted: [mute("communication_lost"), mute("sensor")] }), "untested");
  const alarm = {
    failing: true,
    tested: true,
    session_open: true,
    status: "confirmed",
    muted: mute("communication_lost"),
  };
  assert.equal(alarmState({ ...alarm, code: "communication_lost" }).text, "muted by ada");
  assert.equal(alarmState({ ...alarm, code: "sensor" }).text, "not tested (muted by ada)");
  const failing = { ...alarm, code: "sensor", muted: null };
  assert.equal(alarmState(failing).text, "▲ failing");
  assert.equal(alarmState({ ...failing, tested: false }).text, "▲ failed when last tested");
  const suspected = { ...failing, status: "pending" };
  assert.deepEqual(alarmState(suspected), { text: "△ suspected", look: "status-pending" });
  assert.equal(alarmState({ ...suspected, tested: false }).text, "suspected when last tested");
  const silent = { ...failing, communication_lost_since: SINCE };
  assert.match(alarmState(silent).text, /^▲ failed when last tested; silent since .*2026/);
  assert.match(
    alarmState({ ...silent, status: "pending" }).text,
    /^suspected when last tested; silent since /,
  );
  assert.equal(alarmState({ ...silent, code: "communication_lost" }).text, "▲ no data now");
  const ended = { ...failing, session_open: false };
  assert.equal(alarmState(ended).text, "▲ failed when last tested");
  assert.equal(alarmState({ ...ended, code: "communication_lost" }).text, "▲ no data now");
  const passing = { ...failing, failing: false };
  assert.equal(alarmState({ ...passing, status: "pending" }).text, "passing again; was suspected");
});

test("after the page has lost the connection, the health of a rig is not known", () => {
  const onRecord = { code: "x_servo", status: "confirmed", status_byte: "2E" };
  const known = { isConnected: false, isSilent: false, isLearnt: true };
  assert.equal(healthOnRigPage([onRecord], undefined, { ...known, isLost: true }), "unknown");
  assert.equal(healthOnRigPage([onRecord], undefined, { ...known, isLost: false }), "recorded");
});

test("a fault that healed before anybody acknowledged it says so", () => {
  const healed = { code: "x_servo", status: "healed", failing: false, tested: true, session_open: true };
  assert.equal(alarmState(healed).text, "healed, not acknowledged");
  const acknowledgement = { by: "ada", at: SINCE };
  assert.equal(alarmState({ ...healed, acknowledgement }).text, "healed");
  assert.equal(alarmState({ ...healed, code: "communication_lost" }).text, "healed", "data arrive again");
});
