import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { brotliCompressSync, constants } from "node:zlib";
import { defineConfig, type Plugin } from "vite";

/** Smallest size of a file that is compressed, bytes. */
const MIN_BYTES = 1024;

/** Writes a Brotli copy beside every file, so that the service need not compress. */
function brotli(): Plugin {
  let out = "";
  return {
    name: "brotli",
    apply: "build",
    configResolved: (config) => void (out = config.build.outDir),
    closeBundle() {
      for (const entry of readdirSync(out, { recursive: true, withFileTypes: true })) {
        const path = join(entry.parentPath, entry.name);
        if (!entry.isFile() || path.endsWith(".br")) continue;
        const bytes = readFileSync(path);
        const quality = { [constants.BROTLI_PARAM_QUALITY]: 10 };
        if (bytes.length > MIN_BYTES)
          writeFileSync(`${path}.br`, brotliCompressSync(bytes, { params: quality }));
      }
    },
  };
}

export default defineConfig({
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  build: {
    assetsDir: "static",
    emptyOutDir: true,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1000,
  },
  plugins: [brotli()],
  // `npx vite` shows changes at once, with a service on the default port. The program of the
  // drive cycle is outside `web/`.
  server: {
    fs: { allow: [".."] },
    proxy: { "/api": { target: "http://127.0.0.1:8087", ws: true }, "/healthz": "http://127.0.0.1:8087" },
  },
});
