// The snippets of the set-up, run against the real program.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { ask, page, SOON, started } from "./support.mjs";

let work, service, chromium, view;

started(async (made) => {
  ({ work, service, chromium } = made);
  await ask(service.url, "POST", "/assets", { name: "bench-1" });
  view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench-1/set-up?step=connect`);
});

/** The text under `word`, as the page shows it. */
async function snippet(word) {
  await view.getByRole("button", { name: word, exact: true }).click();
  return view.getByRole("region", { name: `${word} snippet` }).textContent();
}

const samples = async () => (await ask(service.url, "GET", "/assets/bench-1/state")).samples;

/** Runs a program in the work directory until `done` returns true or it exits; returns its output. */
async function run(program, args, done = () => false) {
  const child = spawn(program, args, { cwd: work, stdio: ["ignore", "pipe", "pipe"] });
  let output = "";
  child.stdout.on("data", (bytes) => (output += bytes));
  child.stderr.on("data", (bytes) => (output += bytes));
  const ended = new Promise((end) => child.once("exit", end));
  const late = AbortSignal.timeout(SOON);
  while (child.exitCode === null && !late.aborted && !(await done()))
    await new Promise((go) => setTimeout(go, 100));
  if (child.exitCode === null && late.aborted) child.kill();
  const ok = child.exitCode === 0 || (await done());
  child.kill();
  await ended;
  return { ok, output };
}

test("curl sends a sample and a recording, and the page shows their arrival", async () => {
  const text = await snippet("curl");
  writeFileSync(
    join(work, "recording.csv"),
    "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0.01,0,0.02,0.010,-0.004\n0.02,0,0.02,0.011,-0.004\n",
  );
  const { ok, output } = await run("sh", ["-ec", text]);
  assert.ok(ok, output);
  assert.equal(output.match(/"accepted":/g).length, 2, output);
  assert.equal(await samples(), 3);
  await view.getByText("Samples received.").waitFor();
  await view.getByText("they are judged when later samples arrive").waitFor();
});

test("Python sends batches as long as it runs", async () => {
  const text = await snippet("Python");
  writeFileSync(join(work, "device.py"), text);
  await ask(service.url, "POST", "/assets/bench-1/sessions", { name: "python" });
  const { ok, output } = await run("python3", ["device.py"], async () => (await samples()) >= 60);
  assert.ok(ok, output);
  assert.doesNotMatch(output, /not sent/);
  const { items } = await ask(service.url, "GET", "/sessions?asset=bench-1&limit=1");
  assert.deepEqual([items[0].name, items[0].rejected], ["python", 0]);
});

test("the service accepts the microcontroller's request body", async () => {
  const text = await snippet("Arduino / ESP32");
  const format = /"%s(\{.*?\})",/.exec(text)[1].replaceAll('\\"', '"');
  const values = [7, 0.07, 0, 0.02, 0.01, -0.004];
  const row = format.replace(/%[.\d]*[uf]/g, () => String(values.shift()));
  assert.equal(values.length, 0, "one placeholder per value");
  const [, before, behind] = /POST\("(.*?)" \+ batch \+ "(.*?)"\)/
    .exec(text)
    .map((part) => part.replaceAll('\\"', '"'));
  const path = /URL = "http:\/\/[^/]+\/api\/v1([^"]+)"/.exec(text)[1];
  const answer = await ask(service.url, "POST", `${path}?session=esp32`, before + row + behind);
  assert.deepEqual([answer.accepted, answer.rejected, answer.last_seq], [1, [], 7]);
  assert.deepEqual(view.errors, []);
});
