// The demo: a fault is injected by a button, shown live, explained, repaired and cleared.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { ask, browser, demo, page, SOON, until } from "./support.mjs";

let show, chromium;

before(async () => {
  chromium = await browser();
  show = await demo();
});

after(async () => {
  await chromium?.close();
  await show?.stop();
});

/** Resolves with the first event of the fleet for which `wanted` is true; Node 18 has no EventSource. */
async function event(base, wanted) {
  const answer = await fetch(`${base}/api/v1/events`);
  const found = (async () => {
    let text = "";
    for await (const part of answer.body) {
      text += Buffer.from(part);
      const lines = text.split("\n").filter((line) => line.startsWith("data:") && line.endsWith("}"));
      const hit = lines.map((line) => JSON.parse(line.slice(5))).find(wanted);
      if (hit) return hit;
    }
  })();
  return { found };
}

test("a fault is shown after its event, on the pages of the fleet and the rig", async () => {
  const fleet = await page(chromium);
  const rig = await page(chromium);
  const buttons = await page(chromium);
  await fleet.goto(show.url);
  await fleet.getByRole("link", { name: /demo-rig/ }).waitFor();
  await rig.goto(`${show.url}/rigs/demo-rig`);
  await rig.getByRole("heading", { name: "Monitors" }).waitFor();
  await buttons.goto(`${show.url}/learn`);
  // The lesson below needs some seconds without a fault: between two faults of the script there
  // may be none.
  await until(async () => {
    const { items } = await ask(show.url, "GET", "/sessions");
    return items.some(({ first_t_s: first, last_t_s: last }) => last - first > 7);
  });
  const confirmed = await event(show.url, (line) => line.code === "y_servo" && line.status === "confirmed");
  await buttons.getByRole("button", { name: "Inject: Y servo, dead" }).click();
  await buttons.getByText("Injected faults").waitFor();
  const line = await confirmed.found;
  await Promise.all([
    fleet.getByRole("region", { name: "Rigs" }).getByText("Y servo").waitFor(),
    rig.getByRole("list", { name: "Active faults" }).getByText("Y servo").waitFor(),
  ]);
  assert.equal(line.asset, "demo-rig");
  // The banner says what is wrong and since when.
  const banner = rig.getByRole("list", { name: "Active faults" }).getByRole("link", { name: /Y servo/ });
  await banner.getByText(/failing since \d/).waitFor();
  await rig.getByText("failed", { exact: true }).waitFor();
  for (const view of [fleet, rig, buttons]) {
    assert.deepEqual(view.errors, []);
    if (view !== rig) await view.done();
  }

  // The rig's page is live: the twin's tilt and the session's samples change.
  const samples = rig.locator("dt:text-is('Samples') + dd");
  const before = await samples.textContent();
  await rig.waitForFunction(
    (was) =>
      [...document.querySelectorAll("dt")].find((dt) => dt.textContent === "Samples").nextSibling
        .textContent !== was,
    before,
  );
  assert.match(await rig.getByLabel("Tilt of the twin's plate").textContent(), /qx .*° +qy .*°/);

  // The fault's page: its sentence, status bits and charts.
  await rig
    .getByRole("link", { name: /Look at it/ })
    .first()
    .click();
  await rig.getByRole("heading", { name: /Status byte/ }).waitFor();
  await rig.getByText("The test failed when it last gave a result.").waitFor();
  await rig.getByRole("img", { name: /Residual along y/ }).waitFor();
  await rig.getByLabel("Your name, recorded with the action").fill("ada");
  await rig.getByRole("button", { name: "Acknowledge" }).click();
  await rig.getByText("ada acknowledged it").waitFor();
  await ask(show.url, "DELETE", "/demo/faults");
  // After the repair the fault is on record, and the sentence of its last failure is the headline.
  await rig.getByText("Its test passes again since").waitFor({ timeout: 3 * SOON });
  await rig.getByText("At its last failure:").waitFor();
  assert.match(await rig.locator(".sentence").textContent(), /acceleration along y/i);
  await rig.getByText("was confirmed, passes again, acknowledged").waitFor();
  await rig.getByText("passes its test again").first().waitFor();
  await rig.getByRole("button", { name: "Clear" }).click();
  await rig.getByRole("dialog").getByRole("button", { name: "Cancel" }).click();
  await rig.getByRole("button", { name: "Clear" }).click();
  await rig.getByRole("dialog").getByRole("button", { name: "Clear" }).click();
  await rig.getByText("Nothing is on record").waitFor();
  await rig.getByText("ada cleared it").waitFor();
  assert.deepEqual(rig.errors, []);
  await rig.done();
});

test("the script resumes, and the demo continues after a visitor ends the session", async () => {
  const view = await page(chromium);
  // Another address of the lessons.
  await view.goto(`${show.url}/demo`);
  await view.waitForURL(/\/learn$/);
  await view.getByRole("button", { name: "Resume the script" }).click();
  await view.getByText("A script breaks and repairs the rig").waitFor();
  await view.goto(`${show.url}/rigs/demo-rig`);
  const session = view.locator("dt:text-is('Session') + dd");
  await session.getByText("demo-").waitFor();
  const before = await session.textContent();
  await view.getByRole("button", { name: "End session" }).click();
  await view.getByRole("dialog").getByRole("button", { name: "End session" }).click();
  await view.waitForFunction((was) => {
    const now = [...document.querySelectorAll("dt")].find((dt) => dt.textContent === "Session").nextSibling
      .textContent;
    return now.startsWith("demo-") && now !== was;
  }, before);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a visitor tunes the controller of the rig", async () => {
  const view = await page(chromium);
  await view.goto(`${show.url}/learn`);
  const slider = view.getByRole("slider", { name: "Kd" });
  const { gains, initial } = await ask(show.url, "GET", "/demo/gains");
  assert.deepEqual(gains, initial);
  await slider.press("Home");
  await until(async () => (await ask(show.url, "GET", "/demo/gains")).gains.kd === 0);
  // The other gains stay, to the precision of the sliders.
  const tuned = await ask(show.url, "GET", "/demo/gains");
  assert.deepEqual(tuned, { gains: { ...initial, kd: 0 }, initial });
  assert.match(await slider.getAttribute("aria-valuetext"), /^0\.00/);
  await view.getByRole("button", { name: "Reset the gains" }).click();
  await until(async () => (await ask(show.url, "GET", "/demo/gains")).gains.kd === initial.kd);
  await slider.and(view.locator(`[aria-valuetext^="${initial.kd.toFixed(2)}"]`)).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a rig that is healthy by the default profile exceeds the textbook's limit", async () => {
  const view = await page(chromium);
  await view.goto(`${show.url}/learn`);
  await view.getByRole("heading", { name: "textbook" }).waitFor();
  const share = view.locator("dt:text-is('Beyond the limit') + dd");
  await view.waitForFunction(
    () =>
      [...document.querySelectorAll("dt")].filter(
        (dt) => dt.textContent === "Beyond the limit" && /\d/.test(dt.nextSibling.textContent),
      ).length === 2,
  );
  await view.getByText("3. Diagnosis: which limit").click();
  await view.getByText("offbd scene bad-x-servo").waitFor();
  const [usual, textbook] = (await share.allTextContents()).map((text) => parseInt(text, 10));
  assert.ok(textbook > 10 && usual < textbook / 2, `default ${usual} %, textbook ${textbook} %`);
  await view
    .getByRole("img", { name: /Speed against accuracy/ })
    .first()
    .waitFor();
  await view.done();
});
