// The words of the form of tags.
import assert from "node:assert/strict";
import { test } from "node:test";
import { tagsIn } from "../../src/words/tags.ts";

test("tags are the words of a text, each once", () => {
  assert.deepEqual(tagsIn(" hall-2, Prüfstand;  hall-2 "), ["hall-2", "Prüfstand"]);
  assert.deepEqual(tagsIn(" "), []);
});
