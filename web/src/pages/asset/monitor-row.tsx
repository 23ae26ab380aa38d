import type { Monitor } from "../../api/types";
import { MuteButton } from "./mute-button";
import { codeTitle } from "../../words/fault-names";
import { judgedShare } from "../../words/verdict";

/** Range of the fault detection counter of ISO 14229-1. */
const PASSED = -128;
const FAILED = 127;

function resultText({ code, counter, enabled, judged_s, t_s, muted }: Monitor): string {
  if (muted) return `not tested (muted by ${muted.by})`;
  if (counter === FAILED) return "failed";
  if (counter === PASSED) return "passed";
  if (enabled) return "testing";
  if (code !== "sensor") return "waiting for motion";
  return t_s != null && judged_s === 0 ? "no positions yet" : "waiting";
}

function readinessText({ complete_this_cycle, complete_since_clear }: Monitor): string {
  if (complete_this_cycle) return "the test has completed in this session";
  return complete_since_clear ? "no result in this session yet" : "no result yet";
}

function rowClass({ counter, enabled, muted }: Monitor): string {
  if (muted) return "monitor off";
  // Below zero nothing speaks for a fault; only a passed test says that there is none.
  const look = counter === FAILED ? "bad" : counter > 0 ? "warn" : counter === PASSED ? "ok" : "open";
  return `monitor monitor-${look}${enabled ? "" : " off"}`;
}

export function MonitorRow({ asset, monitor }: { asset: string; monitor: Monitor }) {
  const { code, counter, complete_this_cycle, muted } = monitor;
  const readiness = readinessText(monitor);
  const share = (counter - PASSED) / (FAILED - PASSED);
  return (
    <li class={rowClass(monitor)}>
      <span>{codeTitle(code)}</span>
      <meter
        class="counter"
        min={PASSED}
        max={FAILED}
        value={counter}
        aria-label={`${codeTitle(code)}: fault detection counter`}
        title={`fault detection counter ${counter}; ${readiness}; judged ${judgedShare(monitor)} of the session`}
      >
        {Math.round(share * 100)} %
      </meter>
      <span class="quiet">{resultText(monitor)}</span>
      <span class="ready" title={readiness}>
        <span aria-hidden="true">{complete_this_cycle && !muted ? "✓" : ""}</span>
        <span class="hidden">{readiness}</span>
      </span>
      <MuteButton asset={asset} code={code} mute={muted} />
    </li>
  );
}
