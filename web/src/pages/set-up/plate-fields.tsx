import { NumberInput, type FieldsProps } from "./number-input";

export function PlateFields(fields: FieldsProps) {
  const { description, set } = fields;
  return (
    <fieldset>
      <legend>Plate and servos</legend>
      <div class="form-row">
        <label>
          Shape{" "}
          <select
            value={description.isRound ? "round" : "rectangle"}
            onChange={(e) => set({ isRound: e.currentTarget.value === "round" })}
          >
            <option value="rectangle">rectangle</option>
            <option value="round">round</option>
          </select>
        </label>
        {description.isRound ? (
          <NumberInput {...fields} field="diameter" label="Diameter" unit="mm" />
        ) : (
          <>
            <NumberInput {...fields} field="length" label="Length along x" unit="mm" />
            <NumberInput {...fields} field="width" label="Width along y" unit="mm" />
          </>
        )}
        <NumberInput {...fields} field="limit" label="Largest plate angle" unit="°" />
        <label class="check">
          <input
            type="checkbox"
            checked={description.hasRim}
            onChange={(e) => set({ hasRim: e.currentTarget.checked })}
          />{" "}
          a rim stops the ball
        </label>
      </div>
    </fieldset>
  );
}
