import { DEGREE } from "./description";
import type { FieldsProps } from "./number-input";

const POSITION_UNITS = [
  { word: "m", metres: 1 },
  { word: "mm", metres: 0.001 },
  { word: "cm", metres: 0.01 },
];

export function UnitFields({ description, set }: FieldsProps) {
  return (
    <fieldset>
      <legend>Units that the device sends</legend>
      <div class="form-row">
        <label>
          Ball's position{" "}
          <select
            value={description.positionUnit}
            onChange={(e) => set({ positionUnit: Number(e.currentTarget.value) })}
          >
            {POSITION_UNITS.map(({ word, metres }) => (
              <option value={metres}>{word}</option>
            ))}
          </select>
        </label>
        <label>
          Commands{" "}
          <select
            value={description.commandUnit}
            onChange={(e) => set({ commandUnit: Number(e.currentTarget.value) })}
          >
            <option value={1}>rad</option>
            <option value={DEGREE}>degrees</option>
          </select>
        </label>
      </div>
      <p class="quiet small-text">
        Commands are angles of the plate, not of the servo horn. +qy moves the ball toward +x, +qx toward −y;
        step 3 checks this.
      </p>
    </fieldset>
  );
}
