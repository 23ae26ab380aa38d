// A fault that heals before anybody has acknowledged it.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

/** Good sessions after which a fault is healed. */
const HEALING = 3;

let work, service, chromium;

started(async (made) => {
  ({ work, service, chromium } = made);
  const rig = recordings(work);
  await ask(service.url, "PUT", "/assets/bench", { ...rig.learnt, name: "bench" });
  await imported(service.url, "bench", "sick", rig.sick);
  for (let n = 1; n <= HEALING; n++) await imported(service.url, "bench", `healthy-${n}`, rig.healthy);
});

test("the list of alarms tells of it, and its page takes the acknowledgement", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms`);
  await view.getByText("1 fault healed before anybody acknowledged it").waitFor();
  await view.getByRole("link", { name: "Show all" }).click();
  await view.getByText("healed, not acknowledged").waitFor();
  await view.goto(`${service.url}/rigs/bench/faults/x_servo`);
  await view.getByText("It healed after enough sessions without the fault.").waitFor();
  await view.getByText("At its last failure:").waitFor();
  await view.getByLabel("Your name, recorded with the action").fill("ada");
  await view.getByRole("button", { name: "Acknowledge" }).click();
  await view.getByText("ada acknowledged it").waitFor();
  const { acknowledged, status } = await ask(service.url, "GET", "/assets/bench/faults/x_servo");
  assert.deepEqual([acknowledged, status], [true, "healed"]);
  await view.goto(`${service.url}/alarms`);
  await view.getByRole("heading", { name: "Alarms", exact: true }).waitFor();
  await view.getByText("No alarms").waitFor();
  assert.equal(await view.getByText("healed before anybody").count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});
