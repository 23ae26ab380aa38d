import { Choice } from "../../parts/choice";
import { ALARM_CODES, alarmCodeTitle } from "../../words/alarm";

const CODES: (readonly [string, string])[] = [
  ["", "Any"],
  ...ALARM_CODES.map((code) => [code, alarmCodeTitle(code)] as const),
];

/** Selects alarms by their code. */
export const FaultChoice = ({ code, change }: { code?: string; change: (code?: string) => void }) => (
  <Choice label="Fault" options={CODES} value={code ?? ""} change={(chosen) => change(chosen || undefined)} />
);
