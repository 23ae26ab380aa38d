// Rigs and their recordings, simulated by the program.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { ask, offbd, SOON } from "./support.mjs";

/** A learnt rig, and a session in which its x servo dies at 20 s. */
export function recordings(where) {
  const path = (name) => join(where, name);
  offbd(
    "simulate",
    "--reference",
    "lissajous",
    "--seconds",
    "90",
    "--rig",
    path("rig.json"),
    "-o",
    path("healthy.csv"),
  );
  offbd("calibrate", "--asset", path("rig.json"), path("healthy.csv"), "-o", path("calibrated.json"));
  offbd("simulate", "--seed", "2", "--seconds", "40", "--fault", "x_servo:dead@20", "-o", path("sick.csv"));
  const read = (name) => readFileSync(path(name), "utf8");
  return {
    path,
    rig: JSON.parse(read("rig.json")),
    learnt: JSON.parse(read("calibrated.json")),
    healthy: read("healthy.csv"),
    sick: read("sick.csv"),
  };
}

/** Imports a recording and returns its session. */
export async function imported(base, asset, name, text) {
  const path = `/assets/${asset}/sessions/import?name=${name}`;
  return (await ask(base, "POST", path, text, "text/csv")).session;
}

/** Calibrates a rig from a session and uses the result. */
export async function calibrated(base, asset, session) {
  const calibrations = `/assets/${asset}/calibrations`;
  let job = await ask(base, "POST", calibrations, { sessions: [session] });
  for (const until = Date.now() + 3 * SOON; job.state !== "done" && Date.now() < until;)
    job = await ask(base, "GET", `${calibrations}/${job.id}`);
  assert.equal(job.state, "done", job.error);
  await ask(base, "POST", `${calibrations}/${job.id}/activate`);
}

/** Registers a learnt rig whose x servo loses 2 % of its gain with each of `n` sessions. */
export async function drifting(base, where, learnt, name = "weak", n = 12) {
  await ask(base, "POST", "/assets", { ...learnt, name });
  for (let i = 0; i < n; i++) {
    const path = join(where, "drifting.csv");
    const args = [
      "simulate",
      "--reference",
      "lissajous",
      "--seed",
      `${100 + i}`,
      "--fault",
      `x_servo:gain=${1 - 0.02 * i}@0`,
      "-o",
      path,
    ];
    offbd(...args);
    await imported(base, name, `day-${i + 1}`, readFileSync(path, "utf8"));
  }
}
