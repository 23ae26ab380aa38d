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
    files: ["**/*.{ts,tsx}"],
    extends: [typescript.configs.recommendedTypeChecked],
    plugins: { "react-hooks": hooks },
    languageOptions: { parserOptions: { projectService: { allowDefaultProject: ["vite.config.ts"] } } },
    rules: {
      // Handlers of events may be asynchronous: nobody waits for what they return.
      "@typescript-eslint/no-misused-promises": ["error", { checksVoidReturn: { attributes: false } }],
      "react-hooks/rules-of-hooks": "error",
    },
  },
  // Runs in Node, whose types the page has no use for.
  { files: ["vite.config.ts"], extends: [typescript.configs.disableTypeChecked] },
  {
    // Functions in a test run in Node or, handed to the browser, in the page.
    files: ["**/*.{mjs,js}"],
    languageOptions: { globals: { ...globals.node, ...globals.browser } },
  },
);
