// Takes screenshots of every view in four sizes and two themes. Run by
// scripts/screenshots; the first argument is the directory, the second the views, the third the sizes.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { drifting, imported, recordings } from "./rigs.mjs";
import { ask, browser, demo, directory, page, remove, serve, until } from "./support.mjs";

const out = process.argv[2] ?? "screenshots";
const only = process.argv[3] ? process.argv[3].split(",") : undefined;
const SIZES = {
  phone: { width: 390, height: 844 },
  tablet: { width: 1024, height: 768 },
  laptop: { width: 1366, height: 850 },
  wall: { width: 1920, height: 1080 },
};
const sizes = process.argv[4] ? process.argv[4].split(",") : Object.keys(SIZES);
const THEMES = ["light", "dark"];
mkdirSync(out, { recursive: true });

/** Waits until the view has settled. */
const settle = (view, ms = 1500) => view.waitForTimeout(ms);

async function shoot(of, name, url, ready, act) {
  if (only && !only.includes(name)) return;
  for (const size of sizes) {
    const viewport = SIZES[size];
    for (const colorScheme of THEMES) {
      const view = await page(of, { viewport, colorScheme });
      await view.goto(url);
      await ready(view);
      if (act) await act(view);
      await settle(view);
      const fullPage = name !== "fleet" && (size === "phone" || name === "report");
      if (fullPage) await view.evaluate(() => scrollTo(0, 0));
      await view.screenshot({ path: join(out, `${name}-${size}-${colorScheme}.png`), fullPage });
      if (view.errors.length) console.error(`${name} ${size} ${colorScheme}:`, view.errors);
      await view.done();
    }
  }
}

/** Registers a rig that learns from a session, and so has calibrations. */
async function taught(base, healthy) {
  await ask(base, "POST", "/assets", { name: "taught" });
  const session = await imported(base, "taught", "healthy", healthy);
  const { id } = await ask(base, "POST", "/assets/taught/calibrations", { sessions: [session.id] });
  const job = `/assets/taught/calibrations/${id}`;
  await until(async () => (await ask(base, "GET", job)).state === "done");
  await ask(base, "POST", `${job}/activate`);
}

/** Adds tags, and a channel with a rule. */
async function told(base) {
  await ask(base, "PUT", "/assets/bench-1/tags", { tags: ["hall-1"] });
  await ask(base, "PUT", "/assets/demo-rig/tags", { tags: ["hall-2"] });
  const url = "http://127.0.0.1:9/hook";
  const channel = await ask(base, "POST", "/notifications/channels", { name: "workshop", webhook: { url } });
  const rule = { name: "all faults", asset: "*", channel: channel.id, codes: [], changes: ["confirmed"] };
  await ask(base, "POST", "/notifications/rules", { ...rule, enabled: true });
}

