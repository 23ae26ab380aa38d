// What the formatter cannot see: mistakes, misused hooks, and pieces too long to take in at a look.
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
      // A file is seen at one look, and so is a function; what is about one thing is not longer.
      "max-lines": ["error", 150],
      "max-lines-per-function": ["error", { max: 50, skipBlankLines: true, skipComments: true }],
      // The formatter breaks lines at 110 columns; words that it cannot break may be a little longer.
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
      // Handlers of events may be asynchronous: nobody waits for what they return.
      "@typescript-eslint/no-misused-promises": ["error", { checksVoidReturn: { attributes: false } }],
      "react-hooks/rules-of-hooks": "error",
      "react-hooks/exhaustive-deps": "error",
    },
  },
  // Runs in Node, whose types the page has no use for.
  { files: ["vite.config.ts"], extends: [typescript.configs.disableTypeChecked] },
  {
    // Functions in a test run in Node or, handed to the browser, in the page.
    files: ["**/*.{mjs,js}"],
    languageOptions: { globals: { ...globals.node, ...globals.browser } },
    rules: {
      // A test tells a story from its beginning to its end.
      "max-lines": ["error", 200],
      "max-lines-per-function": ["error", { max: 80, skipBlankLines: true, skipComments: true }],
    },
  },
);
