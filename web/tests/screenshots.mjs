// Takes screenshots of every view in three sizes and two themes. Run by
// scripts/screenshots; the first argument is the directory.
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { ask, browser, demo, directory, drifting, page, recordings, remove, serve } from "./support.mjs";

const out = process.argv[2] ?? "screenshots";
const only = process.argv[3]?.split(",");
const SIZES = {
  phone: { width: 390, height: 844 },
  laptop: { width: 1366, height: 850 },
  wall: { width: 2560, height: 1440 },
};
const THEMES = ["light", "dark"];
mkdirSync(out, { recursive: true });

/** Waits until the view has settled. */
const settle = (view, ms = 1500) => view.waitForTimeout(ms);

async function shoot(of, name, url, ready, act) {
  if (only && !only.includes(name)) return;
  for (const [size, viewport] of Object.entries(SIZES)) {
    for (const colorScheme of THEMES) {
      const view = await page(of, { viewport, colorScheme });
      await view.goto(url);
      await ready(view);
      if (act) await act(view);
      await settle(view);
      const fullPage = size === "phone" && name !== "fleet";
      if (fullPage) await view.evaluate(() => scrollTo(0, 0));
      await view.screenshot({ path: join(out, `${name}-${size}-${colorScheme}.png`), fullPage });
      if (view.errors.length) console.error(`${name} ${size} ${colorScheme}:`, view.errors);
      await view.done();
    }
  }
}

const work = directory();
const of = await browser();
const show = await demo("--data", join(work, "demo"));
const base = show.url;
try {
  const { learnt, sick, healthy, path } = recordings(work);
  await ask(base, "POST", "/assets", { ...learnt, name: "bench-1" });
  await ask(base, "POST", "/assets/bench-1/sessions/import?name=healthy", healthy, "text/csv");
  const imported = await ask(base, "POST", "/assets/bench-1/sessions/import?name=monday", sick, "text/csv");
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
    // A healthy rig whose servo is then reversed.
    await ask(base, "DELETE", "/demo/faults");
    await ask(base, "DELETE", "/assets/demo-rig/faults/x_servo");
    await settle(view, 5000);
    await ask(base, "POST", "/demo/faults", { fault: "x_servo:reversed" });
    await view.getByRole("list", { name: "Active faults" }).waitFor();
  });
  await shoot(of, "drift", `${base}/rigs/weak`, heading("Drift over sessions"), async (view) => {
    await view.getByText("at the limit in").waitFor();
    await view.getByRole("heading", { name: "Drift over sessions" }).scrollIntoViewIfNeeded();
    await view.evaluate(() => scrollTo(0, document.body.scrollHeight));
  });
  await shoot(of, "sessions", `${base}/sessions`, heading("Sessions"), (view) =>
    view.getByText("monday").first().waitFor(),
  );
  await shoot(
    of,
    "session",
    `${base}/sessions/${imported.session.id}?t=19`,
    heading("Judge it again"),
    async (view) => {
      await view.getByRole("button", { name: "Play" }).waitFor();
      await view.getByRole("button", { name: "Judge again" }).click();
      await view.getByText("Another verdict").waitFor();
    },
  );
  await shoot(of, "import", `${base}/sessions`, heading("Sessions"), async (view) => {
    await view.getByText("monday").first().waitFor();
    await view.locator("input[type=file]").setInputFiles(path("sick.csv"));
    await view.getByText("as it should").first().waitFor();
  });
  await shoot(of, "set-up", `${base}/set-up`, heading("Set up a rig"));
  await shoot(of, "connect", `${base}/rigs/bench-3/set-up?step=connect`, heading("Set up bench-3"));
  await shoot(of, "check", `${base}/rigs/demo-rig/set-up?step=check`, heading("Signs and units"), (view) =>
    settle(view, 5000),
  );
  await shoot(of, "learn-rig", `${base}/rigs/bench-1/set-up?step=learn`, heading("What was learnt"));
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
