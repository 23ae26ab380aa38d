// Recordings: imported from CSV, played back, judged again, downloaded, deleted.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

/**
 * The healthy recording in a foreign format: semicolons and decimal commas, degrees, millimetres,
 * milliseconds, x with the opposite sign.
 */
function foreign() {
  const rows = rig.healthy
    .trim()
    .split("\n")
    .slice(1)
    .map((line) => line.split(","));
  const scaled = (cell, factor) => (cell === "" ? "" : (Number(cell) * factor).toFixed(3).replace(".", ","));
  const degrees = 180 / Math.PI;
  const lines = rows.map(([t, qx, qy, x, y]) =>
    [scaled(t, 1000), scaled(x, -1000), scaled(y, 1000), scaled(qx, degrees), scaled(qy, degrees)].join(";"),
  );
  return ["time [ms];ball x (mm);ball y (mm);qx (deg);qy (deg)", ...lines].join("\n");
}

test("a foreign file is mapped with the signs that its motion shows, and it is imported", async () => {
  const file = `${work}/foreign.csv`;
  writeFileSync(file, foreign());
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.locator("input[type=file]").setInputFiles(file);
  const dialogue = view.getByRole("dialog");
  // No rig is proposed: a stranger's file must not go to the first one of the alphabet.
  assert.equal(await dialogue.getByLabel("Rig").inputValue(), "");
  await dialogue.getByText("Choose the rig.").waitFor();
  assert.ok(await dialogue.getByRole("button", { name: /^Import/ }).isDisabled());
  await dialogue.getByLabel("Rig").fill("bench");
  await dialogue.getByText("90.0\u202fs: 100.0\u202fHz").waitFor();
  for (const [role, unit] of [
    ["Time", "ms"],
    ["Command qx (about x)", "°"],
    ["Ball x", "mm"],
  ]) {
    const chosen = await dialogue
      .getByLabel(`Unit of ${role}`)
      .evaluate((select) => select.selectedOptions[0].textContent);
    assert.equal(chosen, unit, role);
  }
  // In the file, x points the other way: the command about y has the other sign.
  const sign = (role) => dialogue.getByLabel(`Sign of ${role}`).inputValue();
  assert.equal(await sign("Command qy (about y)"), "-");
  assert.equal(await sign("Command qx (about x)"), "");
  await dialogue.getByRole("button", { name: /^Import/ }).click();
  await view.getByRole("heading", { name: "foreign", exact: true }).waitFor();
  await view.getByText("No fault", { exact: true }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("played back, scrubbed, judged again, recorded, downloaded, deleted", async () => {
  const session = await imported(service.url, "bench", "sick", rig.sick);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  const moment = view.getByRole("slider", { name: "Moment" });
  await view.getByRole("button", { name: "Play" }).click();
  await view.waitForFunction(() => Number(document.querySelector(".scrub").value) > 0.5);
  await view.getByRole("button", { name: "Pause" }).click();
  await moment.fill("25");
  await view.getByText("25.00 s").waitFor();

  // At 25 s the ball has left the twin behind: the 3D view shows that moment.
  await view.getByText("Loading 3D").waitFor({ state: "detached" });
  await view
    .getByLabel("Tilt of the twin's plate")
    .filter({ hasText: /qy −1\d\.\d°/ })
    .waitFor();
  await view
    .getByRole("button", { name: /Go to 2\d/ })
    .first()
    .click();
  await view.waitForFunction(() => Number(document.querySelector(".scrub").value) < 21);

  await view.getByRole("button", { name: "Judge again" }).click();
  await view.getByText("Different verdict").waitFor();
  await view.getByText("X servo, Y servo").waitFor();
  // What moved has both of its times.
  const moved = view
    .getByRole("region", { name: "Differences" })
    .getByRole("row")
    .filter({ hasText: /(earlier|later)$/ });
  const [from, , to, , by] = (await moved.first().getByRole("cell").allTextContents()).map(parseFloat);
  assert.ok(from !== to && Math.abs(Math.abs(from - to) - by) < 0.011, `${from} s to ${to} s, by ${by} s`);
  await view.getByLabel("Profile").selectOption("");
  await view.getByRole("button", { name: "Judge again" }).click();
  await view.getByText("Identical verdict.").waitFor();
  // The kind is told wherever the verdict is.
  const told = await view.locator(".verdict .result").textContent();
  assert.match(told, /^X servo \(.*dead/);
  for (const side of [0, 1])
    assert.equal(await view.locator(".verdicts dl").nth(side).locator("dd").first().textContent(), told);
  const list = await page(chromium);
  await list.goto(`${service.url}/sessions?asset=bench&name=sick`);
  await list.getByRole("row").filter({ hasText: "sick" }).getByText(told, { exact: true }).waitFor();
  await list.done();

  await view.getByRole("button", { name: "Play" }).click();
  await view.getByRole("button", { name: /record/ }).click();
  await view.waitForFunction(
    (from) => Number(document.querySelector(".scrub").value) > Number(from) + 1,
    await moment.inputValue(),
  );
  const [video] = await Promise.all([
    view.waitForEvent("download"),
    view.getByRole("button", { name: /stop/ }).click(),
  ]);
  const bytes = readFileSync(await video.path());
  assert.match(video.suggestedFilename(), /^bench-sick\.(webm|mp4)$/);
  assert.ok(bytes.length > 5000, `a video of ${bytes.length} bytes`);

  const [csv] = await Promise.all([
    view.waitForEvent("download"),
    view.getByRole("button", { name: "Download CSV" }).click(),
  ]);
  const lines = readFileSync(await csv.path(), "utf8")
    .trim()
    .split("\n");
  assert.equal(lines.length, rig.sick.trim().split("\n").length);

  await view.getByRole("button", { name: "Delete" }).click();
  await view.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
  await view.getByRole("heading", { name: "Sessions" }).waitFor();
  await view.getByRole("link", { name: "foreign" }).waitFor();
  assert.equal(await view.getByRole("link", { name: "sick", exact: true }).count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a session that is too short is shown as not judged", async () => {
  // 0.3 s: shorter than the confirmation of any fault.
  const moment = rig.healthy.split("\n").slice(0, 31).join("\n");
  const session = await imported(service.url, "bench", "moment", moment);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByText("Not judged", { exact: true }).waitFor();
  const shares = view.getByRole("table", { name: "Judged part of the session" });
  assert.equal(await shares.getByRole("cell", { name: "not judged" }).count(), 4);
  await view.goto(`${service.url}/sessions`);
  await view
    .getByRole("row", { name: /moment/ })
    .getByText("Not judged")
    .waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