const work = directory();
const of = await browser();
const show = await demo("--data", join(work, "demo"));
const base = show.url;
try {
  const { learnt, sick, healthy, path } = recordings(work);
  await ask(base, "POST", "/assets", { ...learnt, name: "bench-1" });
  const healthyDay = await imported(base, "bench-1", "healthy", healthy);
  await taught(base, healthy);
  await told(base);
  const monday = await imported(base, "bench-1", "monday", sick);
  await drifting(base, work, learnt);
  for (let i = 2; i < 40; i++) {
    await ask(base, "POST", "/assets", { name: `bench-${i}` });
    const rows = sick.split("\n").slice(1, 200).join("\n");
    if (i % 3)
      await ask(
        base,
        "POST",
        `/assets/bench-${i}/telemetry?session=run-${i}`,
        `${sick.split("\n")[0]}\n${rows}`,
        "text/csv",
      );
  }
  const heading = (text) => (view) => view.getByRole("heading", { name: text }).first().waitFor();
  await ask(base, "POST", "/demo/faults", { fault: "x_servo:dead" });
  await shoot(of, "fleet", `${base}/`, heading("Fleet"), (view) =>
    view.getByText("X servo").first().waitFor(),
  );
  await shoot(of, "fault", `${base}/rigs/bench-1/faults/x_servo`, heading("Status byte"), (view) =>
    settle(view),
  );
  await shoot(of, "asset", `${base}/rigs/demo-rig`, heading("Monitors"), async (view) => {
    // A healthy rig whose servo then dies.
    await ask(base, "DELETE", "/demo/faults");
    await ask(base, "DELETE", "/assets/demo-rig/faults/x_servo");
    await settle(view, 5000);
    await ask(base, "POST", "/demo/faults", { fault: "x_servo:dead" });
    await view.getByRole("list", { name: "Active faults" }).waitFor();
  });
  await shoot(of, "drift", `${base}/rigs/weak`, heading("Drift over sessions"), async (view) => {
    await view.getByText("at the limit in").waitFor();
    await view.getByRole("heading", { name: "Drift over sessions" }).scrollIntoViewIfNeeded();
    await view.evaluate(() => scrollTo(0, document.body.scrollHeight));
  });
  await shoot(of, "wall", `${base}/?layout=wall`, heading("Fleet"), (view) =>
    view.getByText("weak").first().waitFor(),
  );
  await shoot(of, "alarms", `${base}/alarms?state=all`, heading("Alarms"), (view) =>
    view.getByText("What to do").first().waitFor(),
  );
  await shoot(of, "views", `${base}/alarms?tag=hall-1`, heading("Alarms"), async (view) => {
    await view.getByRole("button", { name: "Views" }).click();
    await view.getByLabel("Name of the present view").fill("first hall");
    await view.getByRole("button", { name: "Save" }).click();
  });
  await shoot(of, "notifications", `${base}/notifications`, heading("Notifications"), (view) =>
    view.getByText("workshop").first().waitFor(),
  );
  await shoot(of, "administration", `${base}/administration`, heading("Audit log"));
  await shoot(
    of,
    "calibrations",
    `${base}/rigs/taught/calibrations`,
    heading("Values of calibration"),
    (view) =>
      view
        .getByRole("img", { name: /^Residual along/ })
        .first()
        .waitFor(),
  );
  await shoot(
    of,
    "compare",
    `${base}/compare?a=${healthyDay.id}&b=${monday.id}`,
    heading("Compare sessions"),
    (view) =>
      view
        .getByRole("img", { name: /^Residual along/ })
        .first()
        .waitFor(),
  );
  await shoot(of, "report", `${base}/sessions/${monday.id}/report`, heading("Calibration and"));
  await shoot(of, "fault-report", `${base}/rigs/bench-1/faults/x_servo/report`, heading("Calibration and"));
  await shoot(of, "sessions", `${base}/sessions`, heading("Sessions"), (view) =>
    view.getByText("monday").first().waitFor(),
  );
  await shoot(of, "session", `${base}/sessions/${monday.id}?t=19`, heading("Judge again"), async (view) => {
    await view.getByRole("button", { name: "Play" }).waitFor();
    await view.getByRole("button", { name: "Judge again" }).click();
    await view.getByText("Different verdict").waitFor();
  });
  await shoot(of, "import", `${base}/sessions`, heading("Sessions"), async (view) => {
    await view.getByText("monday").first().waitFor();
    await view.locator("input[type=file]").setInputFiles(path("sick.csv"));
    await view.getByText("of the rows").first().waitFor();
  });
  await shoot(of, "set-up", `${base}/set-up`, heading("Set up a rig"));
  await shoot(of, "connect", `${base}/rigs/bench-3/set-up?step=connect`, heading("Set up bench-3"));
  await shoot(of, "check", `${base}/rigs/demo-rig/set-up?step=check`, heading("Signs and units"), (view) =>
    settle(view, 5000),
  );
  await shoot(of, "learn-rig", `${base}/rigs/bench-1/set-up?step=learn`, heading("Detection times"));
  await shoot(of, "demo", `${base}/learn`, heading("Inject faults"), (view) => settle(view));
  await shoot(of, "missing", `${base}/rigs/nobody`, heading("nobody"));
} finally {
  await of.close();
  await show.stop();
}
const empty = await serve(join(work, "empty"));
const emptyBrowser = await browser();
try {
  await shoot(emptyBrowser, "empty", `${empty.url}/`, (view) => view.getByText("No rig yet").waitFor());
} finally {
  await emptyBrowser.close();
  await empty.stop();
  remove(work);
}
