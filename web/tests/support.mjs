// Starts the real program and a browser.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { after, before } from "node:test";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { stripVTControlCharacters } from "node:util";
import { chromium } from "playwright-core";

const ROOT = fileURLToPath(new URL("../..", import.meta.url));
export const BINARY =
  process.env.BINARY ?? join(process.env.CARGO_TARGET_DIR ?? join(ROOT, "target"), "debug/offbd");
const BROWSERS = [
  process.env.CHROMIUM,
  "/usr/bin/chromium",
  "/usr/bin/chromium-browser",
  "/usr/bin/google-chrome",
];

/** Timeout for anything that should appear immediately, ms: long, as other tests may keep the machine busy. */
export const SOON = 60_000;

export const directory = () => mkdtempSync(join(tmpdir(), "offbd-web-"));

/** Reads a stream until it contains an address; returns its port. */
function address(child, stream) {
  return new Promise((found, failed) => {
    let output = "";
    const late = setTimeout(() => failed(new Error(`no address was printed:\n${output}`)), SOON * 3);
    child.once("exit", (code) => failed(new Error(`it ended with ${code}:\n${output}`)));
    child[stream].on("data", (bytes) => {
      if (output.length < 1e5) output += bytes;
      const port = /(?:http:\/\/|address=)127\.0\.0\.1:(\d+)/.exec(stripVTControlCharacters(output))?.[1];
      if (!port) return;
      clearTimeout(late);
      found(Number(port));
    });
  });
}

const running = new Set();

// Programs left by a failed test would prevent Node from exiting.
after(() => {
  for (const child of running) child.kill("SIGKILL");
});

/** Starts the program; `stop` ends it as Ctrl-C would. */
async function run(args, stream) {
  assert.ok(existsSync(BINARY), `${BINARY} is missing; build it with cargo build, or name another in BINARY`);
  const child = spawn(BINARY, args, {
    env: { ...process.env, NO_COLOR: "1" },
    stdio: ["ignore", "pipe", "pipe"],
  });
  running.add(child);
  child.once("exit", () => running.delete(child));
  child.stdout.resume();
  child.stderr.resume();
  const ended = new Promise((done) => child.once("exit", done));
  const port = await address(child, stream);
  const stop = async () => {
    child.kill("SIGINT");
    await ended;
  };
  return { port, url: `http://127.0.0.1:${port}`, stop };
}

export const serve = (data, port = 0, ...more) =>
  run(["serve", "--data", data, "--listen", `127.0.0.1:${port}`, ...more], "stderr");
export const demo = (...args) => run(["demo", "--port", "0", ...args], "stdout");

/** Starts the program with an empty store, and a browser, for the tests of a file; `prepare` gets both. */
export function started(prepare) {
  const made = { work: directory() };
  before(async () => {
    made.chromium = await browser();
    made.service = await serve(join(made.work, "store"));
    await prepare(made);
  });
  after(async () => {
    await made.chromium?.close();
    await made.service?.stop();
    remove(made.work);
  });
}

/** Runs a command of the program and returns its output. */
export const offbd = (...args) =>
  execFileSync(BINARY, args, { encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });

/** Sends a request to the API; throws on an unsuccessful response. */
export async function ask(base, method, path, body, type = "application/json") {
  const answer = await fetch(`${base}/api/v1${path}`, {
    method,
    headers: body === undefined ? {} : { "content-type": type },
    body: body === undefined ? undefined : typeof body === "string" ? body : JSON.stringify(body),
  });
  const text = await answer.text();
  assert.ok(answer.ok, `${method} ${path}: ${answer.status} ${text}`);
  return text && answer.headers.get("content-type")?.includes("json") ? JSON.parse(text) : text;
}

/** Waits until `condition` resolves with true. */
export async function until(condition) {
  const deadline = Date.now() + SOON;
  while (!(await condition())) {
    assert.ok(Date.now() < deadline, "not fulfilled within the deadline");
    await new Promise((done) => setTimeout(done, 200));
  }
}

export async function browser(options = {}) {
  const executablePath = BROWSERS.find((path) => path && existsSync(path));
  assert.ok(executablePath, "no Chromium found; name one in CHROMIUM");
  return chromium.launch({
    ...options,
    executablePath,
    args: [
      "--no-sandbox",
      // Without a graphics card a page is painted with less effort than through a driver for one.
      "--disable-gpu-compositing",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--ignore-gpu-blocklist",
    ],
  });
}

/** Browser messages about an unreachable service; others are errors of the page. */
const UNREACHABLE =
  /ERR_CONNECTION_REFUSED|ERR_CONNECTION_RESET|ERR_INCOMPLETE_CHUNKED_ENCODING|ERR_EMPTY_RESPONSE/;

/** Opens a page that collects its errors, in its own context. */
export async function page(of, options = {}) {
  const context = await of.newContext({
    viewport: { width: 1280, height: 800 },
    reducedMotion: "reduce",
    ...options,
  });
  return tab(context);
}

/** Opens a page that collects its errors. */
export async function tab(context) {
  const view = await context.newPage();
  view.setDefaultTimeout(SOON);
  const errors = [];
  view.on("pageerror", (error) => errors.push(String(error)));
  view.on("console", (message) => {
    // WebGL without a graphics card warns that it is slow.
    const expected = UNREACHABLE.test(message.text()) || /GPU stall|GL Driver Message/.test(message.text());
    if (["error", "warning"].includes(message.type()) && !expected) errors.push(message.text());
  });
  return Object.assign(view, { errors, done: () => context.close() });
}

export const remove = (path) => rmSync(path, { recursive: true, force: true });
