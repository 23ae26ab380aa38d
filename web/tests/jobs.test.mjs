// The page of background jobs: what runs, what waits for what, and how to cancel it.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started, until } from "./support.mjs";

let service, chromium, session;

started(async ({ work, ...made }) => {
  ({ service, chromium } = made);
  const { rig, healthy } = recordings(work);
  for (const name of ["bench", "shelf"]) await ask(service.url, "POST", "/assets", { ...rig, name });
  session = {
    bench: await imported(service.url, "bench", "monday", healthy),
    shelf: await imported(service.url, "shelf", "monday", healthy),
  };
});

const calibrate = (asset) =>
  ask(service.url, "POST", `/assets/${asset}/calibrations`, { sessions: [session[asset].id] });

test("the jobs are listed, and one that waits can be cancelled", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.getByRole("link", { name: "Jobs" }).click();
  await view.getByRole("heading", { name: "Jobs", exact: true }).waitFor();
  const jobs = [await calibrate("bench"), await calibrate("bench"), await calibrate("shelf")];
  // The rigs calibrate themselves, too.
  const rows = view.getByRole("row").filter({ hasText: "a person" });
  await rows.filter({ hasText: "Calibrate the rig" }).filter({ hasText: "Running" }).first().waitFor();
  const last = rows.filter({ hasText: /Waiting for \d+ other job/ }).last();
  await last.waitFor();
  await last.getByRole("button", { name: /^Cancel the job of/ }).click();
  const states = () =>
    Promise.all(jobs.map(({ asset, id }) => ask(service.url, "GET", `/assets/${asset}/calibrations/${id}`)));
  await until(async () =>
    (await states()).some(({ state, error }) => state === "failed" && /cancelled/.test(error)),
  );
  for (const { asset, id, state } of await states())
    if (state === "queued" || state === "running")
      await ask(service.url, "POST", `/assets/${asset}/calibrations/${id}/cancel`).catch(() => {});
  await view.getByText("Nothing runs, and nothing waits.").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
