// Checks beyond formatting: errors, misuse of hooks, and overly long files and functions.
import eslint from "@eslint/js";
import hooks from "eslint-plugin-react-hooks";
import { defineConfig } from "eslint/config";
import globals from "globals";
import typescript from "typescript-eslint";

export default defineConfig(
  { ignores: ["generated", "dist"] },
  { linterOptions: { reportUnusedDisableDirectives: "error" } },
  eslint.configs.recommended,
  {
    rules: {
      "max-lines": ["error", 150],
      "max-lines-per-function": ["error", { max: 50, skipBlankLines: true, skipComments: true }],
      // The formatter breaks lines at 110 columns; strings that it cannot break may be slightly longer.
      "max-len": ["error", { code: 120, ignoreUrls: true }],
      "one-var": ["error", { initialized: "never" }],
    },
  },
  {
    files: ["**/*.{ts,tsx}"],
    extends: [typescript.configs.recommendedTypeChecked],
    plugins: { "react-hooks": hooks },
    languageOptions: { parserOptions: { projectService: { allowDefaultProject: ["vite.config.ts"] } } },
    rules: {
      // Event handlers may be asynchronous: their result is ignored.
      "@typescript-eslint/no-misused-promises": ["error", { checksVoidReturn: { attributes: false } }],
      "react-hooks/rules-of-hooks": "error",
      "react-hooks/exhaustive-deps": "error",
    },
  },
  // Runs in Node, whose types are not installed.
  { files: ["vite.config.ts"], extends: [typescript.configs.disableTypeChecked] },
  {
    // Functions in a test run in Node or, passed to the browser, in the page.
    files: ["**/*.{mjs,js}"],
    languageOptions: { globals: { ...globals.node, ...globals.browser } },
    rules: {
      // Tests of a whole workflow are longer.
      "max-lines": ["error", 200],
      "max-lines-per-function": ["error", { max: 80, skipBlankLines: true, skipComments: true }],
    },
  },
);
