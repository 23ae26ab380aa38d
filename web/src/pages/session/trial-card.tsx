import type { FaultCode, Thresholds, Trial } from "../../api/types";
import { ErrorMessage } from "../../parts/error-message";
import { Term } from "../../parts/term";
import { isTried, type TriedSettings, type TriedValues } from "./trial";
import { TrialRow } from "./trial-row";
import type { TrialState } from "./use-trial";

interface Props {
  thresholds: Thresholds[];
  settings: TriedSettings;
  choose: (settings: TriedSettings) => void;
  state: TrialState;
  /** The card, whose reader wants to know what is found. */
  card: (card: HTMLElement | null) => void;
}

/** Sliders for limits and debounce times, with the alarms that they would raise on this session. */
export function TrialCard({ thresholds, settings, choose, state: { trial, baseline, error }, card }: Props) {
  const set = (code: FaultCode, values: TriedValues) => choose({ ...settings, [code]: values });
  const of = (code: FaultCode, from?: Trial) =>
    from?.monitors.find((monitor) => monitor.thresholds.code === code);
  return (
    <section class="card" ref={card}>
      <h2>Try other limits</h2>
      <p class="quiet">
        Counts the alarms that other limits and debounce times would raise on this session on its own,
        ignoring earlier sessions, and marks them in the charts. Nothing is stored.
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label="Limits and debounce times">
        <table class="trial">
          <thead>
            <tr>
              <th scope="col">Monitor</th>
              <th scope="col">Limits</th>
              <th scope="col">
                <Term of="debounce">Debounce</Term>
              </th>
              <th scope="col" class="n">
                <Term of="confirmed">Confirmed</Term>
              </th>
              <th scope="col" class="n">
                Test failed
              </th>
            </tr>
          </thead>
          <tbody aria-live="polite">
            {thresholds.map((one) => (
              <TrialRow
                key={one.code}
                thresholds={one}
                values={settings[one.code] ?? {}}
                set={(values) => set(one.code, values)}
                found={of(one.code, trial)}
                baseline={isTried(settings) ? of(one.code, baseline) : undefined}
              />
            ))}
          </tbody>
        </table>
      </div>
      <ErrorMessage error={error} />
      <button type="button" disabled={!isTried(settings)} onClick={() => choose({})}>
        Reset
      </button>
    </section>
  );
}
