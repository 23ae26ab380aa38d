import { ALARM_CODES, alarmCodeTitle } from "../../words/alarm";

/** Selects alarms by their code. */
export function FaultChoice({ code, change }: { code?: string; change: (code?: string) => void }) {
  return (
    <label>
      Fault
      <select value={code ?? ""} onChange={(e) => change(e.currentTarget.value || undefined)}>
        <option value="">Any</option>
        {ALARM_CODES.map((code) => (
          <option value={code}>{alarmCodeTitle(code)}</option>
        ))}
      </select>
    </label>
  );
}
