// The dialogue for recordings that are dropped or chosen: long ones, foreign ones, and files that are none.
import assert from "node:assert/strict";
import { test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

test("a long recording is shown in the dialogue and can be imported", async () => {
  const lines = rig.sick.trim().split("\n");
  const n = 70_000;
  const at = (i) => (0.01 * i).toFixed(2);
  const row = (i) => lines[1 + (i % (lines.length - 1))].split(",").slice(1);
  const text = [lines[0], ...Array.from({ length: n }, (_, i) => [at(i), ...row(i)].join(","))].join("\n");
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  const buffer = Buffer.from(text);
  await view.locator("input[type=file]").setInputFiles({ name: "long.csv", mimeType: "text/csv", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue.getByText("70\u202f000 rows over 700.0\u202fs").waitFor();
  await dialogue.getByLabel("Rig").fill("bench");
  assert.ok(await dialogue.getByRole("button", { name: /^Import 70\s000 rows/ }).isEnabled());
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a dropped file opens the dialogue; a file that is not a recording is refused", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.getByText("Drop a recording").waitFor();
  const drop = (name, text) =>
    view.evaluate(
      ([name, text]) => {
        const files = new DataTransfer();
        files.items.add(new File([text], name, { type: "text/csv" }));
        dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
      },
      [name, text],
    );
  await drop("letter.csv", "Dear all,\nno recording.\nYours\n");
  await view.getByRole("alert").getByText("No line has three or more columns").waitFor();
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });
  await drop("picture.csv", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR,\x02,\x01\n1,2,3\n4,5,6\n");
  await view.getByRole("alert").getByText("This file is neither a text nor").waitFor();
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });

  // Times that are dates: nothing can be imported, and no rig is registered.
  await drop("dates.csv", "t_s,x_m,y_m\n2026-03-01T10:00:00.020,0,0\n2026-03-01T10:00:00.040,0,0\n");
  await view.getByRole("dialog").getByLabel("Rig").fill("stranger");
  await view.getByText("The column of the time has no numbers").waitFor();
  assert.ok(await view.getByRole("button", { name: /^Import 0 rows/ }).isDisabled());
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });
  await drop("dropped.csv", rig.sick);
  const dialogue = view.getByRole("dialog");
  await dialogue.getByLabel("Rig").fill("new-rig");
  await dialogue.getByText("There is no rig new-rig yet").waitFor();
  await dialogue.getByRole("button", { name: /^Import/ }).click();
  await view.getByRole("heading", { name: "dropped" }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a time in milliseconds under the name of seconds is found by the rate of the rig", async () => {
  const [head, ...lines] = rig.healthy.trim().split("\n");
  const rows = lines.map((line) => line.replace(/^[\d.]+/, (t) => String(Math.round(Number(t) * 1000))));
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  const buffer = Buffer.from([head, ...rows].join("\n"));
  await view.locator("input[type=file]").setInputFiles({ name: "ms.csv", mimeType: "text/csv", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue
    .getByText(/A row comes every 10.* but the rig sends 100 per second: is the time in ms\?/)
    .waitFor();
  await dialogue.getByRole("button", { name: "Time is in ms" }).click();
  await dialogue.getByText("90.0\u202fs: 100.0\u202fHz").waitFor();
  assert.equal(await dialogue.getByText("is the time in").count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});
