// Checks an AsyncAPI document with the official parser: node check.mjs FILE
import { readFileSync } from "node:fs";
import { DiagnosticSeverity, Parser } from "@asyncapi/parser";

const { document, diagnostics } = await new Parser().parse(readFileSync(process.argv[2], "utf8"));
const errors = diagnostics.filter(({ severity }) => severity === DiagnosticSeverity.Error);
for (const { path, message } of errors) {
    console.error(`/${path.join("/")}: ${message}`);
}
if (!document || errors.length > 0) {
    process.exit(1);
}
console.log(`${document.channels().length} channels, ${document.operations().length} operations`);
