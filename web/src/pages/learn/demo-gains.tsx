import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { DemoGains as Gains } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { useRefusal } from "../../parts/login/rights";
import { number } from "../../words/numbers";

/** Polling interval, ms: other visitors of the demo may tune the controller too. */
const INTERVAL_MS = 2000;

/** Name, symbol, unit and largest value of each gain; the service has the same ranges. */
const SLIDERS = [
  ["kp", "Kp", "rad/m", 10],
  ["ki", "Ki", "rad/(m·s)", 4],
  ["kd", "Kd", "rad·s/m", 7],
] as const;

interface SliderProps {
  symbol: string;
  unit: string;
  most: number;
  value: number;
  /** Is called while the slider moves. */
  move: (value: number) => void;
  /** Is called when it has been moved. */
  release: () => void;
}

function GainSlider({ symbol, unit, most, value, move, release }: SliderProps) {
  const refused = useRefusal("operator");
  const text = number(value, 2, unit);
  return (
    <label>
      <span>
        {symbol} <span class="n">{text}</span>
      </span>
      <input
        type="range"
        min={0}
        max={most}
        step={0.01}
        value={value}
        aria-label={symbol}
        aria-valuetext={text}
        disabled={refused !== undefined}
        title={refused}
        onInput={(e) => move(Number(e.currentTarget.value))}
        onChange={release}
      />
    </label>
  );
}

/** Sliders for the gains of the controller of the demo's rig. */
export function DemoGains() {
  const { data, error, refetch } = useQuery(api.demoTuning, "gains", INTERVAL_MS);
  /** Gains of a slider that is being moved. */
  const [moved, setMoved] = useState<Partial<Gains>>({});
  const [refusal, setRefusal] = useState<unknown>();
  if (!data) return <ErrorMessage error={error} />;
  const { initial } = data;
  const gains = { ...data.gains, ...moved };
  const tune = (wanted: Gains) => api.tuneDemo(wanted).then(refetch);
  const release = () =>
    tune(gains)
      .then(() => setRefusal(undefined), setRefusal)
      .finally(() => setMoved({}));
  return (
    <>
      <h2>Controller</h2>
      <div class="page-tools" role="group" aria-label="Gains of the controller">
        {SLIDERS.map(([name, symbol, unit, most]) => (
          <GainSlider
            key={name}
            {...{ symbol, unit, most, value: gains[name] }}
            move={(value) => setMoved({ [name]: value })}
            release={() => void release()}
          />
        ))}
        <ActionButton action={() => tune(initial)} needs="operator">
          Reset the gains
        </ActionButton>
      </div>
      <ErrorMessage error={refusal} />
      <p class="quiet small-text">
        The commanded angle is Kp times the distance of the ball to where it should be, plus Ki times its
        integral, minus Kd times the velocity. With half the Kd, or five times the Ki, the ball oscillates and
        no fault is raised, because the rig obeys its controller. Bounces off the rim are not tested.
      </p>
    </>
  );
}
