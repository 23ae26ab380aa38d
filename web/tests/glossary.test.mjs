// The explanations of technical terms.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let service, chromium, rig;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

test("technical terms are explained under the pointer and with the keyboard", async () => {
  const session = await imported(service.url, "bench", "explained", rig.sick);
  for (const width of [1280, 390]) {
    const view = await page(chromium, { viewport: { width, height: 800 } });
    await view.goto(`${service.url}/sessions/${session.id}`);
    const term = view.getByRole("button", { name: "Residual along y" });
    const tooltip = view.getByRole("tooltip");
    await term.focus();
    await tooltip.getByText("Measured minus predicted acceleration").waitFor();
    const described = await term.evaluate((of) => {
      const text = document.getElementById(of.getAttribute("aria-describedby"));
      const [{ left, right, top, bottom }, term] = [text, of].map((box) => box.getBoundingClientRect());
      const isBeside = Math.abs(top - term.bottom) < 2 || Math.abs(bottom - term.top) < 2;
      return [text.getAttribute("role"), left >= 0 && right <= innerWidth, isBeside];
    });
    assert.deepEqual(described, ["tooltip", true, true], "within the window, beside the term");
    await view.keyboard.press("Escape");
    await tooltip.waitFor({ state: "detached" });
    const other = view.getByRole("button", { name: "Debounce", exact: true });
    await other.hover();
    await tooltip.getByText("How long a failure must last").hover();
    await tooltip.waitFor();
    await view.mouse.move(2, 2);
    await tooltip.waitFor({ state: "detached" });
    assert.deepEqual(view.errors, []);
    await view.done();
  }
});
