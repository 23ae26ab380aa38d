// Tokens and the audit log: the form, the states, the targets.
import assert from "node:assert/strict";
import { test } from "node:test";
import { actText, auditTarget } from "../../src/pages/administration/audit-target.ts";
import { EMPTY_DRAFT, obstacle, tokenOf } from "../../src/pages/administration/token-draft.ts";
import { isInForce, tokenState } from "../../src/pages/administration/token-state.ts";
import { dateTime } from "../../src/words/time.ts";

const NOW = Date.parse("2026-01-01T12:00:00Z");
const at = (hours) => new Date(NOW + hours * 3_600_000).toISOString();

test("a token has a rig only if it is a device's, and expires only if that is asked for", () => {
  const draft = { ...EMPTY_DRAFT, name: " ann ", asset: "bench-1" };
  assert.deepEqual(tokenOf(draft), { name: "ann", role: "viewer", asset: null, expires_at: null });
  const device = tokenOf({ ...draft, role: "device", expires: "2026-03-01T10:00" });
  assert.equal(device.asset, "bench-1");
  assert.equal(device.expires_at, new Date(2026, 2, 1, 10).toISOString());
});

test("the form says what is missing", () => {
  const draft = { ...EMPTY_DRAFT, name: "ann" };
  assert.equal(obstacle(draft, NOW), "");
  assert.match(obstacle({ ...draft, name: " " }, NOW), /name/);
  assert.match(obstacle({ ...draft, role: "device" }, NOW), /rig/);
  assert.match(obstacle({ ...draft, expires: "2025-12-01T10:00" }, NOW), /passed/);
  assert.equal(obstacle({ ...draft, expires: "2026-03-01T10:00" }, NOW), "");
});

test("a token is valid until it expires or is revoked", () => {
  const state = (token) => [isInForce(token, NOW), tokenState(token, NOW)];
  assert.deepEqual(state({}), [true, "valid"]);
  assert.deepEqual(state({ expires_at: at(1) }), [true, `valid until ${dateTime(at(1))}`]);
  assert.deepEqual(state({ expires_at: at(-1) }), [false, `expired ${dateTime(at(-1))}`]);
  assert.deepEqual(state({ expires_at: at(1), revoked_at: at(-2) }), [false, `revoked ${dateTime(at(-2))}`]);
});

test("an audited action is told in words, with the way to what is still there", () => {
  assert.deepEqual(["clear_fault", "put_asset"].map(actText), ["clear fault", "change rig"]);
  const target = (act, target) => auditTarget({ act, target }, (id) => (id === "7" ? "ann" : undefined));
  assert.deepEqual(target("clear_fault", "/api/v1/assets/a%20b/faults/x_servo"), {
    text: "rig a b: X servo",
    path: "/rigs/a%20b",
  });
  const ended = { text: "session 5", path: "/sessions/5" };
  assert.deepEqual(target("end_session", "/api/v1/sessions/5/end"), ended);
  assert.deepEqual(target("delete_asset", "/api/v1/assets/a"), { text: "rig a" });
  assert.equal(target("revoke_token", "/api/v1/tokens/7").text, "token ann");
  assert.equal(target("revoke_token", "/api/v1/tokens/8").text, "token 8");
  assert.equal(
    target("acknowledge_fault", "/api/v1/assets/a/faults/sensor/acknowledge").text,
    "rig a: Position sensor",
  );
  assert.equal(
    target("import_session", "/api/v1/assets/a/sessions/import").text,
    "rig a: an imported session",
  );
  assert.equal(target("activate", "/api/v1/assets/a/calibrations/9/activate").text, "rig a: calibration 9");
  assert.equal(target("repair_demo", "/api/v1/demo/faults").text, "the demo");
  assert.equal(target("anything", "/api/v1/assets/a/else/b").text, "rig a: else/b", "what has no words");
  assert.deepEqual(target("log_in", "/api/v1/login"), { text: "login" });
  const rule = target("delete_rule", "/api/v1/notifications/rules/4");
  assert.deepEqual(rule, { text: "notification rule 4" });
  assert.deepEqual(target("clear", "/sovd/v1/components/a"), { text: "/sovd/v1/components/a" });
});
