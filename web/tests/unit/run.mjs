// Runs the tests that need neither browser nor server. Node before 22 does not run TypeScript, so
// esbuild, a dependency of Vite, bundles each test with its sources.
//
//   npm run unit              all of them
//   npm run unit -- csv time  those of csv.test.mjs and time.test.mjs
import { spawnSync } from "node:child_process";
import { readdirSync, rmSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = fileURLToPath(new URL(".", import.meta.url));
const names = process.argv.slice(2);
const tests = readdirSync(here).filter((file) => file.endsWith(".test.mjs"));
const chosen = tests.filter((file) => !names.length || names.includes(file.replace(".test.mjs", "")));

// Below node_modules, where packages are resolved and which git ignores.
const bundles = fileURLToPath(new URL("../../node_modules/.cache/unit", import.meta.url));
rmSync(bundles, { recursive: true, force: true });
await build({
  entryPoints: chosen.map((file) => join(here, file)),
  outdir: bundles,
  outExtension: { ".js": ".mjs" },
  bundle: true,
  packages: "external",
  platform: "node",
  format: "esm",
  target: "node18",
  sourcemap: "inline",
  logLevel: "warning",
});
const bundled = chosen.map((file) => join(bundles, file));
const run = spawnSync(process.execPath, ["--enable-source-maps", "--test", ...bundled], { stdio: "inherit" });
process.exitCode = run.status ?? 1;
