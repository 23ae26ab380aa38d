// Files of recordings: their formats, and which of their columns are which quantities.
import assert from "node:assert/strict";
import { test } from "node:test";
import { FORMATS, formatError, WRITTEN } from "../../src/api/formats.ts";
import { ProblemError } from "../../src/api/request.ts";
import { columnsParameter, mappingOf, simpleExpression, written } from "../../src/pages/import/mapping.ts";
import { QUANTITIES, UNITS } from "../../src/pages/import/quantities.ts";

const columns = [{ written: "x" }, { written: "'ball y'" }, { written: "#3" }];

test("a column in a unit, with a sign, is taken apart and written as it was", () => {
  for (const quantity of QUANTITIES)
    for (const { written: unit } of UNITS[quantity])
      for (const { written: column } of columns)
        for (const sign of ["", "-"]) {
          const parts = { column, unit, sign };
          assert.deepEqual(simpleExpression(written(parts), quantity, columns), parts);
        }
});

test("a sum, a factor and an unknown column stay an expression", () => {
  for (const expression of ["x*0.000235-0.079", "x/mm+#3/mm", "z/mm", "none", ""])
    assert.equal(simpleExpression(expression, "x_m", columns), undefined, expression);
});

test("the mapping that was found is what an import is given", () => {
  const quantity = (name, expression) => ({ quantity: name, expression });
  const quantities = [quantity("t_s", "t/ms"), quantity("cmd_qx_rad", null), quantity("x_m", "none")];
  const mapping = mappingOf({ quantities });
  assert.deepEqual(mapping, { t_s: "t/ms", cmd_qx_rad: "", cmd_qy_rad: "", x_m: "none", y_m: "" });
  assert.equal(columnsParameter(mapping), "t_s=t/ms, x_m=none");
});

test("a build without a format is told in words, other errors as they are", () => {
  const refused = (status) => new ProblemError(status, { detail: "as the service says" });
  assert.match(formatError(refused(406), "mcap").message, /built without MCAP files.*feature “mcap”/);
  assert.match(formatError(refused(406), "arrow").message, /built without Arrow files.*feature “parquet”/);
  for (const [error, name] of [
    [refused(400), "xlsx"],
    [refused(406), "csv"],
    [new TypeError("offline"), "mcap"],
  ])
    assert.equal(formatError(error, name), error);
  assert.ok(!WRITTEN.includes("xlsx"), "workbooks are only read");
  assert.equal(new Set(Object.values(FORMATS).map(({ mediaType }) => mediaType)).size, 6);
});
