// The walkthrough of docs/walk.md, from the demo to the explanation of a fault. The words that it
// has in italics or bold must be on the page.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { ask, browser, demo, offbd, page, until } from "./support.mjs";

const WALK = readFileSync(new URL("../../docs/walk.md", import.meta.url), "utf8");

let show, chromium, view;

before(async () => {
  chromium = await browser();
  show = await demo();
  view = await page(chromium);
});

after(async () => {
  await chromium?.close();
  await show?.stop();
});

/** Presses the element that the walkthrough calls `words`. */
async function press(words, role = "button", name = words) {
  assert.ok(WALK.replace(/\s+/g, " ").includes(words), `the walk does not say “${words}”`);
  await view.getByRole(role, { name }).first().click();
}

test("from the demo to the explanation of a fault", async () => {
  await view.goto(show.url);
  await view.getByRole("link", { name: /demo-rig/ }).waitFor();
  // A reader watches the healthy rig for a moment; the lesson shows what lies before the fault.
  await until(async () => {
    const { items } = await ask(show.url, "GET", "/sessions");
    return items.some(({ first_t_s: first, last_t_s: last }) => last - first > 8);
  });

  await press("Lessons", "link");
  await view.getByText("A script breaks and repairs the rig").waitFor();
  await press("Repair all");
  await view.getByText("The script is paused: you control the faults.").waitFor();
  await press("dead", "button", "Inject: X servo, dead");
  await press("Watch demo-rig", "link");
  const monitor = view
    .getByRole("listitem")
    .filter({ hasText: "X servo" })
    .filter({ has: view.getByRole("meter") });
  await monitor.getByText("failed", { exact: true }).waitFor();
  for (const chart of ["Residual along x", "Acceleration along x"])
    await view.getByRole("img", { name: chart }).waitFor();

  await press("Look at it", "link", /X servo.*Look at it/);
  assert.match(await view.locator(".sentence").textContent(), /^[A-Z].*\.$/);
  await view.getByRole("heading", { name: "Possible causes" }).waitFor();
  await view.getByRole("heading", { name: /Status byte/ }).waitFor();
  await view.getByRole("row").filter({ hasText: "confirmedDTC" }).waitFor();
  await view.getByRole("img", { name: /Residual along x/ }).waitFor();

  await press("Play the session back", "link");
  await press("Judge again");
  await view.getByText("Different verdict").waitFor();

  await press("Lessons", "link");
  await press("Repair all");
  await view.getByText("The simulated rig is healthy.").waitFor();
  await view.getByRole("heading", { name: "textbook" }).waitFor();
  await view.goto(`${show.url}/rigs/demo-rig/faults/x_servo`);
  await view.getByLabel("Your name, recorded with the action").fill("ada");
  await press("acknowledge", "button", "Acknowledge");
  await view.locator("dt:text-is('Acknowledged') + dd").getByText("ada").waitFor();
  await press("clear", "button", "Clear");
  await view.getByRole("dialog").getByRole("button", { name: "Clear" }).click();
  await view.locator("dt:text-is('Cleared') + dd").getByText("ada").waitFor();

  await press("Set up", "link");
  await view.getByRole("heading", { name: "Set up a rig" }).waitFor();
  await press("Sessions", "link");
  await view.getByText(/drop/i).first().waitFor();
  assert.deepEqual(view.errors, []);
});

test("the rig can be followed in a terminal", () => {
  assert.ok(WALK.includes("`offbd watch demo-rig`"));
  const text = offbd("watch", "demo-rig", "--address", `127.0.0.1:${show.port}`, "--states", "2");
  assert.match(text, /^demo-rig, demo-\S+\n/);
  // Time, samples, and the residuals with their limits, as the rig moves.
  const state = /^ *(\d+\.\d\d) s +(\d+) +[-+]\d\.\d\d\/\d\.\d\d +[-+]\d\.\d\d\/\d\.\d\d /gm;
  const [before, now] = [...text.matchAll(state)].map(([, ...numbers]) => numbers.map(Number));
  assert.ok(now[0] > before[0] && now[1] > before[1], text);
});
