// The drive cycle on a rig's page: computed, shown, downloaded, and run by the offered program.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { recordings } from "./rigs.mjs";
import { SOON, ask, page, started } from "./support.mjs";

let work, service, chromium;

started(async (made) => {
  ({ work, service, chromium } = made);
  await ask(service.url, "POST", "/assets", { ...recordings(work).learnt, name: "learnt" });
  await ask(service.url, "POST", "/assets", { name: "new" });
});

/** Presses a button and returns the downloaded text. */
async function downloaded(view, word) {
  const coming = view.waitForEvent("download");
  await view.getByRole("button", { name: word }).click();
  return readFileSync(await (await coming).path(), "utf8");
}

test("the cycle of a learnt rig is shown with its detectable faults, downloaded, and run by the program", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/learnt`);
  const card = view.locator("#drive-cycle");
  await card.getByRole("button", { name: "Compute the drive cycle" }).click();
  await card.getByRole("img", { name: /Set points over/ }).waitFor({ timeout: 3 * SOON });
  const stuck = card.getByRole("row").filter({ hasText: "the ball is stuck" });
  assert.match(await stuck.textContent(), /Stuck ball.*\d\.\d+\ss/);
  assert.equal(await card.getByRole("row").count(), 10, "a heading and nine faults");

  const json = await downloaded(view, "Download JSON");
  const cycle = JSON.parse(json);
  const csv = (await downloaded(view, "Download CSV")).trim().split("\n");
  assert.equal(csv[0], "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m");
  assert.equal(csv.length, cycle.rows.t_s.length + 1);

  await card.getByText("A program for the device").click();
  const program = await card.getByRole("region", { name: "Drive cycle program" }).textContent();
  // A rig whose ball is always 10 mm off, for a tenth of a second.
  for (const name of Object.keys(cycle.rows)) cycle.rows[name].length = 10;
  writeFileSync(join(work, "drive-cycle.json"), JSON.stringify(cycle));
  writeFileSync(join(work, "drive-cycle.py"), program.replace("return 0.0, 0.0\n", "return 0.01, None\n"));
  execFileSync("python3", ["drive-cycle.py"], { cwd: work });
  const record = readFileSync(join(work, "drive-cycle-run.csv"), "utf8")
    .trim()
    .split("\n")
    .map((line) => line.split(","));
  assert.equal(record.length, 11);
  const [, qx, qy, x, y] = record[1];
  assert.deepEqual([x, y], ["0.010000", ""]);
  const corrected = cycle.rows.cmd_qy_rad[0] + cycle.correct_qy.proportional * -0.01;
  assert.ok(Math.abs(Number(qy) - corrected) < 1e-4, `${qy} is not ${corrected}`);
  assert.ok(
    Math.abs(Number(qx) - cycle.rows.cmd_qx_rad[0]) < 1e-6,
    "without a reading there is no correction",
  );
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a rig that is not learnt has no drive cycle, and the page says why", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/new`);
  const card = view.locator("#drive-cycle");
  await card.getByText("before the rig is calibrated").waitFor();
  assert.equal(await card.getByRole("button", { name: "Compute the drive cycle" }).count(), 0);
  await view.done();
});
