// The addresses of the page's views, and the queries of requests.
import assert from "node:assert/strict";
import { test } from "node:test";
import { query } from "../../src/api/request.ts";
import {
  faultPath,
  fleetPath,
  path,
  rigPath,
  sessionPath,
  sessionsPath,
  setUpPath,
} from "../../src/router/paths.ts";

test("paths lead to the views", () => {
  assert.equal(rigPath("bench-1"), "/rigs/bench-1");
  assert.equal(faultPath("bench-1", "x_servo"), "/rigs/bench-1/faults/x_servo");
  assert.equal(setUpPath("bench-1"), "/rigs/bench-1/set-up");
  assert.equal(setUpPath("bench-1", "check"), "/rigs/bench-1/set-up?step=check");
  assert.equal(sessionsPath(), "/sessions");
  assert.equal(sessionsPath(""), "/sessions");
  assert.equal(sessionsPath("a b"), "/sessions?asset=a%20b");
  assert.equal(sessionsPath("", "ü"), "/sessions?tag=%C3%BC");
  assert.equal(sessionsPath("a", "b"), "/sessions?asset=a&tag=b");
  assert.equal(fleetPath(), "/");
  assert.equal(fleetPath({ tag: "hall-2" }), "/?tag=hall-2");
});

test("a session is opened at a time, including 0", () => {
  assert.equal(sessionPath("7"), "/sessions/7");
  assert.equal(sessionPath("7", null), "/sessions/7");
  assert.equal(sessionPath("7", 0), "/sessions/7?t=0.00");
  assert.equal(sessionPath("7", 12.345), "/sessions/7?t=12.35");
});

test("any name survives the encoding in an address", () => {
  for (const name of ["a/b", "100 %", "?x=1#y", "ünï", "..%2F"]) {
    const url = new URL(path("rigs", name), "http://host");
    assert.deepEqual(url.pathname.split("/").map(decodeURIComponent), ["", "rigs", name]);
    assert.equal(url.search + url.hash, "");
  }
});

test("a query leaves out what is missing and keeps zero and false", () => {
  assert.equal(query({}), "");
  assert.equal(query({ a: undefined, b: null, c: "" }), "");
  assert.equal(query({ a: 0, b: false, c: "x y&z" }), "?a=0&b=false&c=x+y%26z");
});
