// Measures the page: time to the first interaction, frame rate, scripting per frame, and a fleet
// of thousands. Prints the figures without limits, as they depend on the machine. BINARY is the
// path of the program.
import { ask, browser, demo, directory, page, remove, serve } from "./support.mjs";

const SECONDS = 8;
const RIGS = 5000;

/** Counts frames, long tasks, and the time that callbacks of frames take. */
const watch = () => {
  const seen = (window.seen = { frames: 0, late: 0, scripting: 0, long: 0, longest: 0, skip: false });
  const real = window.requestAnimationFrame.bind(window);
  let last = 0;
  window.requestAnimationFrame = (draw) =>
    real((now) => {
      const begun = performance.now();
      draw(now);
      seen.scripting += performance.now() - begun;
      if (now !== last) {
        seen.frames++;
        if (last && now - last > 25) seen.late++;
        last = now;
      }
    });
  new PerformanceObserver((list) => {
    for (const { duration } of list.getEntries()) {
      seen.long++;
      seen.longest = Math.max(seen.longest, duration);
    }
  }).observe({ type: "longtask" });
};

async function frames(view, what) {
  await view.evaluate(() =>
    Object.assign(window.seen, { frames: 0, late: 0, scripting: 0, long: 0, longest: 0 }),
  );
  const client = await view.context().newCDPSession(view);
  await client.send("Performance.enable");
  const metrics = async () => {
    const { metrics } = await client.send("Performance.getMetrics");
    return Object.fromEntries(metrics.map(({ name, value }) => [name, value]));
  };
  const before = await metrics();
  await view.waitForTimeout(SECONDS * 1000);
  const after = await metrics();
  const seen = await view.evaluate(() => window.seen);
  const perFrame = (name) => `${((1000 * (after[name] - before[name])) / seen.frames).toFixed(2)} ms`;
  const figures = [
    `${(seen.frames / SECONDS).toFixed(1)} frames/s, ${seen.late} later than 25 ms`,
    `per frame: callbacks ${(seen.scripting / seen.frames).toFixed(2)} ms, ` +
      `all scripting ${perFrame("ScriptDuration")}, layout ${perFrame("LayoutDuration")}, ` +
      `style ${perFrame("RecalcStyleDuration")}`,
    `long tasks ${seen.long}, longest ${seen.longest.toFixed(0)} ms`,
  ];
  console.log(`${what}: ${figures.join("; ")}`);
}

async function opened(of, url, what, ready) {
  const times = [];
  for (let i = 0; i < 5; i++) {
    const view = await page(of);
    const begun = performance.now();
    await view.goto(url, { waitUntil: "commit" });
    await ready(view);
    times.push(performance.now() - begun);
    await view.done();
  }
  console.log(
    `${what}: ${times.map((ms) => ms.toFixed(0)).join(", ")} ms from the request to the first interaction`,
  );
}

const of = await browser();
const show = await demo();
try {
  await opened(of, show.url, "fleet", (view) => view.getByRole("searchbox").fill("demo"));
  await opened(of, `${show.url}/rigs/demo-rig`, "rig", (view) =>
    view.getByRole("button", { name: "30 s" }).click(),
  );
  const view = await page(of, { reducedMotion: "no-preference" });
  await view.addInitScript(watch);
  await view.goto(`${show.url}/rigs/demo-rig`);
  await view.locator(".stage canvas").waitFor();
  await view.waitForTimeout(4000);
  await frames(view, "rig, 3D and charts");
  await view.getByRole("button", { name: "60 s" }).click();
  await frames(view, "rig, 3D and charts of 60 s");
  await view.getByRole("button", { name: "10 s" }).click();
  await view.evaluate(() => (document.querySelector(".stage").style.display = "none"));
  await frames(view, "rig, 3D hidden");
  await view.done();
} finally {
  await show.stop();
}
const data = directory();
const service = await serve(data);
try {
  for (let i = 0; i < RIGS; i += 100) {
    await Promise.all(
      Array.from({ length: 100 }, (_, k) => ask(service.url, "POST", "/assets", { name: `rig-${i + k}` })),
    );
  }
  await opened(of, service.url, `fleet of ${RIGS}`, (view) => view.getByRole("searchbox").fill("rig-49"));
  const view = await page(of, { reducedMotion: "no-preference" });
  await view.addInitScript(watch);
  await view.goto(service.url);
  await view.getByRole("link", { name: /rig-1\b/ }).waitFor();
  await view.evaluate(() => {
    let y = 0;
    const step = () => {
      scrollTo(0, (y += 97) % document.body.scrollHeight);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  });
  await frames(view, `fleet of ${RIGS} scrolling`);
  await view.done();
} finally {
  await of.close();
  await service.stop();
  remove(data);
}
