// Files that the service reads itself, several files at once, and downloads in other formats.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

/** Files of other programs, each with two samples, one of them without a position. */
const FOREIGN = ["pandas.parquet", "polars.arrow", "openpyxl.xlsx"];
const foreign = (name) => readFileSync(new URL(`../../tests/formats/${name}`, import.meta.url));

let service, chromium, rig, session;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
  session = await imported(service.url, "bench", "sick", rig.sick);
});

/** Chooses a file and returns the dialogue with the rig filled in. */
async function chosen(view, name, buffer) {
  await view.goto(`${service.url}/sessions`);
  await view.locator("input[type=file]").setInputFiles({ name, mimeType: "", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue.getByText("Choose the rig.").waitFor();
  await dialogue.getByLabel("Rig").fill("bench");
  return dialogue;
}

for (const name of FOREIGN)
  test(`${name} is imported as it is, by its first bytes`, async () => {
    const view = await page(chromium);
    const dialogue = await chosen(view, `${name}.bin`, foreign(name));
    await dialogue.getByRole("button", { name: /^Import [\d\s]+ rows/ }).click();
    await dialogue.waitFor({ state: "hidden" });
    await view.getByRole("heading", { name, exact: true }).waitFor();
    const { items } = await ask(service.url, "GET", `/sessions?name=${name}`);
    assert.ok(items[0].samples >= 2, `${items[0].samples} samples`);
    assert.deepEqual(view.errors, []);
    await view.done();
  });

test("a recording is downloaded in the chosen format, and imported from it", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  const download = async (word, suffix, head) => {
    await view.getByLabel("Format").selectOption({ label: word });
    const [file] = await Promise.all([
      view.waitForEvent("download"),
      view.getByRole("button", { name: `Download ${word}` }).click(),
    ]);
    assert.equal(file.suggestedFilename(), `bench-sick.${suffix}`);
    const bytes = readFileSync(await file.path());
    assert.equal(bytes.subarray(0, head.length).toString("latin1"), head);
    return bytes;
  };
  await download("JSON", "json", '{"session"');
  await download("Parquet", "parquet", "PAR1");
  const bytes = await download("MCAP", "mcap", "\x89MCAP0");
  const dialogue = await chosen(view, "copied.mcap", bytes);
  await dialogue.getByRole("button", { name: /^Import [\d\s]+ rows/ }).click();
  await dialogue.waitFor({ state: "hidden" });
  await view.getByRole("heading", { name: "copied", exact: true }).waitFor();
  const { items } = await ask(service.url, "GET", "/sessions?name=copied");
  assert.equal(items[0].samples, session.samples);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a sheet with other columns, and a damaged file, are refused with the reason", async () => {
  const view = await page(chromium);
  const open = async (name, buffer) => {
    await view.goto(`${service.url}/sessions`);
    await view.locator("input[type=file]").setInputFiles({ name, mimeType: "", buffer });
    return view.getByRole("dialog");
  };
  const sheet = await open("columns.xlsx", foreign("columns.xlsx"));
  await sheet.getByText("No column is likely to be cmd_qy_rad").waitFor();
  assert.ok(await sheet.getByRole("button", { name: /^Import 0 rows/ }).isDisabled());
  const cut = await open("cut.parquet", foreign("pandas.parquet").subarray(0, 900));
  await cut
    .getByRole("alert")
    .getByText(/damaged/)
    .waitFor();
  await view.done();
});

test("a service without the format says so", async () => {
  const view = await page(chromium);
  const refuse = (status) => (route) =>
    route.fulfill({
      status,
      contentType: "application/problem+json",
      body: JSON.stringify({ detail: "this build of offbd has no Parquet" }),
    });
  await view.route("**/sessions/import?*", refuse(415));
  await view.route("**/sessions/*/telemetry", refuse(406));
  await view.goto(`${service.url}/sessions`);
  const file = { name: "run.parquet", mimeType: "", buffer: foreign("pandas.parquet") };
  await view.locator("input[type=file]").setInputFiles(file);
  await view.getByRole("alert").getByText("this build of offbd has no Parquet").waitFor();
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByLabel("Format").selectOption({ label: "Arrow" });
  await view.getByRole("button", { name: "Download Arrow" }).click();
  await view.getByText(/This service is built without Arrow files/).waitFor();
  await view.done();
});

test("a build offers only what it has", async () => {
  const view = await page(chromium);
  const health = await (await fetch(`${service.url}/healthz`)).json();
  assert.ok(health.features.includes("parquet") && health.features.includes("email"));
  await view.route("**/healthz", (route) => route.fulfill({ json: { ...health, features: ["mcap"] } }));
  await view.goto(`${service.url}/sessions/${session.id}`);
  const formats = view.getByLabel("Format").locator("option");
  await view.waitForFunction(
    () => document.querySelector("option[value=mcap]") && !document.querySelector("option[value=parquet]"),
  );
  assert.deepEqual(await formats.allTextContents(), ["CSV", "JSON", "MCAP"]);
  await view.goto(`${service.url}/sessions`);
  await view.getByText("Drop a recording here (CSV, JSON or MCAP), or").waitFor();
  await view.goto(`${service.url}/notifications`);
  await view.getByRole("button", { name: "Add a channel" }).click();
  await view.getByLabel("Kind").selectOption({ label: "E-mail (not in this build)" });
  await view.getByText("This service is built without e-mail").waitFor();
  assert.equal(await view.getByLabel("Mail server").count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("of several dropped files one is taken, and the page says which", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.getByText("Drop a recording").waitFor();
  const drop = (...names) =>
    view.evaluate(
      ([names, text]) => {
        const files = new DataTransfer();
        for (const name of names) files.items.add(new File([text], name, { type: "text/csv" }));
        dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
      },
      [names, rig.sick],
    );
  await drop("monday.csv", "tuesday.csv", "friday.csv");
  await view.getByText("Only monday.csv was taken; import files one by one.").waitFor();
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });
  await drop("monday.csv");
  await view.getByRole("dialog").getByText("Columns of the file").waitFor();
  assert.equal(await view.getByText("was taken").count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});
